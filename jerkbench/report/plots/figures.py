"""Figures of single runs; `matplotlib.figure.Figure` without pyplot, whose import takes half a second."""

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jerkbench.files import write_atomically
from jerkbench.report.plots.errors_over_time import error_figure
from jerkbench.report.plots.inclination_over_time import inclination_figure
from jerkbench.report.plots.trajectory import trajectory_figure

__all__ = ["error_figure", "inclination_figure", "png_bytes", "save_figure", "save_pdf", "trajectory_figure"]

COLOURS = 128
"""Of a PNG's palette: lines and areas need no more, and the file is a third as large."""


def save_figure(figure: Figure, path: Path) -> None:
    """Write ``figure`` to ``path`` (the ending says the format: png, pdf, svg), whole or not at all."""
    write_atomically(path, figure.savefig)


def png_bytes(figure: Figure) -> bytes:
    """Return ``figure`` as a PNG with a palette; drawn once (`savefig` draws twice)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]  # matplotlib's
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    image = Image.fromarray(pixels).convert("RGB")
    data = io.BytesIO()
    image.quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(data, format="png")
    return data.getvalue()


def save_pdf(figure: Figure, path: Path) -> None:
    """Write ``figure`` as it was laid out for its PNG: to lay it out again takes as long as to draw it."""
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    figure.set_layout_engine("none")
    write_atomically(path, FigureCanvasPdf(figure).print_pdf)
