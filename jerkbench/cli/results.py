"""The commands for stored results: table, figures, report, compare, rerun, export, cite."""

import argparse
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.cli.arguments import (
    JUDGING,
    RUN_PROGRAMS,
    STUDY,
    argument,
    command,
    count,
    flag,
    judging,
    percentage,
)
from jerkbench.errors import FAILED, NOT_COMPARABLE, JerkbenchError
from jerkbench.report import Choice

if TYPE_CHECKING:
    from jerkbench.jobs.study import Study
    from jerkbench.report.changes import StudyComparison
    from jerkbench.report.findings import StudyVerdicts

NOTHING_COMPARED = (
    "No comparison is possible: each scenario has one method, or lower values of the metric are not better."
)

MAX_PRINTED = 10
"""Number of comparisons that are printed without ``--all``."""

TABLE_FORMATS = ("terminal", "md", "csv", "tex", "html", "json")

FACTOR_NAMES = "dataset, disturbance, attitude, filter, adaptation, noise; separated by commas"


@command(
    STUDY,
    argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first metric)"),
    argument("--rows", help=f"factors of the rows: {FACTOR_NAMES}"),
    argument("--columns", help="factors of the columns (default: adaptation)"),
    argument("--baseline", metavar="FACTOR=NAME", help="add ratios to this method, with tests: adaptation=none"),
    *JUDGING,
    flag("--findings", help=f"describe the {MAX_PRINTED} largest differences (with --baseline: from the baseline)"),
    flag("--all", help="with --findings: describe every comparison"),
    argument("--format", choices=TABLE_FORMATS, default="terminal"),
    flag("--wide", help="print the geometric mean (gm), too"),
    flag("--notes", help="print all notes below the table"),
)
def table_command(arguments: argparse.Namespace) -> None:
    """Print a table of a study for a metric, with selected rows and columns.

      jerkbench table results/first --baseline adaptation=none
      jerkbench table results/first --metric velocity_rmse_mps --rows disturbance --columns filter --format md
      jerkbench table results/first --findings --all

    Raises:
        JerkbenchError: The folder has no results, or the metric, a factor or the baseline is unknown.
    """
    from jerkbench.jobs.study import load_study
    from jerkbench.report.comparisons import parse_baseline
    from jerkbench.report.findings import study_verdicts
    from jerkbench.report.summary import main_metric, summarise
    from jerkbench.report.terminal import print_table
    from jerkbench.report.writers import WRITERS

    study = load_study(arguments.folder)
    metric = arguments.metric or main_metric(study.rows)
    baseline = parse_baseline(arguments.baseline) if arguments.baseline else None
    rows, columns = _factors(arguments.rows), _factors(arguments.columns)
    verdicts = study_verdicts(study.rows, metric, *judging(arguments))
    table = summarise(study.rows, metric, rows, columns, study.notes, baseline, verdicts)
    if arguments.findings:
        print(_findings(study, verdicts, baseline, every=arguments.all) or NOTHING_COMPARED)
        return
    if arguments.format == "terminal":
        print_table(table, "repeat the command with --notes", wide=arguments.wide, every_note=arguments.notes)
    else:
        print(WRITERS[arguments.format](table), end="")


def _findings(study: "Study", verdicts: "StudyVerdicts", baseline: "Mapping[str, str] | None", *, every: bool) -> str:
    """Return the text about the comparisons with a baseline.

    If no baseline is given, the text contains the main result of the study, the comparisons over all scenarios, and the
    comparisons with the default baselines.
    """
    from jerkbench.report.findings import across, answer, findings

    compared = findings(study.rows, verdicts, baseline, every=every)
    if (left := len(compared) - MAX_PRINTED) > 0 and not every:
        compared = [*compared[:MAX_PRINTED], f"{left} more comparisons; --findings --all prints all."]
    standings = verdicts.standings
    if baseline or not any(len(standing.rivals) > 1 for standing in standings):
        return "\n".join(compared)
    title, details = answer(standings)
    return "\n".join([f"{title.rstrip('.')}.", *details, *across(verdicts), *compared])


