"""`jerkbench compare`: two sets of results, combination by combination; its exit code tells a machine."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.verbs.kinds import Verbs, percentage

if TYPE_CHECKING:
    from jerkbench.report.analysis.changes import Change
    from jerkbench.results.study import Study

WORSE = 1
"""Exit code where the second set is worse, or cannot be judged."""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    compare = verbs.add_parser("compare", help="compare two sets of results, over the same seeds where they match")
    compare.add_argument("first", type=Path, metavar="A", help="a study's folder, or a folder of cells: before")
    compare.add_argument("second", type=Path, metavar="B", help="another: after")
    compare.add_argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)")
    compare.add_argument(
        "--fail-above",
        type=percentage,
        metavar="PCT",
        help="exit with 1 where B is worse than A by more than PCT percent, or lacks what A has",
    )
    compare.set_defaults(answer=answer)


def answer(chosen: argparse.Namespace) -> None:
    """Print what changed.

    Raises:
        JerkbenchError: there are no results, nothing is in both, or they were not measured alike.
        SystemExit: 1, where B is worse by more than ``--fail-above``, or lacks results that A has.
    """
    from jerkbench.report.analysis.changes import change_rows, changes
    from jerkbench.report.analysis.findings import varying_factors
    from jerkbench.report.analysis.quantities import quantity
    from jerkbench.report.tables.summary import main_metric
    from jerkbench.report.tables.terminal import print_grid
    from jerkbench.results.comparability import other_methods, require_alike
    from jerkbench.results.study import load_study

    first, second = load_study(chosen.first), load_study(chosen.second)
    metric = chosen.metric or main_metric(first.rows)
    require_alike(first, second)
    changed = changes(first.rows, second.rows, metric)
    varying = varying_factors(first.rows)
    header = [*varying, "A", "B", "B/A", "95 %", ""]
    notes = [f"A: {chosen.first}, {first.code}", f"B: {chosen.second}, {second.code}", *other_methods(first, second)]
    notes += [f"{name}: {words}" for name, study in (("A", first), ("B", second)) for words in study.unlike]
    notes += [READING, *_left_out(changed, first, second)]
    print_grid(quantity(metric).heading, header, change_rows(changed, varying), notes)
    if chosen.fail_above is not None and _fails(changed, first, second, chosen.fail_above):
        raise SystemExit(WORSE)


READING = (
    "A, B: geometric means over the runs that went well (arithmetic where a value is 0); B/A: over the runs that went "
    "well in both, where seeds match."
)
"""The explanation below the numbers."""


def _fails(changed: "Sequence[Change]", first: "Study", second: "Study", percent: float) -> bool:
    """Say what is worse and what cannot be judged; returns whether anything is."""
    worse = sum(change.worse(percent) for change in changed)
    print(f"{worse} of {len(changed)} combinations are worse by more than {percent:g} %.")
    lacking = first.combinations - len(changed) + sum(change.unjudged for change in changed)
    if lacking:
        print(
            f"{lacking} of the {first.combinations} combinations of A cannot be judged: B lacks them, or runs of them."
        )
    damaged = len(first.damaged) + len(second.damaged)
    if damaged:
        print(f"{damaged} damaged file{'s' * (damaged > 1)} cannot be judged.")
    return bool(worse or lacking or damaged)


def _left_out(changed: "Sequence[Change]", first: "Study", second: "Study") -> list[str]:
    """Return sentences about the results that the comparison leaves out."""
    counts = (("A", first.combinations - len(changed)), ("B", second.combinations - len(changed)))
    notes = [f"{count} combinations of {name} alone are left out." for name, count in counts if count]
    for name, study in (("A", first), ("B", second)):
        if study.damaged:
            notes.append(f"Damaged in {name}, and left out: {', '.join(study.damaged)}.")
    absent = sum(change.absent for change in changed)
    return [*notes, f"{absent} runs of A have no run of the same seed in B."] if absent else notes
