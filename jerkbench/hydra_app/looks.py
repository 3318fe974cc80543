"""Seeds added in blocks until every two methods of a scenario are decided; and how long a sweep will take."""

import dataclasses
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import compress
from typing import Any

import numpy as np

from jerkbench.errors import PluginError
from jerkbench.evaluation.judgement import Verdict
from jerkbench.evaluation.planning import FIRST, interim_levels, interim_sizes
from jerkbench.jobs.job import Job
from jerkbench.jobs.manifest import stretches
from jerkbench.jobs.plan import Plan, in_order, missing
from jerkbench.jobs.progress import duration
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import Study
from jerkbench.report.comparisons import VerdictRule
from jerkbench.report.labels import Labels
from jerkbench.report.study_verdicts import study_verdicts
from jerkbench.report.summary import main_metric

AUTO = re.compile(r"seeds=auto(?:\(max=(\d+)\))?")
MAX_AUTO_SEEDS = 400
"""Seeds where ``seeds=auto`` says no more."""


def typed(word: str) -> list[str]:
    """Return ``seeds=auto(max=400)`` as the two options that it stands for; another word as it is.

    Raises:
        PluginError: the most seeds are fewer than those of the first look.
    """
    match = AUTO.fullmatch(word.replace(" ", "").replace("'", "").replace('"', ""))
    if match is None:
        return [word]
    most = int(match[1] or MAX_AUTO_SEEDS)
    if most < FIRST:
        raise PluginError(f"{word}: the first look at the results is after {FIRST} seeds; give max={FIRST} or more.")
    return [f"seeds={FIRST}", f"max_seeds={most}"]


def looks_left(plan: Plan, first: int, most: int, store: Store) -> list[tuple[Plan, float]]:
    """Return the last look whose runs are all stored, and those after it; the runs of a look are in the next one.

    A look is a plan and the part of the study's 5 % that its verdicts may spend.
    """
    sizes, plans = [first], [plan]
    if most > first and any(job.scenario.seeded for job in plan.jobs):
        sizes = interim_sizes(most, first)
        plans = [Plan(tuple(_with_seeds(job, size) for job in plan.jobs), plan.refused) for size in sizes]
    known = store.known(plans[-1].draws)
    done = [not any(missing(job, known.get(job.key, ())) for job in own.jobs) for own in plans]
    start = max((k for k, whole in enumerate(done) if whole), default=0)
    return list(zip(plans, map(float, interim_levels(sizes)), strict=True))[start:]


def undecided(study: Study, level: float) -> int:
    """Return how many pairs of methods are undecided in the study's leading metric."""
    verdicts = study_verdicts(study.rows, main_metric(study.rows), rule=VerdictRule(level=level))
    return sum(pair.verdict is Verdict.UNDECIDED for standing in verdicts.standings for pair in standing.comparisons)


def _with_seeds(job: Job, seeds: int) -> Job:
    if not job.scenario.seeded:
        return job
    draws = {seed for first, _ in stretches(job.draws) for seed in range(first, first + seeds)}
    return dataclasses.replace(job, draws=in_order(draws))


# The forecast of a sweep: what would run, what is there already, and about how long it takes.


def forecast(plan: Plan, store: Store, workers: int) -> Iterator[str]:
    """Yield what to print of a plan: each cell, what is left out and why, and how long the rest takes about.

    The time is taken from the cells that are stored in the study's folder and in those beside it.
    """
    known = store.known(plan.draws)
    left = {job.key: len(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    differing = [len(set(values)) > 1 for values in zip(*(job.labels for job in plan.jobs), strict=True)]
    shown = differing if any(differing) else [True] * len(differing)  # of a single cell all
    named = map(" ".join, zip(Labels._fields, plan.jobs[0].labels, strict=True))
    if same := list(compress(named, (not own for own in shown))):
        yield f"In every cell: {', '.join(same)}."
    yield f"{', '.join(compress(Labels._fields, shown))}:"
    for job in plan.jobs:
        state = _count(left[job.key], "run") if left[job.key] else "is done"
        yield f"  {', '.join(compress(job.labels, shown))}: {state}"
    yield from plan.refused
    runs, done = sum(left.values()), list(left.values()).count(0)
    yield f"{_count(len(plan.jobs), 'combination')}, {done} done; {_count(runs, 'run')} to do."
    if runs:
        yield _time(plan, left, store, workers)


def _time(plan: Plan, left: Mapping[str, int], store: Store, workers: int) -> str:
    beside = store.folder.parents[1].glob("*/cells")
    stored = [cell for cells in sorted(beside) if cells.is_dir() for cell in Store(cells.parent).read()[0]]
    times_s = defaultdict(list)
    for cell in stored:
        for names in _names(cell.metadata["spec"]):
            times_s[names].append(cell.metadata["seconds"] / max(len(cell.table), 1))
    usual_s = {names: float(np.median(times)) for names, times in times_s.items()}
    run_s = {  # as the cells took that are most like it
        job.key: next((usual_s[names] for names in _names(job.spec) if names in usual_s), np.nan)
        for job in plan.jobs
        if left[job.key]
    }
    seconds = sum(run_s[key] * left[key] for key in run_s)
    if not np.isfinite(seconds):
        return "How long it takes is not known: no cell of the same data set is stored here yet."
    time, measured = duration(max(seconds / workers, 1.0)), _count(len(stored), "stored cell")
    return f"About {time} with {_count(workers, 'worker')}, as {measured} took; compiling is not counted."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


ALIKE = ("dataset", "filter", "adaptation")
"""What decides on the time of a run, the most important first."""


def _names(spec: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """The names of all of `ALIKE`, of all but the last, and so on."""
    names = tuple(spec[kind]["name"] for kind in ALIKE)
    return [names[:count] for count in range(len(names), 0, -1)]
