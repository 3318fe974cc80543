"""`jerkbench compare`: two sets of results, combination by combination; its exit code tells a machine."""

import argparse
from pathlib import Path

from jerkbench.verbs.kinds import Verbs

WORSE = 1
"""Exit code where the second set is worse."""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    compare = verbs.add_parser("compare", help="compare two sets of results, over the same seeds where they match")
    compare.add_argument("first", type=Path, metavar="A", help="a study's folder, or a folder of cells: before")
    compare.add_argument("second", type=Path, metavar="B", help="another: after")
    compare.add_argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)")
    compare.add_argument(
        "--fail-above", type=float, metavar="PCT", help="exit with 1 where B is worse than A by more than PCT percent"
    )
    compare.set_defaults(answer=answer)


def answer(chosen: argparse.Namespace) -> None:
    """Print what changed.

    Raises:
        JerkbenchError: there are no results, or nothing is in both.
        SystemExit: 1, where B is worse by more than ``--fail-above``.
    """
    from jerkbench.benchmark.study import load_study
    from jerkbench.report.changes import change_rows, changes
    from jerkbench.report.findings import varying_factors
    from jerkbench.report.quantities import quantity
    from jerkbench.report.summary import main_metric
    from jerkbench.report.terminal import print_grid

    first, second = load_study(chosen.first), load_study(chosen.second)
    metric = chosen.metric or main_metric(first.rows)
    found = changes(first.rows, second.rows, metric)
    varying = varying_factors(first.rows)
    header = [*varying, "A", "B", "B/A", "95 %", ""]
    notes = [f"A: {chosen.first}, {first.code}", f"B: {chosen.second}, {second.code}"]
    notes += _left_out(len(found), first.combinations, second.combinations)
    print_grid(quantity(metric).heading, header, change_rows(found, varying), notes)
    if chosen.fail_above is None:
        return
    worse = [one for one in found if one.worse(chosen.fail_above)]
    print(f"{len(worse)} of {len(found)} combinations are worse by more than {chosen.fail_above:g} %.")
    if worse:
        raise SystemExit(WORSE)


def _left_out(compared: int, first: int, second: int) -> list[str]:
    counts = (("A", first - compared), ("B", second - compared))
    return [f"{count} combinations of {name} alone are left out." for name, count in counts if count]
