"""`jerkbench figures`: every figure of a study, as PNG and PDF."""

import argparse
from pathlib import Path

from jerkbench.verbs.kinds import Verbs, count, output


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    figures = verbs.add_parser("figures", help="draw a study's figures: those of its rows, and of each scenario's runs")
    figures.add_argument("folder", type=Path, help="the study's folder, or a folder of cells")
    figures.add_argument("--out", type=output, help="where they go (default: figures/ in the study's folder)")
    figures.add_argument("--scenarios", type=count, default=20, help="draw the runs of so many scenarios (default: 20)")
    figures.set_defaults(answer=answer)


def answer(chosen: argparse.Namespace) -> None:
    """Draw, and name each file.

    Raises:
        JerkbenchError: there are no results.
    """
    from jerkbench.execution.processors import processors
    from jerkbench.results.study import load_study
    from jerkbench.results.study_figures.files import draw_study
    from jerkbench.results.study_figures.presentation import FIGURES

    out = chosen.out or chosen.folder / FIGURES
    drawn = draw_study(load_study(chosen.folder), out, chosen.scenarios, processors(), traces=False)
    for picture in drawn.pictures:
        print(out / f"{picture.name}.png")
