"""`jerkbench table`: the table of a study once more, arranged as one likes, and what it shows in sentences."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.verbs.kinds import Verbs, percentage

if TYPE_CHECKING:
    from jerkbench.report.tables.table_model import Table

FORMATS = ("terminal", "md", "csv", "tex", "html")


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    table = verbs.add_parser("table", help="print the table of a study once more, arranged as you like")
    factors = "dataset, disturbance, attitude, filter, adaptation, noise; separated by commas"
    table.add_argument("folder", type=Path, help="the study's folder, for example results/paper, or a folder of cells")
    table.add_argument("--metric", help="a column of rows.csv (default: position_rmse_m, or the first there is)")
    table.add_argument("--rows", help=f"factors that make the rows: {factors}")
    table.add_argument("--columns", help="factors that make the columns (default: adaptation)")
    table.add_argument("--baseline", metavar="FACTOR=NAME", help="add ratios to it, with tests: adaptation=none")
    table.add_argument(
        "--method",
        default="filter,adaptation,noise",
        metavar="FACTORS",
        help="what a method is made of, for --findings (default: filter,adaptation,noise); the rest are scenarios",
    )
    table.add_argument(
        "--margin",
        type=percentage,
        default=3.0,
        metavar="PCT",
        help="methods within PCT percent are equal (default: 3)",
    )
    table.add_argument(
        "--correction",
        choices=("max_t", "fdr"),
        default="max_t",
        help="5 %% of studies with any wrong sentence (max_t, the default), or of sentences (fdr)",
    )
    table.add_argument("--findings", action="store_true", help="say in sentences what differs, and what does not")
    table.add_argument("--format", choices=FORMATS, default="terminal")
    table.set_defaults(answer=answer)


def answer(chosen: argparse.Namespace) -> None:
    """Print the table, or its findings.

    Raises:
        JerkbenchError: there are no results, or no such metric, factor or baseline.
    """
    from jerkbench.evaluation.statistics.family import Correction
    from jerkbench.report.analysis.comparison import Rule, parse_baseline
    from jerkbench.report.analysis.findings import findings
    from jerkbench.report.analysis.paper_claim import claims
    from jerkbench.report.analysis.standings import parse_method, standings, summary
    from jerkbench.report.tables.summary import main_metric, summarise
    from jerkbench.results.study import load_study

    study = load_study(chosen.folder)
    metric = chosen.metric or main_metric(study.rows)
    baseline = parse_baseline(chosen.baseline) if chosen.baseline else None
    rule = Rule(chosen.margin / 100, Correction(chosen.correction))
    table = summarise(
        study.rows, metric, _factors(chosen.rows), _factors(chosen.columns), study.notes, baseline=baseline, rule=rule
    )
    if chosen.findings:
        leading = summary(standings(study.rows, metric, parse_method(chosen.method), rule))
        sentences = [*leading, *claims(study.rows), *findings(study.rows, metric, rule)]
        print(
            "\n".join(
                sentences or ["Nothing can be compared: no cell without adaptation, or with the baseline filter."]
            )
        )
        return
    _writers()[chosen.format](table)


def _writers() -> "dict[str, Callable[[Table], None]]":
    from jerkbench.report.tables.csv import tidy_csv
    from jerkbench.report.tables.html import html_table
    from jerkbench.report.tables.latex import latex
    from jerkbench.report.tables.markdown import markdown
    from jerkbench.report.tables.terminal import print_summary

    return {
        "terminal": print_summary,
        "md": lambda table: print(markdown(table), end=""),
        "csv": lambda table: print(tidy_csv([table]), end=""),
        "tex": lambda table: print(latex(table), end=""),
        "html": lambda table: print(html_table(table), end=""),
    }


def _factors(words: str | None) -> list[str] | None:
    return [word.strip() for word in words.split(",") if word.strip()] if words is not None else None
