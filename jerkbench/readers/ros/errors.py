"""The one error for all that libraries raise on a damaged bag."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jerkbench.errors import JerkbenchError, RecordingError


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
        where = f"{path}, topic {topic}" if topic else f"{path}"
        raise BagError(f"{where} cannot be read: {_reason(error)}. {way_out(path)}") from error


def _reason(error: Exception) -> str:
    message = " ".join(str(error).split()).rstrip(".")
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def way_out(path: Path) -> str:
    """Return what to do about a damaged bag."""
    if path.suffix == ".bag":
        return "Copy it again; `jerkbench data salvage` saves what is whole in a damaged ROS 1 bag."
    return "Copy it again from where it was recorded, or let `ros2 bag reindex` and `mcap recover` mend it."
