"""The files of a bag, the check that their content fits their names, and the one error of a damaged one."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jerkbench.errors import JerkbenchError, RecordingError

# The one error for all that libraries raise on a damaged bag.


class BagError(RecordingError):
    """A bag that cannot be read: which file, which topic, and the way out."""


@contextmanager
def bag_errors(path: Path, topic: str = "") -> Iterator[None]:
    """Turn whatever is raised inside into a BagError that names ``path`` and ``topic``.

    rosbags raises a dozen unrelated types on damage (its own, those of lz4, bz2, zstd, SQLite and YAML, and those of
    Python where an assertion or a struct fails), so that everything but our own errors is caught here.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except PermissionError as error:
        raise BagError(f"{path} cannot be read: {error.strerror}; give yourself the right to read it.") from error
    except Exception as error:
        where, message = f"{path}, topic {topic}" if topic else f"{path}", " ".join(str(error).split()).rstrip(".")
        reason = f"{type(error).__name__}{': ' if message else ''}{message}"
        raise BagError(f"{where} cannot be read: {reason}. {way_out(path)}") from error


def way_out(path: Path) -> str:
    """Return what to do about a damaged bag."""
    if path.suffix == ".bag":
        return "Copy it again; `jerkbench data salvage` saves what is whole in a damaged ROS 1 bag."
    return "Copy it again from where it was recorded, or let `ros2 bag reindex` and `mcap recover` mend it."


MAGIC = {b"#ROSBAG V": ".bag", b"SQLite format 3\0": ".db3", b"\x89MCAP0": ".mcap"}
"""First bytes of a file, and the suffix that it needs to be read."""

_SPLIT = re.compile(r"^(.*)_(\d+)$")
_STARTED = re.compile(r"_?\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d$")
"""The time that `rosbag record` writes before the number of a part: the part's begin."""


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return what to open: one file, the parts of a split ROS 1 bag in a folder, or the folder of a ROS 2 bag.

    Raises:
        BagError: there is nothing, it is empty, or its content is not what its suffix says.
    """
    if path.is_dir():
        return (path,) if (path / "metadata.yaml").exists() else _parts(path)
    return (_checked(path),)


def content_files(path: Path) -> tuple[Path, ...]:
    """Return every file whose bytes make the bag, for its fingerprint.

    Raises:
        BagError: as in `bag_files`.
    """
    inside = [p for top in bag_files(path) for p in (sorted(top.iterdir()) if top.is_dir() else [top])]
    return tuple(p for p in inside if p.is_file())


def missing_parts(paths: tuple[Path, ...]) -> list[int]:
    """Return the numbers that are missing between the parts of split bags (name_0.bag, name_1.bag, ...)."""
    numbers = [_number(path)[0] for path in paths]
    return sorted(set(range(max(numbers) + 1)) - set(numbers)) if len(numbers) > 1 else []


def _parts(folder: Path) -> tuple[Path, ...]:
    parts = sorted(folder.glob("*.bag"), key=_number) or sorted(folder.glob("*.mcap")) or sorted(folder.glob("*.db3"))
    if not parts:
        raise BagError(f"{folder} holds no metadata.yaml and no .bag, .mcap or .db3; give the bag itself.")
    if parts[0].suffix != ".bag" and len(parts) > 1:
        raise BagError(
            f"{folder} holds {len(parts)} files ending in {parts[0].suffix} but no metadata.yaml; copy it there, or let"
            " `ros2 bag reindex` write it."
        )
    if len({_drive(part) for part in parts}) > 1:
        raise BagError(
            f"{folder} holds {len(parts)} bags that are no parts of one ({', '.join(part.name for part in parts)}):"
            " give one of them; the parts of one are called NAME_0.bag, NAME_1.bag, ..."
        )
    return tuple(map(_checked, parts))


def _drive(part: Path) -> str:
    """Return the common part of the names of one drive's parts; of any other file, its own name."""
    match = _SPLIT.match(part.stem)
    return f"{_STARTED.sub('', match[1])}_*" if match else part.name


def _number(path: Path) -> tuple[int, str]:
    match = _SPLIT.match(path.stem)
    return (int(match[2]) if match else -1, path.name)


def _checked(path: Path) -> Path:
    """Return the path of a file whose content is what its suffix says."""
    try:
        with path.open("rb") as file:
            first = file.read(16)
    except FileNotFoundError as error:
        raise BagError(f"There is no bag {path}; correct the path.") from error
    except OSError as error:
        raise BagError(f"{path} cannot be read: {error.strerror}.") from error
    if not first:
        raise BagError(f"{path} is empty; copy it again from where it was recorded.")
    suffix = next((suffix for magic, suffix in MAGIC.items() if first.startswith(magic)), "")
    if not suffix:
        raise BagError(
            f"{path} begins neither like a ROS 1 bag nor like SQLite (.db3) or mcap; it is another kind of file,"
            " compressed as a whole, or damaged at its start: unpack it or copy it again."
        )
    if path.suffix != suffix:
        raise BagError(f"{path} is a {suffix} file by its content; rename it so that it ends in {suffix}.")
    return path
