"""What a combination asks for, and its recording has not: said before anything runs."""

from jerkbench.benchmark.cell import Cell
from jerkbench.errors import JerkbenchError


def require_inputs(cell: Cell) -> None:
    """Ask the attitude filter whether the recording of the first seed has what it needs; it is loaded only if asked.

    Raises:
        JerkbenchError: it has not, or there is no recording.
    """
    require = getattr(cell.attitude, "require", None)
    if require is None:
        return
    try:
        require(lambda: cell.dataset.load(cell.draws[0]))
    except JerkbenchError:
        raise
    except Exception:  # noqa: BLE001 - a plugin that breaks becomes a row that says so, when it is run
        return