def _factors(names: str | None) -> list[str] | None:
    return [name.strip() for name in names.split(",") if name.strip()] if names is not None else None


@command(
    STUDY,
    argument("--out", type=Path, help="folder of the figures (default: figures/ in the study's folder)"),
    argument(
        "--scenarios", default="20", metavar="NAMES", help="number or names: none,imu_bias+gnss_outage (default: 20)"
    ),
    argument("--methods", metavar="NAMES", help="draw only these methods, for example baseline,jerk+mtf"),
    argument("--seed", type=int, help="seed of the run that is drawn (default: the first seed)"),
    RUN_PROGRAMS,
    flag("--pdf", help="write each figure as a PDF, too"),
)
def figures_command(arguments: argparse.Namespace) -> None:
    """Draw the figures of a study: its metrics, and the runs of each scenario.

      jerkbench figures results/first --scenarios none --methods baseline,jerk+mtf
      jerkbench figures results/first --scenarios 0 --pdf --out paper

    Raises:
        JerkbenchError: The folder has no results, or a method, a scenario or the seed is unknown.
    """
    from jerkbench.jobs.executors import processors
    from jerkbench.jobs.study import load_study, report_excluded_programs
    from jerkbench.report.plots.style import BETWEEN
    from jerkbench.report.study_figures import FIGURES, LIMIT, Request, draw_study

    out = arguments.out or arguments.folder / FIGURES
    counted = arguments.scenarios.isdecimal()
    request = Request(
        Choice.ALL,
        int(arguments.scenarios) if counted else LIMIT,
        out,
        pdf=arguments.pdf,
        traces=False,
        run_programs=arguments.run_programs,
        methods=BETWEEN.split(arguments.methods) if arguments.methods else (),
        scenarios=() if counted else BETWEEN.split(arguments.scenarios),
        seed=arguments.seed,
    )
    study = load_study(arguments.folder)
    report_excluded_programs(study, run_programs=arguments.run_programs)
    for picture in draw_study(study, request, processors())[0]:
        for ending in ("png", "pdf") if arguments.pdf else ("png",):
            print(out / f"{picture.name}.{ending}")


@command(
    STUDY,
    argument("--out", type=Path, help="the file (default: report.html in the study's folder)"),
    argument("--scenarios", type=count, default=20, help="number of scenarios whose runs are shown (default: 20)"),
    argument("--figures", choices=[*Choice], default=Choice.FEW, help="few: three scenarios (default); all; none"),
    RUN_PROGRAMS,
    *JUDGING,
)
def report_command(arguments: argparse.Namespace) -> None:
    """Write an HTML report of a study, with findings, a table, figures and a review.

      jerkbench report results/first --figures none
      jerkbench report results/first --scenarios 1 --out first.html

    Raises:
        JerkbenchError: The folder has no results, or the path of the file is a folder.
    """
    from jerkbench.jobs.executors import processors
    from jerkbench.jobs.study import load_study, report_excluded_programs
    from jerkbench.report.study_figures import REPORT, Request, write_report

    study = load_study(arguments.folder)
    path = arguments.out or arguments.folder / REPORT
    if path.is_dir():
        raise JerkbenchError(f"{path} is a folder; give the name of a file: --out {path / REPORT}.")
    request = Request(Choice(arguments.figures), arguments.scenarios, run_programs=arguments.run_programs)
    report_excluded_programs(study, run_programs=arguments.run_programs)
    write_report(study, path, request, processors(), *judging(arguments))
    print(path)


ROW_ARGUMENTS = (
    argument("folder", type=Path, help="a study's folder, or a folder of cells"),
    argument("row", type=count, metavar="ROW", help="number of the row in rows.csv (from 1)"),
    RUN_PROGRAMS,
)
"""The arguments that select a row of the stored results."""


