"""`jerkbench compare`: two sets of results, combination by combination; its exit code tells a machine."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import NOT_COMPARABLE
from jerkbench.verbs.arguments import JUDGING, argument, chosen_method, chosen_rule, percentage, verb

if TYPE_CHECKING:
    from jerkbench.report.analysis.changes import Change
    from jerkbench.report.compared import MetricChanges, Tolerances
    from jerkbench.results.study import Study

COMPARISON_FORMATS = ("terminal", "md", "json", "junit")

WORSE_CODE = 3
"""Exit code where the second set is worse than it may be."""

COMPARE = """\
A and B are folders. FOLDER:METHOD is one method of a folder: filter, adaptation and noise, joined by +, or
FACTOR=VALUE.

  jerkbench compare results/first results/second --fail-above 3
  jerkbench compare results/first:jerk+none results/second:jerk+mtf --format md

--tolerances FILE says how much worse a result may become (YAML, or TOML with a list of [[tolerances]]). The first line
that fits a combination counts; if none fits, --fail-above counts. Patterns work as in file names:

  tolerances:
    - {metric: position_rmse_m, method: mtf, scenario: gnss_outage, ratio: 1.10}
    - {metric: outage_end_m, ratio: 1.2}
    - {ratio: 1.02}

Exit codes:

  0  done; with --fail-above or --tolerances: nothing is worse than it may be
  1  a mistake of jerkbench itself
  2  the input is wrong: a folder, a name, an option, a file of tolerances
  3  with --fail-above or --tolerances: something is worse than it may be
  4  A and B cannot be compared; with --fail-above or --tolerances also: B lacks results of A, or a file is damaged
