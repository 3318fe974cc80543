"""Figures of single runs; `matplotlib.figure.Figure` without pyplot, whose import takes half a second."""

import io
from pathlib import Path

from matplotlib.figure import Figure

from jerkbench.files import write_atomically
from jerkbench.report.errors_over_time import error_figure
from jerkbench.report.inclination_over_time import inclination_figure
from jerkbench.report.trajectory import trajectory_figure

__all__ = ["error_figure", "inclination_figure", "png_bytes", "save_figure", "save_pdf", "trajectory_figure"]

COLOURS = 128
"""Of a PNG's palette: lines and areas need no more, and the file is a third as large."""


def save_figure(figure: Figure, path: Path) -> None:
    """Write ``figure`` to ``path`` (the ending says the format: png, pdf, svg), whole or not at all."""
    write_atomically(path, figure.savefig)


def png_bytes(figure: Figure) -> bytes:
    """Return ``figure`` as a PNG with a palette."""
    from PIL import Image

    full, small = io.BytesIO(), io.BytesIO()
    figure.savefig(full, format="png")
    image = Image.open(full).convert("RGB")
    image.quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(small, format="png")
    return small.getvalue()


def save_pdf(figure: Figure, path: Path) -> None:
    """Write ``figure`` as it was laid out for its PNG: to lay it out again takes as long as to draw it."""
    figure.set_layout_engine("none")
    save_figure(figure, path)
