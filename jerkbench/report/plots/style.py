"""The style of every figure: sizes, colours of methods, curves with gaps, files."""

import io
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

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
SHADE = "#F0C27B"
BAND_COLOUR = "#D3DEE8"
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
        axes.axvspan(begin, end, color=SHADE, alpha=0.28, linewidth=0, label=label if k == 0 else None, zorder=0)


def style_axes(axes: Axes) -> None:
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


def draw_ticks(axes: Axes, t_s: FloatArray, height: float, colour: str, label: str | None = None) -> None:
    """Draw a tick at each time, at a share of the height of the axes."""
    look = {"color": colour, "markersize": 4.0, "transform": axes.get_xaxis_transform(), "label": label}
    axes.plot(t_s, np.full(len(t_s), height), "|", **look)  # type: ignore[arg-type]  # as documented


def say(axes: Axes, sentence: str) -> None:
    """Write ``sentence`` where there is nothing to draw."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color("#CCCCCC")
    axes.text(0.5, 0.5, sentence, transform=axes.transAxes, ha="center", va="center", color="#555555")


COLOURS_OF_A_FILE = 128
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
    image.quantize(COLOURS_OF_A_FILE, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(
        data, format="png"
    )
    return data.getvalue()


def save_pdf(figure: Figure, path: Path) -> None:
    """Write ``figure`` as it was laid out for its PNG: to lay it out again takes as long as to draw it."""
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    figure.set_layout_engine("none")
    write_atomically(path, FigureCanvasPdf(figure).print_pdf)


# The look of each method: one colour a filter, one line style an adaptation, in every figure and on the page.

COLOURS = (*OKABE_ITO, "#332288", "#882255", "#117733", "#999933", "#661100", "#44AA99")
"""Okabe and Ito's, then the darker ones of Paul Tol's muted palette (2021)."""

DASHES = ((), (8, 4), (2, 3), (10, 3, 2, 3), (4, 2), (1, 2))
"""Lengths of dashes and gaps, in pixels; the first is a full line."""

HATCHES = ("", "////", "....", "xxxx", "----", "\\\\\\\\")
"""What stands for the dashes where a method is an area."""

NO_ADAPTATION = "none"
"""The adaptation that has the full line, wherever it stands."""

_POINTS = 0.5
"""Lengths of dashes in a figure, for one pixel of the page, in line widths."""

BETWEEN = re.compile(r", *(?![^()]*\))")
"""A comma that is in no parentheses."""

DrawnMethod = tuple[str, str]
"""Filter and adaptation."""


class MethodStyle(NamedTuple):
    """How a method is drawn.

    Attributes:
        colour: of its filter.
        dash: of its adaptation, as on the page.
        hatch: of its adaptation, where it is an area.
    """

    colour: str
    dash: tuple[int, ...]
    hatch: str

    @property
    def stroke(self) -> dict[str, Any]:
        """Colour and line style as matplotlib takes them."""
        dashes = (0.0, tuple(_POINTS * length for length in self.dash)) if self.dash else "-"
        return {"color": self.colour, "linestyle": dashes}


class Palette(NamedTuple):
    """The filters and adaptations of a study, in the order in which they take colours and line styles.

    Attributes:
        filters: their labels.
        adaptations: their labels.
    """

    filters: tuple[str, ...]
    adaptations: tuple[str, ...]

    @classmethod
    def of(cls, methods: Iterable[DrawnMethod]) -> "Palette":
        """Return the palette of ``methods``."""
        methods = list(methods)
        adaptations = dict.fromkeys(adaptation for _, adaptation in methods)
        plain = [NO_ADAPTATION] * (NO_ADAPTATION in adaptations)
        return cls(
            tuple(dict.fromkeys(filter_name for filter_name, _ in methods)),
            tuple(dict.fromkeys([*plain, *adaptations])),
        )

    def look(self, method: DrawnMethod) -> MethodStyle:
        """Return the look of a method; one that the study has not comes after all others."""
        filter_name, adaptation = method
        dash = _place(self.adaptations, adaptation) % len(DASHES)
        return MethodStyle(COLOURS[_place(self.filters, filter_name) % len(COLOURS)], DASHES[dash], HATCHES[dash])


def method_of(name: str) -> DrawnMethod:
    """Return filter and adaptation of a method's name.

    >>> method_of("jerk(a=1, b=2) + mtf, accel_mps2=0.1")
    ('jerk(a=1, b=2)', 'mtf')
    >>> method_of("gnss_only")
    ('gnss_only', 'none')
    """
    filter_name, _, rest = name.partition(" + ")
    return filter_name, BETWEEN.split(rest.partition(" + ")[0])[0] or NO_ADAPTATION


def method_styles(names: Iterable[str], palette: Palette | None = None) -> Iterator[tuple[str, MethodStyle]]:
    """Yield each method's name with its look; without a palette in the order of the names."""
    names = list(names)
    palette = palette or Palette.of(map(method_of, names))
    return ((name, palette.look(method_of(name))) for name in names)


