"""The figure of a search: the profile of each parameter, the map of two of them, the budget's curve."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.report.plots.style import OKABE_ITO, literal, new_figure, quiet

COLUMNS = 3


class Profile(NamedTuple):
    """The trials seen along one parameter.

    Attributes:
        name: the parameter.
        values: (n,) its value in each trial.
        middles: (b,) middles of parts of its range.
        least: (b,) least loss of a trial in each part; NaN: none is there.
        chosen: its value in the chosen setting.
        log: whether its range is logarithmic.
    """

    name: str
    values: FloatArray
    middles: FloatArray
    least: FloatArray
    chosen: float
    log: bool


class Map(NamedTuple):
    """The least loss over two parameters.

    Attributes:
        first: name of that of the rows.
        second: name of that of the columns.
        least: (b, b) NaN: no trial is there.
        chosen: (2,) share of the way through both ranges of the chosen setting.
    """

    first: str
    second: str
    least: FloatArray
    chosen: tuple[float, float]


def search_figure(
    profiles: Sequence[Profile], losses: FloatArray, most: Map | None, curve: Sequence[tuple[int, float]], title: str
) -> Figure:
    """Draw one panel for each parameter with the losses (n,) of all trials, the map, and the curve of the budget."""
    count = len(profiles) + (most is not None) + 1
    rows = -(-count // COLUMNS)
    figure = new_figure(2.7 * rows, 3.3 * min(count, COLUMNS))
    axes = list(np.ravel(figure.subplots(rows, min(count, COLUMNS), squeeze=False)))
    for panel, profile in zip(axes, profiles, strict=False):
        _draw_profile(panel, profile, losses)
    _draw_curve(axes[len(profiles)], curve)
    if most is not None:
        _draw_map(figure, axes[len(profiles) + 1], most)
    for panel in axes[count:]:
        panel.set_axis_off()
    figure.suptitle(literal(title), fontsize="medium")
    return figure


def _draw_profile(axes: Axes, profile: Profile, losses: FloatArray) -> None:
    known = np.isfinite(profile.least)
    axes.plot(profile.values, losses, ".", color="#B0B0B0", markersize=3.0)
    axes.plot(profile.middles[known], profile.least[known], "-o", color=OKABE_ITO[0], markersize=3.0, linewidth=1.2)
    axes.axvline(profile.chosen, color=OKABE_ITO[1], linewidth=1.0, linestyle="--")
    if profile.log:
        axes.set_xscale("log")
    axes.set_xlabel(profile.name, fontsize=8)
    axes.set_ylabel("loss", fontsize=8)
    low = float(losses.min())
    axes.set_ylim(low - 0.05, low + 1.5 * max(float(np.nanmax(profile.least)) - low, 0.1))
    quiet(axes)


def _draw_curve(axes: Axes, curve: Sequence[tuple[int, float]]) -> None:
    sizes, best = zip(*curve, strict=True)
    axes.plot(sizes, best, "-o", color=OKABE_ITO[2], markersize=3.0, linewidth=1.2)
    axes.set_xscale("log", base=4)
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.set_xlabel("settings tried", fontsize=8)
    axes.set_ylabel("least loss", fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(visible=True, color="#E4E4E4", linewidth=0.6)


def _draw_map(figure: Figure, axes: Axes, most: Map) -> None:
    image = axes.imshow(most.least, origin="lower", extent=(0.0, 1.0, 0.0, 1.0), aspect="auto", cmap="cividis")
    axes.plot(most.chosen[1], most.chosen[0], "x", color="white", markersize=7.0)
    axes.set_xlabel(f"{most.second}, low to high", fontsize=8)
    axes.set_ylabel(f"{most.first}, low to high", fontsize=8)
    axes.set(xticks=[], yticks=[])
    figure.colorbar(image, ax=axes).set_label("least loss", fontsize=8)
