"""`jerkbench table`: the table of a study once more, arranged as one likes."""

from pathlib import Path

from jerkbench.benchmark.study import load_study
from jerkbench.report.latex import latex
from jerkbench.report.markdown import markdown
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.terminal import print_summary
from jerkbench.report.tidy import tidy_csv


def print_study_table(folder: Path, metric: str | None, rows: str | None, columns: str | None, form: str) -> None:
    """Print one metric of the study in ``folder``.

    Args:
        folder: the study's.
        metric: a column of its rows.csv; None: the position's, or the first there is.
        rows: factors of the rows, separated by commas; None: all that vary and are not columns.
        columns: factors of the columns; None: the adaptation.
        form: "terminal", "md", "csv" or "tex".

    Raises:
        JerkbenchError: there are no results, or no such metric or factor.
    """
    study = load_study(folder)
    table = summarise(study.rows, metric or main_metric(study.rows), _factors(rows), _factors(columns), study.notes)
    if form == "terminal":
        print_summary(table)
    else:
        text = {"md": lambda: markdown(table), "tex": lambda: latex(table), "csv": lambda: tidy_csv([table])}[form]()
        print(text, end="")


def _factors(words: str | None) -> list[str] | None:
    return [word.strip() for word in words.split(",") if word.strip()] if words is not None else None
