"""Plugins from elsewhere that do not keep their contract: found before they run."""

from collections.abc import Iterable, Iterator
from typing import Any

from jerkbench.cells.cell import Cell
from jerkbench.plugins import is_own

SINGLE = ("dataset", "attitude", "filter", "adaptation", "engine")


def unfit(cell: Cell) -> str:
    """Return what is the matter with the first plugin of ``cell`` that does not keep its contract, or nothing."""
    return next((sentence for _, sentence in _complaints(cell)), "")


def first_complaints(cells: Iterable[Cell]) -> list[str]:
    """Return a sentence for each plugin of ``cells`` whose runs will fail, because it does not keep its contract."""
    complaints = dict(complaint for cell in cells for complaint in _complaints(cell))
    return [f"Every run with the {title} will fail: {sentence}" for title, sentence in complaints.items()]


def _complaints(cell: Cell) -> Iterator[tuple[str, str]]:
    """Kind and name of each plugin from elsewhere that does not keep its contract, and what is the matter."""
    foreign = [(title, kind, plugin) for title, kind, plugin in _parts(cell) if not is_own(type(plugin))]
    if not foreign:
        return
    from jerkbench.conformance.probe import complaint

    for title, kind, plugin in foreign:
        if sentence := complaint(kind, plugin):
            yield title, sentence


def _parts(cell: Cell) -> Iterator[tuple[str, str, Any]]:
    """What tables call each plugin, its kind, and itself."""
    yield from ((f"{kind} {cell.spec[kind]['name']}", kind, getattr(cell, kind)) for kind in SINGLE)
    for spec, disturbance in zip(cell.spec["disturbance"], cell.disturbances, strict=True):
        yield f"disturbance {spec['name']}", "disturbance", disturbance
    for name, metric in zip(cell.spec["metrics"], cell.metrics, strict=True):
        yield f"metric {name}", "metric", metric
