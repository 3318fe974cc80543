"""The remarks of an attitude filter on the recordings of a cell, before the run and under its table."""

from collections.abc import Iterable

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Remarking
from jerkbench.execution import inputs
from jerkbench.recording import Recording


def remarks_of(cell: Cell, recording: Recording) -> list[str]:
    """Return its sentences, each with the data set's name."""
    name = cell.labels.dataset.partition("(")[0]
    remarks = cell.attitude.remarks(recording) if isinstance(cell.attitude, Remarking) else ()
    return [f"{name}: {remark}" for remark in remarks]


def first_remarks(cells: Iterable[tuple[Cell, str]]) -> list[str]:
    """Return what is to be said of recorded drives before they run; simulated ones are remarked on under the table.

    Args:
        cells: what is going to run, each with the fingerprint of its data.
    """
    answered: set[object] = set()
    lines: dict[str, None] = {}
    for cell, fingerprint in cells:
        question = cell.dataset, cell.disturbances, cell.attitude
        if cell.dataset.seeded or question in answered:
            continue
        answered.add(question)
        lines.update(dict.fromkeys(_of_first_seed(cell, fingerprint)))
    return list(lines)


def _of_first_seed(cell: Cell, fingerprint: str) -> list[str]:
    if not isinstance(cell.attitude, Remarking):
        return []
    try:
        return remarks_of(cell, inputs.disturbed(cell.dataset, cell.disturbances, fingerprint, cell.draws[0]))
    except Exception:  # noqa: BLE001 - what cannot be loaded becomes a row that says so, when it is run
        return []
