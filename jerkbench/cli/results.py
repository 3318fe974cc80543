"""The verbs that show a study, or compare two: `table`, `figures`, `report`, `compare`; those that keep and cite it."""

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
    count,
    judging,
    output,
    percentage,
    verb,
)
from jerkbench.errors import NOT_COMPARABLE, JerkbenchError
from jerkbench.report import Choice

if TYPE_CHECKING:
    from jerkbench.jobs.study import Study
    from jerkbench.report.changes import StudyComparison
    from jerkbench.report.study_verdicts import StudyVerdicts
    from jerkbench.report.table_model import Table

NOTHING_COMPARED = (
    "Nothing can be compared: there is only one method in each scenario, or the lowest value of the metric is not the "
    "best."
)

FIRST_TOLD = 10
"""So many comparisons are printed without ``--all``."""

TABLE_FORMATS = ("terminal", "md", "csv", "tex", "html", "json")

FACTOR_NAMES = "dataset, disturbance, attitude, filter, adaptation, noise; separated by commas"


@verb(
    STUDY,
    argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)"),
    argument("--rows", help=f"factors that make the rows: {FACTOR_NAMES}"),
    argument("--columns", help="factors that make the columns (default: adaptation)"),
    argument("--baseline", metavar="FACTOR=NAME", help="add ratios to it, with tests: adaptation=none"),
    *JUDGING,
    argument(
        "--findings",
        action="store_true",
        help=f"say in sentences what differs, the {FIRST_TOLD} largest differences first; with --baseline, from that",
    ),
    argument("--all", action="store_true", help="with --findings: every comparison"),
    argument("--costs", action="store_true", help="put the time a step beside it: each method runs again, here"),
    RUN_PROGRAMS,
    argument("--format", choices=TABLE_FORMATS, default="terminal"),
)
def table_verb(chosen: argparse.Namespace) -> None:
    """Print the table of a study, with rows, columns and metric of your choice.

      jerkbench table results/first --baseline adaptation=none
      jerkbench table results/first --metric velocity_rmse_mps --rows disturbance --columns filter --format md
      jerkbench table results/first --findings --all

    Raises:
        JerkbenchError: there are no results, or no such metric, factor or baseline.
    """
    from jerkbench.jobs.study import load_study
    from jerkbench.report.comparisons import parse_baseline
    from jerkbench.report.study_verdicts import study_verdicts
    from jerkbench.report.summary import main_metric, summarise

    study = load_study(chosen.folder)
    metric = chosen.metric or main_metric(study.rows)
    baseline = parse_baseline(chosen.baseline) if chosen.baseline else None
    rows, columns = _factors(chosen.rows), _factors(chosen.columns)
    verdicts = study_verdicts(study.rows, metric, *judging(chosen))
    table = summarise(study.rows, metric, rows, columns, study.notes, baseline, verdicts)
    if chosen.findings:
        print("\n".join(_sentences(study, verdicts, metric, baseline, every=chosen.all) or [NOTHING_COMPARED]))
        return
    _write(table, chosen.format)
    if chosen.costs:
        from jerkbench.jobs.replay import COLUMN, step_costs, tell_left_out

        tell_left_out(study, run_programs=chosen.run_programs)
        if len(costs := step_costs(study, run_programs=chosen.run_programs)):
            _write(summarise(costs, COLUMN, rows, columns), chosen.format)


def _sentences(
    study: "Study", verdicts: "StudyVerdicts", metric: str, baseline: "Mapping[str, str] | None", *, every: bool
) -> list[str]:
    """Return the comparisons with the baseline that was asked for.

    Without one: who leads, what holds over all scenarios, and the comparisons with the usual ones.
    """
    from jerkbench.report.comparisons import verdict_sentences
    from jerkbench.report.findings import findings
    from jerkbench.report.study_verdicts import across

    compared = findings(study.rows, verdicts, baseline)
    left = 0 if every else max(0, len(compared) - FIRST_TOLD)
    if left:
        compared = [*compared[:FIRST_TOLD], f"{left} more comparisons: --findings --all prints them."]
    if baseline:
        return compared
    return [*verdict_sentences(verdicts.standings), *across(study.rows, verdicts, metric), *compared]


def _write(table: "Table", name: str) -> None:
    from jerkbench.report.terminal import print_summary
    from jerkbench.report.writers import WRITERS

    if name == "terminal":
        print_summary(table)
    else:
        print(WRITERS[name](table), end="")


def _factors(words: str | None) -> list[str] | None:
    return [word.strip() for word in words.split(",") if word.strip()] if words is not None else None


