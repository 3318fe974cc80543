"""The folder of fetched recordings, and the default folder of a recording."""

import os
from pathlib import Path

from jerkbench.errors import RecordingError
from jerkbench.files import user_cache_folder

VARIABLE = "JERKBENCH_DATA"
"""Environment variable that names the folder of all fetched recordings."""


def fetched_folder(name: str) -> Path:
    """Return the folder of the fetched recording ``name``, whether it was fetched or not."""
    root = os.environ.get(VARIABLE)
    if root:
        return Path(root).expanduser() / name
    return user_cache_folder() / name


FETCHED = "fetched:"
"""Before the name of a fetched recording, in the place of a folder."""


def named_folder(folder: str) -> Path:
    """Return the path of ``folder``: itself a path, or ``fetched:NAME``.

    Raises:
        RecordingError: the recording of that name was not fetched.
    """
    if folder.startswith(FETCHED):
        return recording_folder("", folder.removeprefix(FETCHED))
    return Path(folder).expanduser()


def recording_folder(folder: str, name: str) -> Path:
    """Return ``folder`` where it is not empty, else that of the fetched recording ``name``.

    Raises:
        RecordingError: ``folder`` is empty, and the recording was not fetched.
    """
    if folder:
        return Path(folder).expanduser()
    fetched = fetched_folder(name)
    if not fetched.is_dir():
        raise RecordingError(
            f"No folder was given, and the recording {name} was not fetched: run `jerkbench data fetch {name}`, or give"
            " dataset.folder=FOLDER."
        )
    return fetched
