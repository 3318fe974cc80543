"""Plugins from elsewhere that do not keep their contract: found before they run."""

from typing import Any

from jerkbench.cells.cell import Cell
from jerkbench.plugins import is_own

SINGLE = ("dataset", "attitude", "filter", "adaptation", "engine")


def unfit(cell: Cell) -> str:
    """Return what is the matter with the first plugin of ``cell`` that does not keep its contract, or nothing."""
    parts: list[tuple[str, Any]] = [(kind, getattr(cell, kind)) for kind in SINGLE]
    parts += [("disturbance", disturbance) for disturbance in cell.disturbances]
    parts += [("metric", metric) for metric in cell.metrics]
    foreign = [(kind, plugin) for kind, plugin in parts if not is_own(type(plugin))]
    if not foreign:
        return ""
    from jerkbench.conformance.probe import complaint

    return next((sentence for kind, plugin in foreign if (sentence := complaint(kind, plugin))), "")
