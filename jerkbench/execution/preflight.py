"""What a combination asks for, and its recording has not: said before anything runs."""

from collections.abc import Callable

from jerkbench.cells.cell import Cell
from jerkbench.errors import JerkbenchError
from jerkbench.recording import Recording


def require_inputs(cell: Cell, checked: set[tuple[object, object]]) -> None:
    """Ask attitude filter and filter whether the recording of the first seed has what they need.

    Args:
        cell: the combination; its recording is loaded only if one of them has such a question.
        checked: data sets with the parts that were asked before; grows.

    Raises:
        JerkbenchError: it has not, or there is no recording.
    """
    for part in (cell.attitude, cell.filter):
        require = getattr(part, "require", None)
        if require is not None and (cell.dataset, part) not in checked:
            _ask(require, cell)
            checked.add((cell.dataset, part))


def _ask(require: Callable[[Callable[[], Recording]], None], cell: Cell) -> None:
    try:
        require(lambda: cell.dataset.load(cell.draws[0]))
    except JerkbenchError:
        raise
    except Exception:  # noqa: BLE001 - a plugin that breaks becomes a row that says so, when it is run
        return
