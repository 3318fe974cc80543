"""Mistakes in recorded drives, told before they run."""

from collections.abc import Iterable

from jerkbench.contracts import Dataset
from jerkbench.inspection.doctor import first_diagnoses
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.inputs import Inputs


def first_mistakes(cells: Iterable[Cell], inputs: Inputs) -> list[str]:
    """Return what is surely wrong with each recorded drive, without disturbances; `data inspect` finds more.

    Args:
        cells: what is going to run.
        inputs: recordings that are shared.
    """
    drives: dict[Dataset, Cell] = {cell.dataset: cell for cell in cells if not cell.dataset.seeded}
    return [line for cell in drives.values() for line in _of_drive(cell, inputs)]


def _of_drive(cell: Cell, inputs: Inputs) -> list[str]:
    name = cell.labels.dataset.partition("(")[0]
    try:
        recording = inputs.undisturbed(cell.dataset, cell.draws[0])
    except Exception:  # noqa: BLE001 - what cannot be loaded becomes a row that says so, when it is run
        return []
    return [f"{name}: {diagnosis}" for diagnosis in first_diagnoses(recording)]
