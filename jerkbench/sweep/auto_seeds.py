"""Seeds added in blocks until every two methods of a scenario are decided, or the most seeds are spent."""

import dataclasses
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

from jerkbench.errors import PluginError
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.evaluation.statistics.sequential import FIRST, levels, looks
from jerkbench.report.analysis.rule import Rule
from jerkbench.report.analysis.study_verdicts import study_verdicts
from jerkbench.report.tables.summary import main_metric
from jerkbench.results.manifest import stretches
from jerkbench.results.store import Store
from jerkbench.results.study import Study
from jerkbench.sweep.seed_blocks import missing
from jerkbench.sweep.sweep import Plan
from jerkbench.sweep.tasks import Planned, in_order

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
    if most <= first or not any(planned.cell.seeded for planned in plan.cells):
        return [Look(plan, 0.05, last=True)]
    sizes = looks(most, first)
    spent = zip(sizes, levels(sizes), strict=True)
    return [Look(_with_seeds(plan, size), float(level), size == most) for size, level in spent]


def run_looks(
    planned: Sequence[Look], store: Store, run: Callable[[Plan], int], load: Callable[[Look], Study]
) -> tuple[Look, int]:
    """Run the looks one after the other until all is decided; returns the last that was run, and its exit code.

    The runs of a look are in the next one; what is stored of a later look is gone on from.
    """
    known = store.known(planned[-1].plan.draws)
    begin = max((k for k, look in enumerate(planned) if _done(look, known)), default=0)
    for look in planned[begin:]:
        if code := run(look.plan):
            return look, code
        if look.last or not undecided(load(look), look.level):
            return look, 0
    raise AssertionError("The last look is the last.")


def undecided(study: Study, level: float) -> int:
    """Return how many pairs of methods are undecided in the study's leading metric."""
    verdicts = study_verdicts(study.rows, main_metric(study.rows), rule=Rule(level=level))
    return sum(
        pair.verdict is Verdict.UNDECIDED for standing in verdicts.standings for pair in standing.contest.comparisons
    )


def _with_seeds(plan: Plan, seeds: int) -> Plan:
    return dataclasses.replace(plan, cells=tuple(_planned(planned, seeds) for planned in plan.cells))


def _planned(planned: Planned, seeds: int) -> Planned:
    if not planned.cell.seeded:
        return planned
    draws = {seed for first, _ in stretches(planned.draws) for seed in range(first, first + seeds)}
    return dataclasses.replace(planned, draws=in_order(draws))


def _done(look: Look, known: Mapping[str, Collection[int]]) -> bool:
    return not any(missing(planned, known.get(planned.key, ())) for planned in look.plan.cells)
