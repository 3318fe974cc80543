"""The forecast of a sweep: what would run, what is there already, and about how long it takes."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jerkbench.cells.labels import Labels
from jerkbench.execution.pulse import duration
from jerkbench.results.content import Stored
from jerkbench.results.store import Store
from jerkbench.sweep.seed_blocks import missing
from jerkbench.sweep.sweep import Plan
from jerkbench.sweep.tasks import Planned


class Forecast(NamedTuple):
    """The forecast of a sweep.

    Attributes:
        plan: what would be there at its end.
        missing: how many runs of each cell are not there yet, by its key.
        seconds: about how long the rest takes in one process [s]; NaN where nothing like it has been run.
        measured: number of stored cells that ``seconds`` is taken from.
    """

    plan: Plan
    missing: Mapping[str, int]
    seconds: float
    measured: int


def forecast(plan: Plan, store: Store) -> Forecast:
    """Return the forecast of a plan, from the times of the cells in its study's folder and in those beside it."""
    known = store.known(plan.draws)
    counts = {planned.key: len(missing(planned, known.get(planned.key, ()))) for planned in plan.cells}
    stored = [cell for folder in _studies(store.folder.parent) for cell in Store(folder).read()[0]]
    seconds = float(sum(_run_s(planned, stored) * counts[planned.key] for planned in plan.cells if counts[planned.key]))
    return Forecast(plan, counts, seconds, len(stored))


def lines(forecast: Forecast, workers: int) -> Iterator[str]:
    """Yield what to print: each cell, what is left out and why, and the sum."""
    yield from _constants(forecast.plan)
    varying = _varying(forecast.plan)
    yield f"{', '.join(varying)}:"
    for planned in forecast.plan.cells:
        left = forecast.missing[planned.key]
        state = _count(left, "run") if left else "is done"
        yield f"  {', '.join(getattr(planned.cell.labels, factor) for factor in varying)}: {state}"
    yield from forecast.plan.refused
    runs, done = sum(forecast.missing.values()), list(forecast.missing.values()).count(0)
    yield f"{_count(len(forecast.plan.cells), 'combination')}, {done} done; {_count(runs, 'run')} to do."
    if runs:
        yield _time(forecast, workers)


def _varying(plan: Plan) -> list[str]:
    """Return the factors that tell the cells apart; of a single cell all."""
    labels = [planned.cell.labels for planned in plan.cells]
    varying = [factor for factor in Labels._fields if len({getattr(of, factor) for of in labels}) > 1]
    return varying or list(Labels._fields)


def _constants(plan: Plan) -> Iterator[str]:
    """What is the same in every cell, where anything differs."""
    same = [factor for factor in Labels._fields if factor not in _varying(plan)]
    if same:
        labels = plan.cells[0].cell.labels
        yield f"In every cell: {', '.join(f'{factor} {getattr(labels, factor)}' for factor in same)}."


def _time(forecast: Forecast, workers: int) -> str:
    if not np.isfinite(forecast.seconds):
        return "How long it takes is not known: no cell of the same data set is stored here yet."
    time = duration(max(forecast.seconds / workers, 1.0))
    measured = _count(forecast.measured, "stored cell")
    return f"About {time} with {_count(workers, 'worker')}, as {measured} took; compiling is not counted."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


def _studies(folder: Path) -> Sequence[Path]:
    """The study's folder, and those beside it."""
    return sorted(path.parent for path in folder.parent.glob("*/cells") if path.is_dir())


def _run_s(planned: Planned, known: Sequence[Stored]) -> float:
    """The time of a run of a cell [s]: the median over what is most like it; NaN where nothing is."""
    names = [planned.cell.spec[kind]["name"] for kind in ("dataset", "filter", "adaptation")]
    for alike in (3, 2, 1):
        times = [
            cell.metadata["seconds"] / max(len(cell.rows), 1)
            for cell in known
            if [cell.metadata["spec"][kind]["name"] for kind in ("dataset", "filter", "adaptation")][:alike]
            == names[:alike]
        ]
        if times:
            return float(np.median(times))
    return float("nan")