def _place(labels: tuple[str, ...], label: str) -> int:
    return labels.index(label) if label in labels else len(labels)


# Curves over time: thinned to what a pixel shows, those that coincide found.

_COLUMNS = 1000
"""Pixels of a figure's width; of each the lowest and the highest value are kept."""

COINCIDE = 0.01
"""Curves that are nowhere further apart than this share of the larger one are one line for the eye."""


def thinned(t_s: FloatArray, values: FloatArray, columns: int = _COLUMNS) -> tuple[FloatArray, FloatArray]:
    """Return times and values of a curve with at most two points a column: the lowest and the highest.

    A value that is not known ends the line, and stays. What is short enough is returned as it is.
    """
    if len(t_s) <= 2 * columns:
        return t_s, values
    edges = np.searchsorted(t_s, np.linspace(t_s[0], t_s[-1], columns + 1)[:-1])
    starts = np.unique(edges)
    known = np.isfinite(values)
    places = [
        _extremes(np.where(known, values, fill), starts, function)
        for fill, function in ((np.inf, np.minimum), (-np.inf, np.maximum))
    ]
    gaps = np.flatnonzero(~known & np.r_[True, known[:-1]])
    kept = np.unique(np.concatenate([[0, len(t_s) - 1], *places, gaps]))
    return t_s[kept], values[kept]


def with_gaps(t_s: FloatArray, values: FloatArray, longest: float = 3.0) -> tuple[FloatArray, FloatArray]:
    """Return a curve with an unknown value wherever two times are more than ``longest`` median steps apart."""
    steps = np.diff(t_s)
    places = np.flatnonzero(steps > longest * np.median(steps)) + 1 if len(steps) else np.empty(0, dtype=int)
    return np.insert(t_s, places, t_s[places - 1]), np.insert(values, places, np.nan)


def _extremes(values: FloatArray, starts: np.ndarray, function: np.ufunc) -> np.ndarray:
    """Return the first place of the extreme of each part that begins at ``starts``."""
    extremes = function.reduceat(values, starts)
    lengths = np.diff(np.r_[starts, len(values)])
    hits = np.flatnonzero((values == np.repeat(extremes, lengths)) & np.isfinite(values))
    parts = np.searchsorted(starts, hits, side="right") - 1
    return hits[np.unique(parts, return_index=True)[1]]


def coinciding(curves: Mapping[str, FloatArray]) -> list[list[str]]:
    """Return the names of curves in groups that coincide within `COINCIDE`, each with the first of its group."""
    groups: list[list[str]] = []
    for name, values in curves.items():
        group = next((names for names in groups if _coincide(curves[names[0]], values)), None)
        if group is None:
            groups.append(group := [])
        group.append(name)
    return groups


def _coincide(first: FloatArray, second: FloatArray) -> bool:
    if first.shape != second.shape or not np.array_equal(np.isfinite(first), np.isfinite(second)):
        return False
    known = np.isfinite(first)
    with np.errstate(over="ignore"):
        largest = np.maximum(np.abs(first[known]), np.abs(second[known]))
        return bool(np.all(np.abs(first[known] - second[known]) <= COINCIDE * largest))
