"""The planned order of a sweep whose jobs another launcher than ours runs, each in a process of its own."""

import json
from pathlib import Path

from jerkbench.files import write_text
from jerkbench.sweep.tasks import Planned

FOLDER = ".order"
"""In the study's folder: a file for each job, named by its number."""


def forget_order(folder: Path) -> None:
    """Delete what an earlier sweep has left."""
    for path in _files(folder):
        path.unlink(missing_ok=True)


def note_place(folder: Path, number: int, planned: Planned) -> None:
    """Note what the job ``number`` is: a cell, and its seeds."""
    write_text(folder / FOLDER / f"{number:07d}", json.dumps([planned.key, list(planned.draws)]))


def take_order(folder: Path) -> dict[str, list[int]]:
    """Return the cells of all jobs in order, each with its seeds, and delete the notes."""
    found: dict[str, set[int]] = {}
    for path in _files(folder):
        key, draws = json.loads(path.read_text(encoding="utf-8"))
        found.setdefault(key, set()).update(draws)
    forget_order(folder)
    if (folder / FOLDER).is_dir():
        (folder / FOLDER).rmdir()
    return {key: sorted(draws) for key, draws in found.items()}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / FOLDER).glob("*") if path.name.isdecimal())
