"""The preflight: a recording that lacks what its filters ask for is refused before anything runs."""

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Requiring
from jerkbench.errors import JerkbenchError


def require_inputs(cell: Cell, checked: set[tuple[object, object]]) -> None:
    """Ask attitude filter and filter whether the recording of the first seed has what they need.

    Args:
        cell: the combination; its recording is loaded only if one of them has such a question.
        checked: data sets with the parts that were asked before; grows.

    Raises:
        JerkbenchError: the recording lacks an input, or there is no recording.
    """
    for part in (cell.attitude, cell.filter):
        if isinstance(part, Requiring) and (cell.dataset, part) not in checked:
            _ask(part, cell)
            checked.add((cell.dataset, part))


def _ask(part: Requiring, cell: Cell) -> None:
    try:
        part.require(lambda: cell.dataset.load(cell.draws[0]))
    except JerkbenchError:
        raise
    except Exception:  # noqa: BLE001 - a plugin that breaks becomes a row that says so, when it is run
        return
