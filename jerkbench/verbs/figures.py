"""`jerkbench figures`: every figure of a study, as PNG, and as PDF where that is asked for."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_run_programs, add_verb, count, output


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    figures = add_verb(
        verbs, "figures", "draw a study's figures: those of its rows, and of each scenario's runs", answer
    )
    figures.add_argument("folder", type=Path, help="the study's folder, or a folder of cells")
    figures.add_argument("--out", type=output, help="where they go (default: figures/ in the study's folder)")
    figures.add_argument("--scenarios", type=count, default=20, help="draw the runs of so many scenarios (default: 20)")
    figures.add_argument("--few", action="store_true", help="only of scenarios and methods that carry a finding")
    add_run_programs(figures)
    figures.add_argument("--pdf", action="store_true", help="each as PDF, too")


def answer(chosen: argparse.Namespace) -> None:
    """Draw, and name each file.

    Raises:
        JerkbenchError: there are no results.
    """
    from jerkbench.execution.processors import processors
    from jerkbench.results.replay import tell_left_out
    from jerkbench.results.study import load_study
    from jerkbench.results.study_figures.choice import Choice
    from jerkbench.results.study_figures.files import Request, draw_study
    from jerkbench.results.study_figures.presentation import FIGURES

    out = chosen.out or chosen.folder / FIGURES
    choice = Choice.FEW if chosen.few else Choice.ALL
    request = Request(choice, chosen.scenarios, out, pdf=chosen.pdf, traces=False, run_programs=chosen.run_programs)
    study = load_study(chosen.folder)
    tell_left_out(study, run_programs=chosen.run_programs)
    for picture in draw_study(study, request, processors()).pictures:
        for ending in ("png", "pdf") if chosen.pdf else ("png",):
            print(out / f"{picture.name}.{ending}")
