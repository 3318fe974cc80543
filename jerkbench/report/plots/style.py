"""The common style of all figures: sizes, colours of methods, curves with gaps, and image files."""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from jerkbench.arrays import FloatArray
from jerkbench.files import write_atomically

if TYPE_CHECKING:
    from PIL.Image import Image

OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""The palette of Okabe and Ito (2008), ordered so that neighbours are distinct. Yellow is left out as too pale."""

REFERENCE = "black"
MEASURED = "#9A9A9A"
SHADE = "#F0C27B"
BAND_COLOUR = "#D3DEE8"
"""Colour of three-sigma bands and of the NEES and NIS bands of a consistent filter. No filter has this colour."""

DOTS_PER_INCH = 150
"""Resolution of figures. It is set when a figure is created, so that the layout is the same in the file."""

LOGARITHMIC_FROM = 10.0
"""An axis is logarithmic if the ratio of the largest value to a typical or the smallest value is above this limit."""

STEPS = (1, 2, 2.5, 5, 10)
"""Distances between ticks, as multiples of a power of ten."""

LEGEND_CHARACTERS = 93
"""Number of characters that fit into a line of the legend below a figure with a width of 7 inch."""
HANDLE_CHARACTERS = 9
"""Width of the line symbol before a label of the legend, in characters."""

LEGEND_ROW_IN = 0.22


def new_figure(
    height_in: float, width_in: float = 7.0, layout: Literal["constrained", "compressed"] = "constrained"
) -> Figure:
    """Return an empty figure with the given height and width [inch]."""
    return Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout=layout)


def panels_over_time(
    title: str, height_in: float, rows: int, columns: int = 1, height_ratios: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a title, and its panels (column by column), which have a common time axis."""
    figure = new_figure(height_in)
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False, height_ratios=height_ratios)
    figure.suptitle(literal(title), fontsize="medium")
    for axes in panels[-1]:
        axes.set_xlabel("Time [s]")
    return figure, [*panels.T.ravel()]


def finished(figure: Figure, t_s: FloatArray) -> Figure:
    """Style the axes of a figure over time, set the time limits to the range of ``t_s``, and add a legend below."""
    for axes in figure.axes:
        if axes.lines:
            style_axes(axes)
    if len(t_s) and t_s[0] < t_s[-1]:
        figure.axes[0].set_xlim(float(t_s[0]), float(t_s[-1]))
    figure.align_ylabels()
    legend_below(figure)
    return figure


def shade_outages(axes: Axes, outages_s: FloatArray, label: str | None = None) -> None:
    """Shade the outages. Only the first outage gets ``label``, so that the legend contains one entry."""
    for k, (begin, end) in enumerate(outages_s):
        axes.axvspan(begin, end, color=SHADE, alpha=0.28, linewidth=0, label=label if k == 0 else None, zorder=0)


def style_axes(axes: Axes) -> None:
    """Remove the frame of axes, draw a light grid behind the lines, and limit the number of ticks.

    The number of ticks does not depend on the height of the axes. Otherwise, ticks could change after the layout has
    measured the tick labels, and the new labels could be clipped.
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
    """Label the ticks of a logarithmic axis with decimal numbers (0.02) instead of powers.

    Axes of less than two decades have ticks at 1, 2 and 5 times each power of ten. Longer axes have ticks only at the
    powers of ten.
    """
    low, high = sorted(axis.get_view_interval())
    between = (1.0, 2.0, 5.0) if low > 0 and high < 100 * low else (1.0,)
    narrow = low > 0 and high < 4 * low  # it contains at most one power of ten
    axis.set_major_locator(MaxNLocator(4, steps=STEPS) if narrow else LogLocator(subs=between, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def literal(text: str) -> str:
    """Return a name in which ``$`` is escaped, because Matplotlib would start a formula at ``$``."""
    return text.replace("$", r"\$")


def legend_below(figure: Figure) -> None:
    """Add a legend below the axes and increase the height of the figure.

    Longer labels reduce the number of legend columns.
    """
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


def say(axes: Axes, message: str) -> None:
    """Draw the text ``message`` in the centre of axes that have no data."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color("#CCCCCC")
    axes.text(0.5, 0.5, message, transform=axes.transAxes, ha="center", va="center", color="#555555")


COLOURS_OF_A_FILE = 128
"""Number of colours of a PNG file. It is enough for lines and areas, and reduces the file size to a third."""


def save_figure(figure: Figure, path: Path) -> None:
    """Write ``figure`` to ``path`` atomically. The file extension (png, pdf or svg) determines the format."""
    write_atomically(path, figure.savefig)


