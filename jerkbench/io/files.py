"""Files of a recording: search, hashes, bytes and lines, and the folder of fetched recordings."""

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
"""Exceptions that NumPy raises for a damaged file."""

RESTING_NS = 2_000_000_000
"""Minimum time since the last change of a file. After a more recent change, the file could change again within the
resolution of its time stamp."""


_MARKS = "_events.pos"
"""Ending of the files with times of events that RTKLIB writes with a solution."""


def find_files(folder: Path, pattern: str, parameter: str) -> tuple[Path, ...]:
    """Return the sorted files in ``folder`` that match ``pattern`` (a name, or a glob such as ``data/*.txt``).

    RTKLIB also writes the file name_events.pos with the times of events. This file matches only a pattern that ends in
    "_events.pos".

    Raises:
        RecordingError: the folder does not exist, or no file matches.
    """
    if not folder.is_dir():
        raise RecordingError(f"There is no folder {folder}; give the folder that the recording was copied to.")
    try:
        fitting = [path for path in folder.glob(pattern) if path.is_file()]
        paths = tuple(sorted(p for p in fitting if not p.name.endswith(_MARKS) or pattern.endswith(_MARKS)))
    except (ValueError, NotImplementedError, OSError) as error:
        raise RecordingError(
            f"{parameter} is '{pattern}', which is invalid ({error}); give a name or a pattern below {folder}."
        ) from error
    if not paths:
        raise RecordingError(f"There is no file {folder / pattern}; correct '{parameter}' or copy the file there.")
    return paths


def find_file(folder: Path, name: str, suffix: str, parameter: str) -> Path:
    """Return ``folder / name``. If ``name`` is empty, return the only file in ``folder`` that ends in ``suffix``.

    Raises:
        RecordingError: the folder or the file is missing, or several files match. The error message names
            ``parameter``.
    """
    paths = find_files(folder, name or f"*{suffix}", parameter)
    if len(paths) > 1:
        names = ", ".join(path.name for path in paths)
        raise RecordingError(
            f"{folder} contains {len(paths)} files that end in {suffix} ({names}); set '{parameter}' to one of them."
        )
    return paths[0]


def fingerprint(paths: tuple[Path, ...]) -> str:
    """Return the SHA-256 of the concatenated SHA-256 hashes of the files ``paths``."""
    return hashlib.sha256("".join(_sha256(path, _version(path)) for path in paths).encode()).hexdigest()


class FromFiles:
    """A data set that is read from files, so that its recording does not depend on the seed."""

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of all files that the data set reads."""
        raise NotImplementedError

    def fingerprint(self) -> str:
        """Return a hash of the content of all files that the data set reads."""
        return fingerprint(self.paths())


def _version(path: Path) -> tuple[int, ...]:
    """Return a cache key that changes with the file, and in each call if the file was changed a short time ago."""
    stat, now_ns = path.stat(), time.time_ns()
    unrested = now_ns if now_ns - stat.st_ctime_ns < RESTING_NS else 0
    return stat.st_ino, stat.st_ctime_ns, stat.st_mtime_ns, stat.st_size, unrested


@lru_cache(maxsize=64)
def _sha256(path: Path, version: tuple[int, ...]) -> str:  # noqa: ARG001 - the key of the cache
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# The content of a file, as bytes or lines.

SAMPLE = 1 << 17
"""Number of bytes that are examined at once before a file is read."""

Line = tuple[int, str]
"""A line's number in its file (from 1) and its text."""


def require_content(path: Path) -> None:
    """Check that the file is readable and not empty.

    Raises:
        RecordingError: the file does not exist, cannot be read, or contains only white space.
    """
    try:
        with path.open("rb") as file:
            blank = not any(block.strip() for block in iter(lambda: file.read(SAMPLE), b""))
    except FileNotFoundError as error:
        raise RecordingError(f"There is no file {path}; check the folder and the file's name.") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}.") from error
    if blank:
        raise RecordingError(f"{path} is empty; copy the file again from its source.")


def read_bytes(path: Path) -> bytes:
    """Return the content of a file, which must not be empty.

    Raises:
        RecordingError: the file does not exist, cannot be read, or is empty.
    """
    require_content(path)
    return path.read_bytes()


def read_lines(path: Path) -> list[Line]:
    """Return the lines of a file that are not blank. Non-ASCII bytes become a replacement character.

    Raises:
        RecordingError: the file does not exist, cannot be read, or is empty.
    """
    text = read_bytes(path).decode("ascii", errors="replace")
    return [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]


def is_number(entry: str) -> bool:
    """Return whether an entry is a number. Python numbers with underscores, such as 1_000, do not count."""
    try:
        float(entry)
    except ValueError:
        return False
    return "_" not in entry


# The folders of fetched recordings.

VARIABLE = "JERKBENCH_DATA"
"""Environment variable that names the folder of all fetched recordings."""


def fetched_folder(name: str) -> Path:
    """Return the folder of the fetched recording ``name``, which does not exist if the recording was not fetched."""
    root = os.environ.get(VARIABLE)
    return (Path(root).expanduser() if root else user_cache_folder()) / name


FETCHED = "fetched:"
"""Prefix of the name of a fetched recording, instead of a folder."""

FOLDER = "dataset.folder=FOLDER"
"""The alternative to fetching that error messages suggest."""


def named_folder(folder: str, otherwise: str = FOLDER) -> Path:
    """Return the path of ``folder``, which is a path or ``fetched:NAME``.

    Raises:
        RecordingError: the recording NAME was not fetched. The error message suggests ``otherwise`` as the alternative
            to fetching.
    """
    if not folder.startswith(FETCHED):
        return Path(folder).expanduser()
    name = folder.removeprefix(FETCHED)
    fetched = fetched_folder(name)
    if not fetched.is_dir():
        raise RecordingError(
            f"The recording {name} was not fetched: run `jerkbench data fetch {name}`, or give {otherwise}."
        )
    return fetched
