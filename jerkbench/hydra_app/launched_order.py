"""The planned order of a sweep whose jobs another launcher than ours runs, each in a process of its own."""

from pathlib import Path

from jerkbench.files import write_text

FOLDER = ".order"
"""In the study's folder: a file for each job, named by its number."""


def forget_order(folder: Path) -> None:
    """Delete what an earlier sweep has left."""
    for path in _files(folder):
        path.unlink(missing_ok=True)


def note_place(folder: Path, number: int, key: str) -> None:
    """Note that the job ``number`` is the cell ``key``."""
    write_text(folder / FOLDER / f"{number:07d}", key)


def take_order(folder: Path) -> list[str]:
    """Return the cells of all jobs in order, each once, and delete the notes."""
    keys = [path.read_text(encoding="utf-8") for path in _files(folder)]
    forget_order(folder)
    if (folder / FOLDER).is_dir():
        (folder / FOLDER).rmdir()
    return list(dict.fromkeys(keys))


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / FOLDER).glob("*") if path.name.isdecimal())