"""

READING_NOTE = (
    "A, B: geometric means over the runs that went well (arithmetic where a value is 0); B/A: geometric mean with "
    "Student's 95 % interval, over the seeds of both where they match; with lost runs the median."
)
"""The explanation below the numbers."""


@verb(
    argument(
        "first", metavar="A", help="a study's folder, or a folder of cells: before; FOLDER:METHOD takes one method"
    ),
    argument("second", metavar="B", help="another: after"),
    argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)"),
    argument(
        "--fail-above",
        type=percentage,
        metavar="PCT",
        help="exit with 3 where B is worse than A by more than PCT percent, with 4 where it lacks what A has",
    ),
    argument("--tolerances", type=Path, metavar="FILE", help="what may become worse by how much; see below"),
    argument("--format", choices=COMPARISON_FORMATS, default="terminal", help="default: terminal"),
    *JUDGING,
    epilog=COMPARE,
)
def compare_verb(chosen: argparse.Namespace) -> None:
    """Compare two sets of results, over the same seeds where they match.

    Raises:
        JerkbenchError: there are no results, nothing is in both, or they were not measured alike.
        SystemExit: 3, where B is worse than it may be; 4, where nothing is, but B lacks results that A has.
    """
    from jerkbench.report.compared import WRITERS, StudyComparison, print_comparison

    first, second, chosen_of = _studies(chosen)
    tolerances = _tolerances(chosen)
    parts = _parts(chosen, first, second, tolerances)
    has_tolerances = tolerances.otherwise is not None or bool(tolerances.rules)
    sentences, code = _failures(parts, first, second, chosen.tolerances) if has_tolerances else ([], 0)
    comparison = StudyComparison(parts, [*chosen_of, *_notes(chosen, first, second, parts, tolerances)], bool(code))
    if chosen.format in WRITERS:
        print(WRITERS[chosen.format](comparison), end="")
    else:
        print_comparison(comparison)
    for sentence in sentences:
        print(sentence, file=sys.stdout if chosen.format == "terminal" else sys.stderr)
    if code:
        raise SystemExit(code)


def _studies(chosen: argparse.Namespace) -> "tuple[Study, Study, list[str]]":
    """Both studies, with one method of each under the same name where methods were chosen, and a sentence about it."""
    from jerkbench.results.selection import in_the_place_of, named_study, require_alike, selected, told
    from jerkbench.results.study import load_study

    named = (named_study(chosen.first), named_study(chosen.second))
    first, second = (selected(load_study(of.folder), of.chosen) for of in named)
    methods = (named[0].chosen, named[1].chosen)
    sentences = told(first, second, methods)
    second = in_the_place_of(first, second, methods)
    require_alike(first, second)
    return first, second, sentences


def _tolerances(chosen: argparse.Namespace) -> "Tolerances":
    from jerkbench.report.compared import Tolerances, read_tolerances

    if chosen.tolerances is None:
        return Tolerances(otherwise=chosen.fail_above)
    return read_tolerances(chosen.tolerances, chosen.fail_above)


def _parts(
    chosen: argparse.Namespace, first: "Study", second: "Study", tolerances: "Tolerances"
) -> "list[MetricChanges]":
    from jerkbench.report.analysis.changes import changes
    from jerkbench.report.analysis.findings import varying_factors
    from jerkbench.report.compared import MetricChanges
    from jerkbench.report.tables.summary import main_metric

    rule, varying = chosen_rule(chosen), varying_factors(first.rows)
    metrics = [chosen.metric] if chosen.metric else tolerances.metrics(main_metric(first.rows), first.rows.columns)
    parts = []
    for metric in metrics:
        changed = changes(first.rows, second.rows, metric, rule)
        allowed = [tolerances.percent(metric, change.combination) for change in changed]
        parts.append(MetricChanges(metric, changed, varying, allowed))
    return parts


def _notes(
    chosen: argparse.Namespace,
    first: "Study",
    second: "Study",
    parts: "Sequence[MetricChanges]",
    tolerances: "Tolerances",
) -> list[str]:
    from jerkbench.report.analysis.changes import notes_of_tests, other_leaders
    from jerkbench.report.analysis.study_verdicts import study_verdicts
    from jerkbench.results.selection import other_methods

    rule, method, changed = chosen_rule(chosen), chosen_method(chosen), parts[0].changes
    notes = [f"A: {chosen.first}, {first.code}", f"B: {chosen.second}, {second.code}", *other_methods(first, second)]
    notes += [f"{name}: {words}" for name, study in (("A", first), ("B", second)) for words in study.unlike]
    notes += [READING_NOTE, *notes_of_tests(changed), *_left_out(changed, first, second)]
    notes += tolerances.idle((part.metric, change.combination) for part in parts for change in part.changes)
    verdicts = (study_verdicts(study.rows, parts[0].metric, method, rule) for study in (first, second))
    return [*notes, *other_leaders(*(of.standings for of in verdicts))]


def _failures(
    parts: "Sequence[MetricChanges]", first: "Study", second: "Study", file: Path | None
) -> tuple[list[str], int]:
    """Return what is worse and what cannot be judged, in sentences, and the exit code."""
    sentences = [_counted(part, file) for part in parts]
    changed = parts[0].changes
    lacking = first.combinations - len(changed) + sum(change.unjudged for change in changed)
    if lacking:
        sentences.append(
            f"{lacking} of the {first.combinations} combinations of A cannot be judged: B lacks them, or runs of them."
        )
    damaged = len(first.damaged) + len(second.damaged)
    if damaged:
        sentences.append(f"{damaged} damaged file{'s' * (damaged > 1)} cannot be judged.")
    unjudged = NOT_COMPARABLE if lacking or damaged else 0
    return sentences, WORSE_CODE if any(any(part.worse) for part in parts) else unjudged


def _counted(part: "MetricChanges", file: Path | None) -> str:
    limits = {percent for percent in part.allowed if percent is not None}
    by = f"{limits.pop():g} %" if len(limits) == 1 and file is None else f"{file} allows"
    subject = "combinations" if file is None else f"combinations, by {part.metric},"
    return f"{sum(part.worse)} of {len(part.changes)} {subject} are worse by more than {by}."


def _left_out(changed: "Sequence[Change]", first: "Study", second: "Study") -> list[str]:
    """Return sentences about the results that the comparison leaves out."""
    counts = (("A", first.combinations - len(changed)), ("B", second.combinations - len(changed)))
    notes = [f"{count} combinations of {name} alone are left out." for name, count in counts if count]
    for name, study in (("A", first), ("B", second)):
        if study.damaged:
            notes.append(f"Damaged in {name}, and left out: {', '.join(study.damaged)}.")
    absent = sum(change.absent for change in changed)
    return [*notes, f"{absent} runs of A have no run of the same seed in B."] if absent else notes
