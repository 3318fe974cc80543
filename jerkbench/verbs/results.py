"""The verbs that show a study: `table`, `figures`, `report`; those that keep it, and say what it rests on."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.report import Choice
from jerkbench.verbs.arguments import JUDGING, RUN_PROGRAMS, argument, chosen_method, chosen_rule, count, output, verb

if TYPE_CHECKING:
    from jerkbench.report.analysis.study_verdicts import StudyVerdicts
    from jerkbench.report.tables.table_model import Table
    from jerkbench.results.study import Study

NOTHING_COMPARED = (
    "Nothing can be compared: no cell without adaptation, or with the baseline filter (--baseline FACTOR=NAME takes "
    "another), or a metric of which the lowest is not the best."
)

FIRST_TOLD = 10
"""So many comparisons are printed without ``--all``."""

TABLE_FORMATS = ("terminal", "md", "csv", "tex", "html", "json")

FACTOR_NAMES = "dataset, disturbance, attitude, filter, adaptation, noise; separated by commas"


@verb(
    argument("folder", type=Path, help="the study's folder, for example results/paper, or a folder of cells"),
    argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)"),
    argument("--rows", help=f"factors that make the rows: {FACTOR_NAMES}"),
    argument("--columns", help="factors that make the columns (default: adaptation)"),
    argument("--baseline", metavar="FACTOR=NAME", help="add ratios to it, with tests: adaptation=none"),
    *JUDGING,
    argument("--tag", help="only the cells that were run with tags=[TAG]"),
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

    Raises:
        JerkbenchError: there are no results, or no such metric, factor or baseline.
    """
    from jerkbench.report.analysis.runs import parse_baseline
    from jerkbench.report.analysis.study_verdicts import study_verdicts
    from jerkbench.report.tables.summary import main_metric, summarise
    from jerkbench.results.study import load_study, tagged

    study = load_study(chosen.folder)
    study = tagged(study, chosen.tag) if chosen.tag else study
    metric = chosen.metric or main_metric(study.rows)
    baseline = parse_baseline(chosen.baseline) if chosen.baseline else None
    rows, columns = _factors(chosen.rows), _factors(chosen.columns)
    verdicts = study_verdicts(study.rows, metric, chosen_method(chosen), chosen_rule(chosen))
    table = summarise(study.rows, metric, rows, columns, study.notes, baseline, verdicts)
    if chosen.findings:
        print("\n".join(_sentences(study, verdicts, metric, baseline, every=chosen.all) or [NOTHING_COMPARED]))
        return
    _write(table, chosen.format)
    if chosen.costs:
        from jerkbench.results.replay import COLUMN, step_costs, tell_left_out

        tell_left_out(study, run_programs=chosen.run_programs)
        if len(costs := step_costs(study, run_programs=chosen.run_programs)):
            _write(summarise(costs, COLUMN, rows, columns), chosen.format)


def _sentences(
    study: "Study", verdicts: "StudyVerdicts", metric: str, baseline: "Mapping[str, str] | None", *, every: bool
) -> list[str]:
    """Return the comparisons with the baseline that was asked for.

    Without one: who leads, what holds over all scenarios, and the comparisons with the usual ones.
    """
    from jerkbench.report.analysis.findings import findings
    from jerkbench.report.analysis.standings import verdict_sentences
    from jerkbench.report.analysis.study_verdicts import across

    compared = findings(study.rows, verdicts, baseline)
    left = 0 if every else max(0, len(compared) - FIRST_TOLD)
    if left:
        compared = [*compared[:FIRST_TOLD], f"{left} more comparisons: --findings --all prints them."]
    if baseline:
        return compared
    over_all = across(study.rows, verdicts, metric)
    return [*verdict_sentences(verdicts.standings), *over_all, *compared]


def _write(table: "Table", name: str) -> None:
    from jerkbench.report.tables.terminal import print_summary
    from jerkbench.report.tables.writers import WRITERS

    if name == "terminal":
        print_summary(table)
    else:
        print(WRITERS[name](table), end="")


def _factors(words: str | None) -> list[str] | None:
    return [word.strip() for word in words.split(",") if word.strip()] if words is not None else None


@verb(
    argument("folder", type=Path, help="the study's folder, or a folder of cells"),
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

    Raises:
        JerkbenchError: there are no results, or no such method, scenario or seed.
    """
    from jerkbench.jobs.cluster import processors
    from jerkbench.report import Choice
    from jerkbench.report.plots.style import BETWEEN
    from jerkbench.results.replay import tell_left_out
    from jerkbench.results.study import load_study
    from jerkbench.results.study_figures import LIMIT, Request, draw_study
    from jerkbench.results.study_report import FIGURES

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
    for picture in draw_study(study, request, processors()).pictures:
        for ending in ("png", "pdf") if chosen.pdf else ("png",):
            print(out / f"{picture.name}.{ending}")


@verb(
    argument("folder", type=Path, help="the study's folder, or a folder of cells"),
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

    Raises:
        JerkbenchError: there are no results, or the file cannot be one.
    """
    from jerkbench.jobs.cluster import processors
    from jerkbench.results.replay import tell_left_out
    from jerkbench.results.study import load_study
    from jerkbench.results.study_figures import Request
    from jerkbench.results.study_report import REPORT, write_report

    study = load_study(chosen.folder)
    path = chosen.out or chosen.folder / REPORT
    if path.is_dir():
        raise JerkbenchError(f"{path} is a folder; give the name of a file: --out {path / REPORT}.")
    method, rule = chosen_method(chosen), chosen_rule(chosen)
    request = Request(Choice(chosen.figures), chosen.scenarios, run_programs=chosen.run_programs)
    tell_left_out(study, run_programs=chosen.run_programs)
    write_report(study, path, request, processors(), method, rule)
    print(path)


@verb(argument("folder", type=Path, help="the study's folder"))
def pack_verb(chosen: argparse.Namespace) -> None:
    """Join the rows of a study into one file, without incomplete cells.

    Raises:
        JerkbenchError: there are no results, or some are damaged.
    """
    from jerkbench.results.store import Store

    path = Store(chosen.folder).pack()
    print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


@verb(argument("folder", nargs="?", type=Path, help="the study's folder (default: jerkbench alone)"))
def cite_verb(chosen: argparse.Namespace) -> None:
    """Print BibTeX of every method and data set of a study, and of jerkbench.

    Raises:
        JerkbenchError: the folder cannot be read.
    """
    from jerkbench.results.bibliography import entries_of, own_entry

    print("\n\n".join(entries_of(chosen.folder) if chosen.folder else [own_entry()]))