def image_of(figure: Figure) -> "Image":
    """Return ``figure`` as an image with a limited number of colours."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]  # matplotlib's
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    image = Image.fromarray(pixels).convert("RGB")
    return image.quantize(COLOURS_OF_A_FILE, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)


# In all figures and on the page, the filter defines the colour of a method, and the adaptation its line style.

COLOURS = (*OKABE_ITO, "#332288", "#882255", "#117733", "#999933", "#661100", "#44AA99")
"""Colours of filters: the palette of Okabe and Ito, then darker colours of Paul Tol's muted palette (2021)."""

DASHES = ((), (8, 4), (2, 3), (10, 3, 2, 3), (4, 2), (1, 2))
"""Line styles of adaptations: lengths of dashes and gaps on the page [pixels]. The first style is a solid line."""

HATCHES = ("", "////", "....", "xxxx", "----", "\\\\\\\\")
"""Hatches of adaptations in bars, in the order of `DASHES`."""

NO_ADAPTATION = "none"
"""Name of the adaptation that always has the solid line."""

_POINTS = 0.5
"""Factor from a dash length on the page [pixels] to a dash length in a figure [line widths]."""

BETWEEN = re.compile(r", *(?![^()]*\))")
"""Matches a comma outside of parentheses, and the spaces after it."""

DrawnMethod = tuple[str, str]
"""The labels of the filter and the adaptation of a method."""


class MethodStyle(NamedTuple):
    """The style of a method in figures.

    Attributes:
        colour: colour that represents the filter.
        dash: lengths of the dashes and gaps of the line that represents the adaptation on the page [pixels], empty for
            a solid line.
        hatch: hatch that represents the adaptation in bars.
    """

    colour: str
    dash: tuple[int, ...]
    hatch: str

    @property
    def stroke(self) -> dict[str, Any]:
        """The colour and the line style as keyword arguments for `Axes.plot` of Matplotlib."""
        dashes = (0.0, tuple(_POINTS * length for length in self.dash)) if self.dash else "-"
        return {"color": self.colour, "linestyle": dashes}


class Palette(NamedTuple):
    """The assignment of colours to filters, and of line styles to adaptations, in a study.

    Attributes:
        filters: labels of the filters, in the order of `COLOURS`.
        adaptations: labels of the adaptations, in the order of `DASHES` and `HATCHES`.
    """

    filters: tuple[str, ...]
    adaptations: tuple[str, ...]

    @classmethod
    def of(cls, methods: Iterable[DrawnMethod]) -> "Palette":
        """Return the palette for ``methods``.

        The filters get colours in the given order. The adaptation "none" gets the first line style.
        """
        methods = list(methods)
        adaptations = dict.fromkeys(adaptation for _, adaptation in methods)
        filters = tuple(dict.fromkeys(filter_name for filter_name, _ in methods))
        return cls(filters, tuple(sorted(adaptations, key=lambda name: name != NO_ADAPTATION)))

    def style(self, method: DrawnMethod) -> MethodStyle:
        """Return the style of a method.

        A filter or adaptation that is not in the palette gets the style after the last assigned style.
        """
        filter_name, adaptation = method
        dash = _index(self.adaptations, adaptation) % len(DASHES)
        return MethodStyle(COLOURS[_index(self.filters, filter_name) % len(COLOURS)], DASHES[dash], HATCHES[dash])


def method_of(name: str) -> DrawnMethod:
    """Return the filter and the adaptation in the name of a method.

    >>> method_of("jerk(a=1, b=2) + mtf, accel_mps2=0.1")
    ('jerk(a=1, b=2)', 'mtf')
    >>> method_of("gnss_only")
    ('gnss_only', 'none')
    """
    filter_name, _, rest = name.partition(" + ")
    return filter_name, BETWEEN.split(rest.partition(" + ")[0])[0] or NO_ADAPTATION


def method_styles(names: Iterable[str], palette: Palette | None = None) -> Iterator[tuple[str, MethodStyle]]:
    """Yield the name and the style of each method. Without a palette, the order of the names defines the styles."""
    names = list(names)
    palette = palette or Palette.of(map(method_of, names))
    return ((name, palette.style(method_of(name))) for name in names)


def _index(labels: tuple[str, ...], label: str) -> int:
    return labels.index(label) if label in labels else len(labels)


def with_gaps(t_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times and values with NaN inserted where a gap is longer than three times the median time step."""
    steps = np.diff(t_s)
    places = np.flatnonzero(steps > 3.0 * np.median(steps)) + 1 if len(steps) else np.empty(0, dtype=int)
    return np.insert(t_s, places, t_s[places - 1]), np.insert(values, places, np.nan)
