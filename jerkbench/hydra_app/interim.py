"""Interim analyses, after which seeds are added while a comparison is undecided, and the forecast of a sweep."""

import dataclasses
import re
from collections.abc import Iterator
from itertools import compress

from jerkbench.errors import PluginError
from jerkbench.evaluation.judgement import Verdict
from jerkbench.evaluation.planning import FIRST, interim_levels, interim_sizes
from jerkbench.jobs.job import Job
from jerkbench.jobs.manifest import stretches
from jerkbench.jobs.plan import Plan, in_order, missing
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import Study
from jerkbench.report.comparisons import VerdictRule
from jerkbench.report.labels import Labels
from jerkbench.report.study_verdicts import study_verdicts
from jerkbench.report.summary import main_metric

AUTO = re.compile(r"seeds=auto(?:\(max=(\d+)\))?")
MAX_AUTO_SEEDS = 400
"""Default maximum number of seeds for ``seeds=auto``."""


def typed(override: str) -> list[str]:
    """Replace ``seeds=auto(max=400)`` by the options ``seeds`` and ``max_seeds``. Return other overrides unchanged.

    Raises:
        PluginError: The maximum is less than the number of seeds in the first interim analysis.
    """
    match = AUTO.fullmatch(override.replace(" ", "").replace("'", "").replace('"', ""))
    if match is None:
        return [override]
    maximum = int(match[1] or MAX_AUTO_SEEDS)
    if maximum < FIRST:
        raise PluginError(f"{override}: the first interim analysis has {FIRST} seeds; give max={FIRST} or more.")
    return [f"seeds={FIRST}", f"max_seeds={maximum}"]


def remaining_analyses(plan: Plan, first: int, maximum: int, store: Store) -> list[tuple[Plan, float]]:
    """Return the interim analyses from the last analysis whose runs are all stored, or else from the first analysis.

    An analysis consists of a plan, which includes the runs of all earlier analyses, and of a significance level. The
    significance levels divide the error probability of 5 % of the study between the analyses.
    """
    sizes, plans = [first], [plan]
    if maximum > first and any(job.scenario.seeded for job in plan.jobs):
        sizes = interim_sizes(maximum, first)
        plans = [Plan(tuple(_with_seeds(job, size) for job in plan.jobs), plan.refused) for size in sizes]
    known = store.known(plans[-1].draws)
    done = [not any(missing(job, known.get(job.key, ())) for job in part.jobs) for part in plans]
    start = max((k for k, complete in enumerate(done) if complete), default=0)
    return list(zip(plans, map(float, interim_levels(sizes)), strict=True))[start:]


def undecided(study: Study, level: float) -> int:
    """Return the number of pairs of methods whose comparison by the main metric of the study is undecided."""
    verdicts = study_verdicts(study.rows, main_metric(study.rows), rule=VerdictRule(level=level))
    return sum(pair.verdict is Verdict.UNDECIDED for standing in verdicts.standings for pair in standing.comparisons)


def _with_seeds(job: Job, seeds: int) -> Job:
    if not job.scenario.seeded:
        return job
    draws = {seed for first, _ in stretches(job.draws) for seed in range(first, first + seeds)}
    return dataclasses.replace(job, draws=in_order(draws))


# The forecast of a sweep is printed by `--dry`.


def forecast(plan: Plan, store: Store) -> Iterator[str]:
    """Yield lines with the state of each combination, and the combinations that are left out."""
    known = store.known(plan.draws)
    left = {job.key: len(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    differing = [len(set(values)) > 1 for values in zip(*(job.labels for job in plan.jobs), strict=True)]
    shown = differing if any(differing) else [True] * len(differing)  # a single combination is shown with all labels
    named = map(" ".join, zip(Labels._fields, plan.jobs[0].labels, strict=True))
    if same := list(compress(named, (not differs for differs in shown))):
        yield f"In all combinations: {', '.join(same)}."
    yield f"{', '.join(compress(Labels._fields, shown))}:"
    for job in plan.jobs:
        state = _count(left[job.key], "run") if left[job.key] else "complete"
        yield f"  {', '.join(compress(job.labels, shown))}: {state}"
    yield from plan.refused
    runs, done = sum(left.values()), list(left.values()).count(0)
    yield f"{_count(len(plan.jobs), 'combination')}, {done} complete; {_count(runs, 'run')} to compute."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"
