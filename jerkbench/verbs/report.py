"""`jerkbench report`: a study as one HTML file, which needs no network."""

import argparse
from pathlib import Path

from jerkbench.errors import JerkbenchError
from jerkbench.results.study_figures.choice import Choice
from jerkbench.verbs.arguments import Verbs, add_run_programs, add_verb, count, output
from jerkbench.verbs.judging import add_judging, chosen_method, chosen_rule


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    report = add_verb(
        verbs, "report", "write a study as one HTML file: findings, every cell, figures, a review", answer
    )
    report.add_argument("folder", type=Path, help="the study's folder, or a folder of cells")
    report.add_argument("--out", type=output, help="the file (default: report.html in the study's folder)")
    report.add_argument("--scenarios", type=count, default=20, help="show the runs of so many scenarios (default: 20)")
    report.add_argument(
        "--figures",
        choices=[choice.value for choice in Choice],
        default=Choice.FEW.value,
        help="of scenarios and methods that carry a finding (few, the default), of all, or none",
    )
    add_run_programs(report)
    add_judging(report)


def answer(chosen: argparse.Namespace) -> None:
    """Write the report, and name the file.

    Raises:
        JerkbenchError: there are no results, or the file cannot be one.
    """
    from jerkbench.execution.processors import processors
    from jerkbench.results.replay import tell_left_out
    from jerkbench.results.study import load_study
    from jerkbench.results.study_figures.files import Request, draw_study
    from jerkbench.results.study_figures.presentation import REPORT, write_report

    study = load_study(chosen.folder)
    path = chosen.out or chosen.folder / REPORT
    if path.is_dir():
        raise JerkbenchError(f"{path} is a folder; give the name of a file: --out {path / REPORT}.")
    method, rule = chosen_method(chosen), chosen_rule(chosen)
    request = Request(Choice(chosen.figures), chosen.scenarios, run_programs=chosen.run_programs)
    tell_left_out(study, run_programs=chosen.run_programs)
    drawn = draw_study(study, request, processors())
    write_report(study, drawn, path, method, rule)
    print(path)
