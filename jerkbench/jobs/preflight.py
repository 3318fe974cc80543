"""What is looked at before anything runs: inputs that filters ask for, plugins' contracts; and errors in words."""

import os
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from jerkbench.contracts import Dataset, Requiring
from jerkbench.errors import NO_ROOM, JerkbenchError, PluginError
from jerkbench.inspection.doctor import first_diagnoses
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.inputs import Inputs
from jerkbench.plugins import is_own


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
    from jerkbench.conformance.plugin import complaint

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


# Mistakes in recorded drives, told before they run.


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
