"""The look of figures, for the colour-blind too, and their files; without pyplot, whose import takes half a second."""

import io
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from jerkbench.arrays import FloatArray
from jerkbench.files import write_atomically

OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's palette (2008) in an order that keeps neighbours apart; its yellow is too pale for a line."""

REFERENCE = "black"
MEASURED = "#9A9A9A"
OUTAGE = "#F0C27B"
SIGMAS = "#D3DEE8"
"""Bands of what a filter claims, or of a consistent one; no filter has this colour."""

DOTS_PER_INCH = 150
"""Set when a figure is made, so that it is laid out as it is saved."""

STEPS = (1, 2, 2.5, 5, 10)
"""Distances of ticks, in powers of ten."""

LEGEND_CHARACTERS = 93
"""How many characters fit beside each other under a figure of 7 inch."""
HANDLE_CHARACTERS = 9
"""How many of them the line before a label takes."""

LEGEND_ROW_IN = 0.22


def new_figure(
    height_in: float, width_in: float = 7.0, layout: Literal["constrained", "compressed"] = "constrained"
) -> Figure:
    """Return an empty figure of this size [inch]."""
    return Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout=layout)


def shade_outages(axes: Axes, outages_s: FloatArray, label: str | None = None) -> None:
    """Shade the outages; the first of them carries the label."""
    for k, (begin, end) in enumerate(outages_s):
        axes.axvspan(begin, end, color=OUTAGE, alpha=0.28, linewidth=0, label=label if k == 0 else None, zorder=0)


def quiet(axes: Axes) -> None:
    """Take away the box, put a light grid behind the lines, and let the ticks depend on the limits alone.

    Ticks that depend on the height too change after the layout has measured their labels, and labels get clipped.
    """
    if axes.get_yscale() == "linear":
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            _plain(axis)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(visible=True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)


def _plain(axis: Axis) -> None:
    """Name the ticks of a logarithmic axis as one says them (0.02); within two decades also those between tens."""
    low, high = sorted(axis.get_view_interval())
    between = (1.0, 2.0, 5.0) if low > 0 and high < 100 * low else (1.0,)
    narrow = low > 0 and high < 4 * low  # there may be one power of ten, or none
    axis.set_major_locator(MaxNLocator(4, steps=STEPS) if narrow else LogLocator(subs=between, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def literal(text: str) -> str:
    """Return a name as matplotlib has to be given it, so that a ``$`` in it begins no formula."""
    return text.replace("$", r"\$")


def legend_below(figure: Figure) -> None:
    """Put the legend under the axes, in as many columns as its labels allow, and make the figure taller for it."""
    labels = [label for axes in figure.axes for label in axes.get_legend_handles_labels()[1]]
    if not labels:
        return
    columns = max(1, min(3, len(labels), LEGEND_CHARACTERS // (max(map(len, labels)) + HANDLE_CHARACTERS)))
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + LEGEND_ROW_IN * -(-len(labels) // columns))
    legend = figure.legend(loc="outside lower center", ncols=columns, frameon=False)
    for text in legend.get_texts():
        text.set_text(literal(text.get_text()))
    for handle in legend.legend_handles:
        if isinstance(handle, Line2D) and handle.get_marker() == ".":
            handle.set(markersize=6.0, alpha=1.0)


def end_with(axes: Axes, t_s: FloatArray) -> None:
    """Let the horizontal axis begin and end with the data."""
    if len(t_s) and t_s[0] < t_s[-1]:
        axes.set_xlim(float(t_s[0]), float(t_s[-1]))


def say(axes: Axes, sentence: str) -> None:
    """Write ``sentence`` where there is nothing to draw."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color("#CCCCCC")
    axes.text(0.5, 0.5, sentence, transform=axes.transAxes, ha="center", va="center", color="#555555")


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
