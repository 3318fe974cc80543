"""`jerkbench report`: a study as one HTML file, which needs no network."""

import argparse
from pathlib import Path

from jerkbench.errors import JerkbenchError
from jerkbench.verbs.kinds import Verbs, count, output


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    report = verbs.add_parser("report", help="write a study as one HTML file: findings, every cell, figures, a review")
    report.add_argument("folder", type=Path, help="the study's folder, or a folder of cells")
    report.add_argument("--out", type=output, help="the file (default: report.html in the study's folder)")
    report.add_argument("--scenarios", type=count, default=6, help="draw the runs of so many scenarios (default: 6)")
    report.set_defaults(answer=answer)


def answer(chosen: argparse.Namespace) -> None:
    """Write the report, and name the file.

    Raises:
        JerkbenchError: there are no results, or the file cannot be one.
    """
    from jerkbench.execution.processors import processors
    from jerkbench.results.study import load_study
    from jerkbench.results.study_figures.files import draw_study
    from jerkbench.results.study_figures.presentation import REPORT, write_report

    study = load_study(chosen.folder)
    path = chosen.out or chosen.folder / REPORT
    if path.is_dir():
        raise JerkbenchError(f"{path} is a folder; give the name of a file: --out {path / REPORT}.")
    write_report(study, draw_study(study, None, chosen.scenarios, processors()), path)
    print(path)