@command(*ROW_ARGUMENTS)
def rerun_command(arguments: argparse.Namespace) -> None:
    """Run a row again from its stored configuration, and compare all numbers.

    Numbers are considered equal if their relative difference is at most 1e-9.

      jerkbench rerun results/first 1
      jerkbench rerun results/first 12

    Raises:
        JerkbenchError: The row does not exist, or its data have changed.
        SystemExit: 1 if a number differs.
    """
    from jerkbench.jobs.study import SAME_WITHIN, relative_difference, replay_differences, stored_row
    from jerkbench.report.terminal import print_grid

    row = stored_row(arguments.folder, arguments.row, run_programs=arguments.run_programs)
    numbers = replay_differences(row)
    differences = [relative_difference(a, b) for _, a, b in numbers]
    marks = ["differs" if difference > SAME_WITHIN else "" for difference in differences]
    lines = [[name, repr(a), repr(b), mark] for (name, a, b), mark in zip(numbers, marks, strict=True)]
    notes = ["The code or a library has changed since the row was stored."] if row.code_changed else []
    title = f"{', '.join(row.job.labels)}, {row.row['replicate']} {row.draw}"
    print_grid(title, ["", "stored", "new", ""], lines, notes)
    differing = marks.count("differs")
    largest = max(differences, default=0.0)
    print(f"{differing} of {len(numbers)} numbers differ. The largest relative difference is {largest:.2g}.")
    if differing:
        raise SystemExit(FAILED)


@command(
    *ROW_ARGUMENTS,
    argument("--tum", type=Path, metavar="FOLDER", required=True, help="write estimate.tum, reference.tum"),
)
def export_command(arguments: argparse.Namespace) -> None:
    """Write the trajectories of a stored run in the TUM format.

      jerkbench export results/first 1 --tum trajectories
      jerkbench export results/first 12 --tum other_trajectories

    Raises:
        JerkbenchError: The row does not exist, its data have changed, or the run has no reference.
    """
    from jerkbench.evaluation.counted_rows import counted_rows
    from jerkbench.jobs.study import stored_row
    from jerkbench.report.writers import write_tum_pair

    row = stored_row(arguments.folder, arguments.row, run_programs=arguments.run_programs)
    recording, estimate = row.run()
    counted = counted_rows(estimate, recording, row.job.protocol.burn_in_s)
    for path in write_tum_pair(arguments.tum, recording, estimate, counted):
        print(path)


@command(argument("folder", nargs="?", type=Path, help="the study's folder (default: cite only jerkbench)"))
def cite_command(arguments: argparse.Namespace) -> None:
    """Print BibTeX entries of the methods and data sets of a study, and of jerkbench.

      jerkbench cite
      jerkbench cite results/first

    Raises:
        JerkbenchError: The folder cannot be read.
    """
    from jerkbench.jobs.study import load_study
    from jerkbench.report.writers import entries_of

    jobs = load_study(arguments.folder).metadata.values() if arguments.folder else ()
    print("\n\n".join(entries_of(job["spec"] for job in jobs)))


# The exit code of `jerkbench compare` can be used as a regression test in continuous integration.

COMPARISON_FORMATS = ("terminal", "md", "json")

WORSE_CODE = 3
"""Exit code if a combination fails the regression test (``--fail-above``)."""


READING_NOTE = (
    "A, B: geometric means over the successful runs (arithmetic if a value is 0). B/A: geometric mean and its 95 % "
    "interval (Student's t), paired if the seeds match; the median if runs diverged or failed."
)
"""The explanation of A, B and B/A that is printed below a comparison."""


