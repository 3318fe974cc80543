"""Files of a recording: finding them, the hash of their bytes, and the folder of what was fetched."""

import hashlib
import os
import time
from functools import lru_cache
from pathlib import Path
from tokenize import TokenError
from typing import ClassVar

from jerkbench.errors import RecordingError
from jerkbench.files import user_cache_folder

NO_ARRAY = (ValueError, EOFError, OSError, TypeError, SyntaxError, TokenError, MemoryError, OverflowError)
"""Errors of a damaged NumPy file."""

RESTING_NS = 2_000_000_000
"""A file that was changed more recently could change again within the resolution of its time stamp."""


def find_file(folder: Path, name: str, suffix: str, parameter: str) -> Path:
    """Return ``folder / name``, or, where ``name`` is empty, the one file of ``folder`` that ends in ``suffix``.

    Raises:
        RecordingError: the folder or the file is missing, or several files fit; says which ``parameter`` names one.
    """
    if not folder.is_dir():
        raise RecordingError(f"There is no folder {folder}; give the one that the recording was copied to.")
    if name:
        if not (folder / name).is_file():
            raise RecordingError(f"There is no file {folder / name}; correct '{parameter}' or copy the file there.")
        return folder / name
    names = sorted(path.name for path in folder.iterdir() if path.name.endswith(suffix) and path.is_file())
    if len(names) != 1:
        candidates = f"{len(names)} files ({', '.join(names)})" if names else "no file"
        raise RecordingError(f"{folder} has {candidates} ending in {suffix}; give the name as '{parameter}'.")
    return folder / names[0]


def fingerprint(paths: tuple[Path, ...]) -> str:
    """Return the SHA-256 over the bytes of ``paths``, one after the other."""
    return hashlib.sha256("".join(_sha256(path, _version(path)) for path in paths).encode()).hexdigest()


class FromFiles:
    """A data set that is read from files: another seed changes nothing, and its data are their bytes."""

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"

    def paths(self) -> tuple[Path, ...]:
        """Return the files that are read."""
        raise NotImplementedError

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the files."""
        return fingerprint(self.paths())


def _version(path: Path) -> tuple[int, ...]:
    """What changes with a file; one that has not rested since it was changed has another version each time."""
    stat, now_ns = path.stat(), time.time_ns()
    unrested = now_ns if now_ns - stat.st_ctime_ns < RESTING_NS else 0
    return stat.st_ino, stat.st_ctime_ns, stat.st_mtime_ns, stat.st_size, unrested


@lru_cache(maxsize=64)
def _sha256(path: Path, version: tuple[int, ...]) -> str:  # noqa: ARG001 - it says when to read it again
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# The folder of fetched recordings, and the default folder of a recording.

VARIABLE = "JERKBENCH_DATA"
"""Environment variable that names the folder of all fetched recordings."""


def fetched_folder(name: str) -> Path:
    """Return the folder of the fetched recording ``name``, whether it was fetched or not."""
    root = os.environ.get(VARIABLE)
    return (Path(root).expanduser() if root else user_cache_folder()) / name


FETCHED = "fetched:"
"""Before the name of a fetched recording, in the place of a folder."""

FOLDER = "dataset.folder=FOLDER"
"""What a message offers beside fetching."""


def named_folder(folder: str, otherwise: str = FOLDER) -> Path:
    """Return the path of ``folder``: itself a path, or ``fetched:NAME``.

    Raises:
        RecordingError: the recording of that name was not fetched.
    """
    if folder.startswith(FETCHED):
        return recording_folder("", folder.removeprefix(FETCHED), otherwise)
    return Path(folder).expanduser()


def recording_folder(folder: str, name: str, otherwise: str = FOLDER) -> Path:
    """Return ``folder`` where it is not empty, else that of the fetched recording ``name``.

    Raises:
        RecordingError: ``folder`` is empty, and the recording was not fetched.
    """
    if folder:
        return Path(folder).expanduser()
    fetched = fetched_folder(name)
    if not fetched.is_dir():
        raise RecordingError(
            f"The recording {name} was not fetched: run `jerkbench data fetch {name}`, or give {otherwise}."
        )
    return fetched
