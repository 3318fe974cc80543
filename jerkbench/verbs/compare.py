"""`jerkbench compare`: two sets of results, combination by combination; its exit code tells a machine."""

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from jerkbench.places import place
from jerkbench.verbs.arguments import Verbs, add_verb, percentage
from jerkbench.verbs.judging import add_judging, chosen_method, chosen_rule

if TYPE_CHECKING:
    from jerkbench.report.analysis.changes import Change
    from jerkbench.results.study import Study

FORMATS = ("terminal", "md", "json", "junit")

WORSE = 1
"""Exit code where the second set is worse, or cannot be judged."""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    compare = add_verb(verbs, "compare", "compare two sets of results, over the same seeds where they match", answer)
    compare.add_argument("first", type=place, metavar="A", help="a study's folder, or a folder of cells: before")
    compare.add_argument("second", type=place, metavar="B", help="another: after")
    compare.add_argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)")
    compare.add_argument(
        "--fail-above",
        type=percentage,
        metavar="PCT",
        help="exit with 1 where B is worse than A by more than PCT percent, or lacks what A has",
    )
    compare.add_argument("--format", choices=FORMATS, default="terminal", help="default: terminal")
    add_judging(compare)


def answer(chosen: argparse.Namespace) -> None:
    """Print what changed.

    Raises:
        JerkbenchError: there are no results, nothing is in both, or they were not measured alike.
        SystemExit: 1, where B is worse by more than ``--fail-above``, or lacks results that A has.
    """
    from jerkbench.report.analysis.change_notes import notes_of_tests, other_leaders
    from jerkbench.report.analysis.changes import changes
    from jerkbench.report.analysis.findings import varying_factors
    from jerkbench.report.analysis.study_verdicts import study_verdicts
    from jerkbench.report.compared import WRITERS, Compared, print_compared
    from jerkbench.report.tables.summary import main_metric
    from jerkbench.results.comparability import other_methods, require_alike
    from jerkbench.results.study import load_study

    first, second = load_study(chosen.first), load_study(chosen.second)
    metric = chosen.metric or main_metric(first.rows)
    require_alike(first, second)
    rule, method = chosen_rule(chosen), chosen_method(chosen)
    changed = changes(first.rows, second.rows, metric, rule)
    varying = varying_factors(first.rows)
    notes = [f"A: {chosen.first}, {first.code}", f"B: {chosen.second}, {second.code}", *other_methods(first, second)]
    notes += [f"{name}: {words}" for name, study in (("A", first), ("B", second)) for words in study.unlike]
    notes += [READING, *notes_of_tests(changed), *_left_out(changed, first, second)]
    notes += other_leaders(*(study_verdicts(study.rows, metric, method, rule).standings for study in (first, second)))
    asked = chosen.fail_above is not None
    sentences, failed = _failures(changed, first, second, chosen.fail_above) if asked else ([], False)
    compared = Compared(metric, changed, varying, notes, chosen.fail_above, failed)
    if chosen.format in WRITERS:
        print(WRITERS[chosen.format](compared), end="")
    else:
        print_compared(compared)
    for sentence in sentences:
        print(sentence, file=sys.stdout if chosen.format == "terminal" else sys.stderr)
    if failed:
        raise SystemExit(WORSE)


READING = (
    "A, B: geometric means over the runs that went well (arithmetic where a value is 0); B/A: geometric mean with "
    "Student's 95 % interval, over the seeds of both where they match; with lost runs the median."
)
"""The explanation below the numbers."""


def _failures(changed: "Sequence[Change]", first: "Study", second: "Study", percent: float) -> tuple[list[str], bool]:
    """Return what is worse and what cannot be judged, in sentences, and whether anything is."""
    worse = sum(change.worse(percent) for change in changed)
    sentences = [f"{worse} of {len(changed)} combinations are worse by more than {percent:g} %."]
    lacking = first.combinations - len(changed) + sum(change.unjudged for change in changed)
    if lacking:
        sentences.append(
            f"{lacking} of the {first.combinations} combinations of A cannot be judged: B lacks them, or runs of them."
        )
    damaged = len(first.damaged) + len(second.damaged)
    if damaged:
        sentences.append(f"{damaged} damaged file{'s' * (damaged > 1)} cannot be judged.")
    return sentences, bool(worse or lacking or damaged)


def _left_out(changed: "Sequence[Change]", first: "Study", second: "Study") -> list[str]:
    """Return sentences about the results that the comparison leaves out."""
    counts = (("A", first.combinations - len(changed)), ("B", second.combinations - len(changed)))
    notes = [f"{count} combinations of {name} alone are left out." for name, count in counts if count]
    for name, study in (("A", first), ("B", second)):
        if study.damaged:
            notes.append(f"Damaged in {name}, and left out: {', '.join(study.damaged)}.")
    absent = sum(change.absent for change in changed)
    return [*notes, f"{absent} runs of A have no run of the same seed in B."] if absent else notes