@verb(
    STUDY,
    argument("--out", type=output, help="where they go (default: figures/ in the study's folder)"),
    argument(
        "--scenarios",
        default="20",
        metavar="NAMES",
        help="these alone, for example none,imu_bias+gnss_outage; or the runs of so many (default: 20)",
    ),
    argument("--methods", metavar="NAMES", help="these alone, for example baseline,jerk+mtf"),
    argument("--seed", type=int, help="the run of each scenario that is drawn (default: the first)"),
    argument("--few", action="store_true", help="only of scenarios and methods that carry a finding"),
    RUN_PROGRAMS,
    argument("--pdf", action="store_true", help="each as PDF, too"),
)
def figures_verb(chosen: argparse.Namespace) -> None:
    """Draw a study's figures: those of its rows, and of each scenario's runs.

      jerkbench figures results/first --scenarios none --methods baseline,jerk+mtf
      jerkbench figures results/first --scenarios 0 --pdf --out paper

    Raises:
        JerkbenchError: there are no results, or no such method, scenario or seed.
    """
    from jerkbench.jobs.executors import processors
    from jerkbench.jobs.replay import tell_left_out
    from jerkbench.jobs.study import load_study
    from jerkbench.report.plots.style import BETWEEN
    from jerkbench.report.study_figures import FIGURES, LIMIT, Request, draw_study

    out = chosen.out or chosen.folder / FIGURES
    counted = chosen.scenarios.isdecimal()
    request = Request(
        Choice.FEW if chosen.few else Choice.ALL,
        int(chosen.scenarios) if counted else LIMIT,
        out,
        pdf=chosen.pdf,
        traces=False,
        run_programs=chosen.run_programs,
        methods=BETWEEN.split(chosen.methods) if chosen.methods else (),
        scenarios=() if counted else BETWEEN.split(chosen.scenarios),
        seed=chosen.seed,
    )
    study = load_study(chosen.folder)
    tell_left_out(study, run_programs=chosen.run_programs)
    for picture in draw_study(study, request, processors())[0]:
        for ending in ("png", "pdf") if chosen.pdf else ("png",):
            print(out / f"{picture.name}.{ending}")


@verb(
    STUDY,
    argument("--out", type=output, help="the file (default: report.html in the study's folder)"),
    argument("--scenarios", type=count, default=20, help="show the runs of so many scenarios (default: 20)"),
    argument(
        "--figures",
        choices=[choice.value for choice in Choice],
        default=Choice.FEW.value,
        help="of scenarios and methods that carry a finding (few, the default), of all, or none",
    ),
    RUN_PROGRAMS,
    *JUDGING,
)
def report_verb(chosen: argparse.Namespace) -> None:
    """Write a study as one HTML file, with findings, table, figures and a review.

      jerkbench report results/first --figures none
      jerkbench report results/first --scenarios 1 --out first.html

    Raises:
        JerkbenchError: there are no results, or the file cannot be one.
    """
    from jerkbench.jobs.executors import processors
    from jerkbench.jobs.replay import tell_left_out
    from jerkbench.jobs.study import load_study
    from jerkbench.report.study_figures import REPORT, Request, write_report

    study = load_study(chosen.folder)
    path = chosen.out or chosen.folder / REPORT
    if path.is_dir():
        raise JerkbenchError(f"{path} is a folder; give the name of a file: --out {path / REPORT}.")
    request = Request(Choice(chosen.figures), chosen.scenarios, run_programs=chosen.run_programs)
    tell_left_out(study, run_programs=chosen.run_programs)
    write_report(study, path, request, processors(), *judging(chosen))
    print(path)


@verb(argument("folder", nargs="?", type=Path, help="the study's folder (default: jerkbench alone)"))
def cite_verb(chosen: argparse.Namespace) -> None:
    """Print BibTeX of every method and data set of a study, and of jerkbench.

      jerkbench cite
      jerkbench cite results/first

    Raises:
        JerkbenchError: the folder cannot be read.
    """
    from jerkbench.jobs.study import load_study
    from jerkbench.report.bibliography import entries_of

    jobs = load_study(chosen.folder).metadata.values() if chosen.folder else ()
    print("\n\n".join(entries_of(job["spec"] for job in jobs)))


# `jerkbench compare`: two sets of results, combination by combination; its exit code tells a machine.

COMPARISON_FORMATS = ("terminal", "md", "json", "junit")

