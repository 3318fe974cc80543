"""Figures of single runs; `matplotlib.figure.Figure` without pyplot, whose import takes half a second."""

from pathlib import Path

from matplotlib.figure import Figure

from jerkbench.files import write_atomically
from jerkbench.report.errors_over_time import error_figure
from jerkbench.report.inclination_over_time import inclination_figure
from jerkbench.report.trajectory import trajectory_figure

__all__ = ["error_figure", "inclination_figure", "save_figure", "trajectory_figure"]


def save_figure(figure: Figure, path: Path) -> None:
    """Write ``figure`` to ``path`` (the ending says the format: png, pdf, svg), whole or not at all."""
    write_atomically(path, figure.savefig)