@command(
    argument("first", metavar="A", type=Path, help="folder of the first study (before)"),
    argument("second", metavar="B", type=Path, help="folder of the second study (after)"),
    argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first metric)"),
    argument("--fail-above", type=percentage, metavar="PCT", help="exit with code 3 if B is worse than A; see below"),
    argument("--format", choices=COMPARISON_FORMATS, default="terminal", help="default: terminal"),
    JUDGING[1],
)
def compare_command(arguments: argparse.Namespace) -> None:
    """Compare two sets of results, with paired runs if the seeds match.

      jerkbench compare results/first results/second --fail-above 3
      jerkbench compare results/first results/second --metric velocity_rmse_mps --format md

    --fail-above PCT is a regression test of two versions of the same methods. A combination fails if

      - its geometric mean over the paired runs is larger by more than PCT percent,
      - more runs diverge or fail, or fewer runs have a value, or
      - the value of a run increases by a factor of more than 10, or from 0.

    Exit codes:

      0  success; with --fail-above: no combination fails
      1  an internal error of jerkbench
      2  the input is invalid: a folder, a name, an option
      3  with --fail-above: a combination fails
      4  A and B cannot be compared; with --fail-above also: B lacks results of A, A and B have no seed in common, or a
         file is damaged

    Raises:
        JerkbenchError: A folder has no results, or the studies have no common combinations or different conditions.
        SystemExit: 3 if a combination fails, otherwise 4 if a combination cannot be compared.
    """
    from jerkbench.jobs.study import load_study
    from jerkbench.report.changes import (
        COMPARISON_WRITERS,
        StudyComparison,
        changes,
        print_comparison,
        require_alike,
    )
    from jerkbench.report.columns import varying_factors
    from jerkbench.report.comparisons import VerdictRule
    from jerkbench.report.summary import main_metric

    first, second = load_study(arguments.first), load_study(arguments.second)
    require_alike(first, second)
    metric, varying = arguments.metric or main_metric(first.rows), varying_factors(first.rows)
    changed = changes(first.rows, second.rows, metric, VerdictRule(arguments.margin / 100))
    comparison = StudyComparison(metric, changed, varying, (), arguments.fail_above, failed=False)
    messages, code = ([], 0) if arguments.fail_above is None else _failures(comparison, first, second)
    comparison = comparison._replace(notes=_notes(first, second, comparison), failed=bool(code))
    if arguments.format in COMPARISON_WRITERS:
        print(COMPARISON_WRITERS[arguments.format](comparison), end="")
    else:
        print_comparison(comparison)
    for message in messages:
        print(message, file=sys.stdout if arguments.format == "terminal" else sys.stderr)
    if code:
        raise SystemExit(code)


def _notes(first: "Study", second: "Study", comparison: "StudyComparison") -> list[str]:
    from jerkbench.report.changes import notes_of_tests, other_methods

    changed, studies = comparison.changes, {"A": first, "B": second}.items()
    notes = [f"{name}: {study.folder}, {study.code}" for name, study in studies]
    notes += other_methods(first, second)
    notes += [f"{name}: {note}" for name, study in studies for note in study.unlike]
    notes += [READING_NOTE, *notes_of_tests(changed)]
    counts = [(name, study.combinations - len(changed)) for name, study in studies]
    notes += [f"{count} combinations that exist only in {name} are left out." for name, count in counts if count]
    damaged = [(name, ", ".join(study.damaged)) for name, study in studies if study.damaged]
    notes += [f"Damaged files in {name}, which are left out: {files}." for name, files in damaged]
    if absent := sum(change.absent for change in changed):
        notes.append(f"{absent} runs of A have no run with the same seed in B.")
    found = zip(comparison.names, comparison.failures, strict=True)
    return [*notes, *(f"{name} fails: {failure}." for name, failures in found for failure in failures)]


def _failures(comparison: "StudyComparison", first: "Study", second: "Study") -> tuple[list[str], int]:
    """Return messages about the combinations that fail or that cannot be compared, and the exit code."""
    changed, worse = comparison.changes, sum(map(bool, comparison.failures))
    messages = [f"{worse} of {len(changed)} combinations fail (allowed: {comparison.allowed:g} %)."]
    reasons = Counter(change.unjudged for change in changed if change.unjudged)
    if missing := first.combinations - len(changed):
        reasons["they are missing in B"] = missing
    if reasons:
        because = "; ".join(f"{count} because {reason}" for reason, count in reasons.items())
        total = f"{reasons.total()} of the {first.combinations} combinations of A"
        messages.append(f"{total} cannot be compared: {because}.")
    if damaged := len(first.damaged) + len(second.damaged):
        messages.append(f"{damaged} damaged file{'s' * (damaged > 1)} cannot be compared.")
    return messages, WORSE_CODE if worse else NOT_COMPARABLE if reasons or damaged else 0
