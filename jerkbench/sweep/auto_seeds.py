"""Seeds added in blocks until every two methods of a scenario are decided, or the most seeds are spent."""

import dataclasses
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from jerkbench.cells.key import cell_key
from jerkbench.errors import PluginError
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.evaluation.statistics.sequential import FIRST, levels, looks
from jerkbench.report.analysis.rule import Rule
from jerkbench.report.analysis.study_verdicts import study_verdicts
from jerkbench.report.tables.summary import main_metric
from jerkbench.results.content import Stored
from jerkbench.results.parts import Block
from jerkbench.results.store import Store
from jerkbench.results.study import Study
from jerkbench.sweep.seed_blocks import block_of
from jerkbench.sweep.sweep import Plan
from jerkbench.sweep.tasks import Planned, Result

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

    What is stored of a later look is gone on from; the cells of a look before the last are deleted when the next is
    whole: their runs are all in it.
    """
    begin = max((k for k, look in enumerate(planned) if _done(look, store)), default=0)
    before: Look | None = None
    for look in planned[begin:]:
        if before is not None:
            _carry(before, look, store)
        if code := run(look.plan):
            return look, code
        if before is not None:
            _forget(before, look, store)
        if look.last or not undecided(load(look), look.level):
            return look, 0
        before = look
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
    cell = dataclasses.replace(planned.cell, protocol=dataclasses.replace(planned.cell.protocol, seeds=seeds))
    return Planned(cell, cell_key(cell, planned.fingerprint), planned.fingerprint)


def _done(look: Look, store: Store) -> bool:
    keys = [planned.key for planned in look.plan.cells]
    return len(store.look(keys).done) == len(keys)


def _carry(before: Look, look: Look, store: Store) -> None:
    """Store the runs of the look before as finished seeds of the same cells with more."""
    larger = {old.key: new for old, new in _grown(before, look)}
    done = store.look([new.key for new in larger.values()]).done
    cells, _ = store.read([old for old, new in larger.items() if new.key not in done])
    blocks = [_carried(cell, larger[cell.key]) for cell in cells]
    if blocks:
        store.write_blocks(blocks)


def _carried(cell: Stored, planned: Planned) -> Block:
    rows = [{str(name): value for name, value in row.items()} for row in cell.rows.to_dict("records")]
    known = cell.metadata
    kind = known.get("processor", "")
    return block_of(planned, Result(rows, known["notes"], known["seconds"], processor=kind))


def _forget(before: Look, look: Look, store: Store) -> None:
    """Delete the cells of the look before that are whole in this one."""
    larger = {old.key: new.key for old, new in _grown(before, look)}
    done = store.look(larger.values()).done
    store.drop([old for old, new in larger.items() if new in done])


def _grown(before: Look, look: Look) -> list[tuple[Planned, Planned]]:
    """The cells of which this look has more seeds: a deterministic one has not."""
    pairs = zip(before.plan.cells, look.plan.cells, strict=True)
    return [(old, new) for old, new in pairs if old.key != new.key]
