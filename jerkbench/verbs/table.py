"""`jerkbench table`: the table of a study once more, arranged as one likes, and what it shows in sentences."""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.verbs.arguments import Verbs, add_run_programs, add_verb
from jerkbench.verbs.judging import add_judging, chosen_method, chosen_rule

if TYPE_CHECKING:
    from jerkbench.report.analysis.study_verdicts import StudyVerdicts
    from jerkbench.report.tables.table_model import Table
    from jerkbench.results.study import Study

NOTHING = (
    "Nothing can be compared: no cell without adaptation, or with the baseline filter (--baseline FACTOR=NAME takes "
    "another), or a metric of which the lowest is not the best."
)

TOLD = 10
"""So many comparisons are printed without ``--all``."""

FORMATS = ("terminal", "md", "csv", "tex", "html", "json")


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    table = add_verb(verbs, "table", "print the table of a study once more, arranged as you like", answer)
    factors = "dataset, disturbance, attitude, filter, adaptation, noise; separated by commas"
    table.add_argument("folder", type=Path, help="the study's folder, for example results/paper, or a folder of cells")
    table.add_argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)")
    table.add_argument("--rows", help=f"factors that make the rows: {factors}")
    table.add_argument("--columns", help="factors that make the columns (default: adaptation)")
    table.add_argument("--baseline", metavar="FACTOR=NAME", help="add ratios to it, with tests: adaptation=none")
    add_judging(table)
    table.add_argument("--tag", help="only the cells that were run with tags=[TAG]")
    table.add_argument(
        "--findings",
        action="store_true",
        help=f"say in sentences what differs, the {TOLD} largest differences first; with --baseline, from that",
    )
    table.add_argument("--all", action="store_true", help="with --findings: every comparison")
    table.add_argument(
        "--costs", action="store_true", help="put the time a step beside it: each method runs again, here"
    )
    add_run_programs(table)
    table.add_argument("--fit", action="store_true", help="with --format tex: no wider than A4 with margins of 25 mm")
    table.add_argument("--format", choices=FORMATS, default="terminal")


def answer(chosen: argparse.Namespace) -> None:
    """Print the table, or its findings.

    Raises:
        JerkbenchError: there are no results, or no such metric, factor or baseline.
    """
    from jerkbench.report.analysis.baseline import parse_baseline
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
        print("\n".join(_sentences(study, verdicts, metric, baseline, every=chosen.all) or [NOTHING]))
        return
    _writer(chosen.format, fit=chosen.fit)(table)
    if chosen.costs:
        from jerkbench.results.replay import tell_left_out
        from jerkbench.results.step_costs import COLUMN, step_costs

        tell_left_out(study, run_programs=chosen.run_programs)
        if len(costs := step_costs(study, run_programs=chosen.run_programs)):
            _writer(chosen.format, fit=chosen.fit)(summarise(costs, COLUMN, rows, columns))


def _sentences(
    study: "Study", verdicts: "StudyVerdicts", metric: str, baseline: "Mapping[str, str] | None", *, every: bool
) -> list[str]:
    """Return the comparisons with the baseline that was asked for.

    Without one: who leads, what holds over all scenarios, the paper's claim, and the comparisons with the usual ones.
    """
    from jerkbench.report.analysis.across import across
    from jerkbench.report.analysis.findings import findings
    from jerkbench.report.analysis.paper_claim import claims
    from jerkbench.report.analysis.standings import summary

    compared = findings(study.rows, verdicts, baseline)
    left = 0 if every else max(0, len(compared) - TOLD)
    if left:
        compared = [*compared[:TOLD], f"{left} more comparisons: --findings --all prints them."]
    if baseline:
        return compared
    claim = claims(study.rows) if study.of_the_paper else []
    over_all = across(study.rows, verdicts, metric)
    return [*summary(verdicts.standings), *over_all, *claim, *compared]


def _writer(name: str, *, fit: bool) -> "Callable[[Table], None]":
    """Return what writes a table in a format.

    Raises:
        JerkbenchError: only LaTeX is to fit paper.
    """
    from jerkbench.report.tables.latex_fit import fitted_latex

    if fit and name != "tex":
        raise JerkbenchError("--fit goes with --format tex: the other formats know nothing of paper.")
    return (lambda table: print(fitted_latex(table), end="")) if fit else _writers()[name]


def _writers() -> "dict[str, Callable[[Table], None]]":
    from jerkbench.report.tables.csv import tidy_csv
    from jerkbench.report.tables.html import html_table
    from jerkbench.report.tables.latex import latex
    from jerkbench.report.tables.markdown import markdown
    from jerkbench.report.tables.table_json import table_json
    from jerkbench.report.tables.terminal import print_summary

    return {
        "terminal": print_summary,
        "md": lambda table: print(markdown(table), end=""),
        "csv": lambda table: print(tidy_csv([table]), end=""),
        "tex": lambda table: print(latex(table), end=""),
        "html": lambda table: print(html_table(table), end=""),
        "json": lambda table: print(table_json(table), end=""),
    }


def _factors(words: str | None) -> list[str] | None:
    return [word.strip() for word in words.split(",") if word.strip()] if words is not None else None
