"""Seeds added in blocks until every two methods of a scenario are decided; and how long a sweep will take."""

import dataclasses
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jerkbench.errors import PluginError
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.evaluation.statistics.seeds import FIRST, levels, looks
from jerkbench.jobs.job import Job
from jerkbench.jobs.labels import Labels
from jerkbench.jobs.plan import Plan, in_order, missing
from jerkbench.jobs.progress import duration
from jerkbench.report.analysis.runs import VerdictRule
from jerkbench.report.analysis.study_verdicts import study_verdicts
from jerkbench.report.tables.summary import main_metric
from jerkbench.results.content import Stored
from jerkbench.results.manifest import stretches
from jerkbench.results.store import Store
from jerkbench.results.study import Study

AUTO = re.compile(r"seeds=auto(?:\(max=(\d+)\))?")
MOST = 400
"""Seeds where ``seeds=auto`` says no more."""


class Look(NamedTuple):
    """What is run before the results are looked at.

    Attributes:
        plan: with the seeds of this look.
        level: what this look may spend of the study's 5 %.
        last: whether no other follows.
    """

    plan: Plan
    level: float
    last: bool


def typed(word: str) -> list[str]:
    """Return ``seeds=auto(max=400)`` as the two options that it stands for; another word as it is.

    Raises:
        PluginError: the most seeds are fewer than those of the first look.
    """
    match = AUTO.fullmatch(word.replace(" ", "").replace("'", "").replace('"', ""))
    if match is None:
        return [word]
    most = int(match[1] or MOST)
    if most < FIRST:
        raise PluginError(f"{word}: the first look at the results is after {FIRST} seeds; give max={FIRST} or more.")
    return [f"seeds={FIRST}", f"max_seeds={most}"]


def planned_looks(plan: Plan, first: int, most: int) -> list[Look]:
    """Return every look, from ``first`` seeds to ``most``; where nothing is random, one."""
    if most <= first or not any(job.scenario.seeded for job in plan.jobs):
        return [Look(plan, 0.05, last=True)]
    sizes = looks(most, first)
    spent = zip(sizes, levels(sizes), strict=True)
    return [Look(_with_seeds(plan, size), float(level), size == most) for size, level in spent]


def looks_left(planned: Sequence[Look], store: Store) -> Sequence[Look]:
    """Return the last look whose runs are all stored, and those after it; the runs of a look are in the next one."""
    known = store.known(planned[-1].plan.draws)
    return planned[max((k for k, look in enumerate(planned) if _done(look, known)), default=0) :]


def undecided(study: Study, level: float) -> int:
    """Return how many pairs of methods are undecided in the study's leading metric."""
    verdicts = study_verdicts(study.rows, main_metric(study.rows), rule=VerdictRule(level=level))
    return sum(pair.verdict is Verdict.UNDECIDED for standing in verdicts.standings for pair in standing.comparisons)


def _with_seeds(plan: Plan, seeds: int) -> Plan:
    return dataclasses.replace(plan, jobs=tuple(_job_with_seeds(job, seeds) for job in plan.jobs))


def _job_with_seeds(job: Job, seeds: int) -> Job:
    if not job.scenario.seeded:
        return job
    draws = {seed for first, _ in stretches(job.draws) for seed in range(first, first + seeds)}
    return dataclasses.replace(job, draws=in_order(draws))


def _done(look: Look, known: Mapping[str, Collection[int]]) -> bool:
    return not any(missing(job, known.get(job.key, ())) for job in look.plan.jobs)


# The forecast of a sweep: what would run, what is there already, and about how long it takes.


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
    counts = {job.key: len(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    stored = [cell for folder in _studies(store.folder.parent) for cell in Store(folder).read()[0]]
    seconds = float(sum(_run_s(job, stored) * counts[job.key] for job in plan.jobs if counts[job.key]))
    return Forecast(plan, counts, seconds, len(stored))


def lines(forecast: Forecast, workers: int) -> Iterator[str]:
    """Yield what to print: each cell, what is left out and why, and the sum."""
    yield from _constants(forecast.plan)
    varying = _varying(forecast.plan)
    yield f"{', '.join(varying)}:"
    for job in forecast.plan.jobs:
        left = forecast.missing[job.key]
        state = _count(left, "run") if left else "is done"
        yield f"  {', '.join(getattr(job.labels, factor) for factor in varying)}: {state}"
    yield from forecast.plan.refused
    runs, done = sum(forecast.missing.values()), list(forecast.missing.values()).count(0)
    yield f"{_count(len(forecast.plan.jobs), 'combination')}, {done} done; {_count(runs, 'run')} to do."
    if runs:
        yield _time(forecast, workers)


def _varying(plan: Plan) -> list[str]:
    """Return the factors that tell the cells apart; of a single cell all."""
    labels = [job.labels for job in plan.jobs]
    varying = [factor for factor in Labels._fields if len({getattr(of, factor) for of in labels}) > 1]
    return varying or list(Labels._fields)


def _constants(plan: Plan) -> Iterator[str]:
    """What is the same in every cell, where anything differs."""
    same = [factor for factor in Labels._fields if factor not in _varying(plan)]
    if same:
        labels = plan.jobs[0].labels
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


def _run_s(job: Job, known: Sequence[Stored]) -> float:
    """The time of a run of a cell [s]: the median over what is most like it; NaN where nothing is."""
    names = [job.spec[kind]["name"] for kind in ("dataset", "filter", "adaptation")]
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
