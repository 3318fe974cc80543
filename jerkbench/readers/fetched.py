"""Where fetched recordings are, and the folder of a recording for which none was given."""

import os
from pathlib import Path

from jerkbench.errors import RecordingError
from jerkbench.files import user_cache_folder

VARIABLE = "JERKBENCH_DATA"
"""Environment variable that names the folder of all fetched recordings."""


def fetched_folder(name: str) -> Path:
    """Where the fetched recording ``name`` is, or would be."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(given).expanduser() / name
    return user_cache_folder() / name


FETCHED = "fetched:"
"""Before the name of a fetched recording, in the place of a folder."""


def named_folder(given: str) -> Path:
    """Return the folder that was given: a path, or ``fetched:NAME``.

    Raises:
        RecordingError: the recording of that name was not fetched.
    """
    if given.startswith(FETCHED):
        return recording_folder("", given.removeprefix(FETCHED))
    return Path(given).expanduser()


def recording_folder(given: str, name: str) -> Path:
    """Return the folder that was given, or that of the fetched recording ``name``.

    Raises:
        RecordingError: none was given, and the recording was not fetched.
    """
    if given:
        return Path(given).expanduser()
    folder = fetched_folder(name)
    if not folder.is_dir():
        raise RecordingError(
            f"No folder was given, and the recording {name} was not fetched: run `jerkbench data fetch {name}`, or give"
            " dataset.folder=FOLDER."
        )
    return folder