WORSE_CODE = 3
"""Exit code if a combination fails the gate."""


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
        help="compare the same seeds, and exit with 3 if B is worse than A; see below",
    ),
    argument("--format", choices=COMPARISON_FORMATS, default="terminal", help="default: terminal"),
    *JUDGING,
)
def compare_verb(chosen: argparse.Namespace) -> None:
    """Compare two sets of results, over the same seeds where they match.

    A and B are folders. FOLDER:METHOD is one method of a folder: filter, adaptation and noise, joined by +, or
    FACTOR=VALUE.

      jerkbench compare results/first results/second --fail-above 3
      jerkbench compare results/first:jerk+none results/second:jerk+mtf --format md

    --fail-above PCT makes it a gate for two versions of the same methods. A combination fails if

      - its geometric mean over the runs of both is larger by more than PCT percent,
      - more runs diverge or fail, or fewer runs have a value, or
      - any single run increased by more than 10 times, or from 0.

    Exit codes:

      0  done; with --fail-above: no combination fails
      1  an internal error of jerkbench
      2  the input is wrong: a folder, a name, an option
      3  with --fail-above: a combination fails
      4  A and B cannot be compared; with --fail-above also: B lacks results of A, A and B have no seed in common, or a
         file is damaged

    Raises:
        JerkbenchError: there are no results, nothing is in both, or they were not measured in the same way.
        SystemExit: 3 if a combination fails, otherwise 4 if something cannot be judged.
    """
    from jerkbench.jobs.study import load_study
    from jerkbench.report.changes import COMPARISON_WRITERS, StudyComparison, changes, print_comparison
    from jerkbench.report.findings import varying_factors
    from jerkbench.report.selection import in_the_place_of, named_study, require_alike, selected
    from jerkbench.report.summary import main_metric

    (a, of_a), (b, of_b) = named_study(chosen.first), named_study(chosen.second)
    first, second = selected(load_study(a), of_a), selected(load_study(b), of_b)
    second, chosen_of = in_the_place_of(first, second, {**of_a, **of_b})
    require_alike(first, second)
    metric, varying = chosen.metric or main_metric(first.rows), varying_factors(first.rows)
    changed = changes(first.rows, second.rows, metric, judging(chosen)[1])
    comparison = StudyComparison(metric, changed, varying, (), chosen.fail_above, failed=False)
    sentences, code = ([], 0) if chosen.fail_above is None else _failures(comparison, first, second)
    notes = [*chosen_of, *_notes(chosen, first, second, comparison)]
    comparison = comparison._replace(notes=notes, failed=bool(code))
    if chosen.format in COMPARISON_WRITERS:
        print(COMPARISON_WRITERS[chosen.format](comparison), end="")
    else:
        print_comparison(comparison)
    for sentence in sentences:
        print(sentence, file=sys.stdout if chosen.format == "terminal" else sys.stderr)
    if code:
        raise SystemExit(code)


def _notes(chosen: argparse.Namespace, first: "Study", second: "Study", comparison: "StudyComparison") -> list[str]:
    from jerkbench.report.changes import notes_of_tests, other_leaders
    from jerkbench.report.selection import other_methods
    from jerkbench.report.study_verdicts import study_verdicts

    changed = comparison.changes
    notes = [f"A: {chosen.first}, {first.code}", f"B: {chosen.second}, {second.code}", *other_methods(first, second)]
    notes += [f"{name}: {words}" for name, study in (("A", first), ("B", second)) for words in study.unlike]
    notes += [READING_NOTE, *notes_of_tests(changed)]
    counts = (("A", first.combinations - len(changed)), ("B", second.combinations - len(changed)))
    notes += [f"{count} combinations of {name} alone are left out." for name, count in counts if count]
    damaged = (("A", first.damaged), ("B", second.damaged))
    notes += [f"Damaged in {name}, and left out: {', '.join(files)}." for name, files in damaged if files]
    if absent := sum(change.absent for change in changed):
        notes.append(f"{absent} runs of A have no run of the same seed in B.")
    found = zip(comparison.names, comparison.failures, strict=True)
    notes += [f"{name} fails: {failure}." for name, failures in found for failure in failures]
    verdicts = (study_verdicts(study.rows, comparison.metric, *judging(chosen)) for study in (first, second))
    return [*notes, *other_leaders(*(of.standings for of in verdicts))]


def _failures(comparison: "StudyComparison", first: "Study", second: "Study") -> tuple[list[str], int]:
    """Return how many combinations fail or cannot be judged, in sentences, and the exit code."""
    changed, worse = comparison.changes, sum(map(bool, comparison.failures))
    sentences = [f"{worse} of {len(changed)} combinations fail (allowed: {comparison.allowed:g} %)."]
    reasons = Counter(change.unjudged for change in changed if change.unjudged)
    if missing := first.combinations - len(changed):
        reasons["they are missing in B"] = missing
    if reasons:
        because = "; ".join(f"{count} because {reason}" for reason, count in reasons.items())
        sentences.append(
            f"{reasons.total()} of the {first.combinations} combinations of A cannot be judged: {because}."
        )
    if damaged := len(first.damaged) + len(second.damaged):
        sentences.append(f"{damaged} damaged file{'s' * (damaged > 1)} cannot be judged.")
    return sentences, WORSE_CODE if worse else NOT_COMPARABLE if reasons or damaged else 0
