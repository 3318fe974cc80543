"""The errors of a plugin, as a sentence."""

import os
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from jerkbench.cells.cell import Cell
from jerkbench.errors import NO_ROOM, JerkbenchError, PluginError

TRACEBACK = "JERKBENCH_TRACEBACK"
"""Environment variable: what a plugin raises in a single run is raised as it is, for its author."""


def reason_of(error: Exception) -> str:
    """Return the exception, and where it was raised."""
    at = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({at.name}, line {at.lineno})"


@contextmanager
def plugins_in_words(cell: Cell) -> Iterator[None]:
    """Turn what a plugin of ``cell`` raises into a sentence; what is one already, and a full disk, stay what they are.

    Raises:
        PluginError: a plugin raised something; not if the environment variable `TRACEBACK` is set.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except Exception as error:
        if os.environ.get(TRACEBACK) or (isinstance(error, OSError) and error.errno in NO_ROOM):
            raise
        culprit, why = _culprit(cell, error), reason_of(error)
        raise PluginError(f"{culprit} failed: {why}. Set {TRACEBACK}=1 to see the whole traceback.") from error


def _culprit(cell: Cell, error: Exception) -> str:
    """The plugin in whose method it was raised; where in none, as of a wrong result, those that may have caused it."""
    named = _named(cell)
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        own = frame.f_locals.get("self")
        names = [name for name, plugin in named.items() if plugin is own]
        if names:
            return f"The {names[0]}"
    return f"The filter {cell.spec['filter']['name']} with the adaptation {cell.spec['adaptation']['name']}"


def _named(cell: Cell) -> dict[str, object]:
    """The plugins of a cell by kind and name; the engine is not among them, it runs the others."""
    named: dict[str, object] = {
        f"{kind} {cell.spec[kind]['name']}": getattr(cell, kind)
        for kind in ("dataset", "attitude", "filter", "adaptation")
    }
    for spec, disturbance in zip(cell.spec["disturbance"], cell.disturbances, strict=True):
        named[f"disturbance {spec['name']}"] = disturbance
    return named | {f"metric {spec}": metric for spec, metric in zip(cell.spec["metrics"], cell.metrics, strict=True)}
