"""Figures over a parameter: process noise, size of a fault, and the parameters of a search."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.over_seeds import Samples, mean_intervals
from jerkbench.report.columns import quantity
from jerkbench.report.plots.style import (
    OKABE_ITO,
    MethodStyle,
    Palette,
    legend_below,
    literal,
    method_styles,
    new_figure,
    style_axes,
)
from jerkbench.report.sweeps import NAME, SCENARIO, SIZE, crossings, smallest_noticed

if TYPE_CHECKING:
    import pandas as pd


_SIGMA = re.compile(r"(?:^|[ (,])accel_mps2=([0-9.eE+-]+)")

_FIRST, _STEP = 0.03, 0.04
"""Heights of the triangles, from the axis upwards: several methods may act at the same size."""


def sensitivity_figure(rows: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` over sigma_a [m/s2] with its interval, a panel for each disturbance and data set.

    Runs that diverged or failed are left out of a mean, and make its point hollow.
    """
    swept = with_noise_sigma(rows)
    swept["scene"] = swept["dataset"].astype(str) + ": " + swept["disturbance"].astype(str)
    figure, panels, look_of = _panels_of(swept, "scene", metric, palette, 2.6, sharex=True)
    for axes, scene in panels.items():
        for name, look in look_of.items():
            runs = scene[scene["method"] == name]
            sizes = np.sort(runs["sigma_a"].unique())
            _draw_means(axes, runs, "sigma_a", sizes, metric, look, name, figure.axes[0])
        axes.set_xscale("log")
        style_axes(axes)
    figure.axes[-1].set_xlabel("sigma_a [m/s$^2$]")
    legend_below(figure)
    return figure


def with_noise_sigma(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return the rows whose noise label says sigma_a, with the column ``sigma_a``."""
    sigma_a = rows["noise"].astype(str).str.extract(_SIGMA.pattern)[0].astype(float)
    return rows.assign(sigma_a=sigma_a)[sigma_a.notna()].copy()


def severity_figure(swept: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` over the size of a fault with its interval, a panel for each scenario.

    Runs that diverged or failed are left out of a mean, and make its point hollow. A cross marks where two methods are
    equally good, a triangle near the axis the smallest fault that a method's adaptation acts on.

    Args:
        swept: rows as `jerkbench.report.sweeps.with_severity` returns them.
        metric: the metric's column.
        palette: of the study.
    """
    figure, panels, look_of = _panels_of(swept.copy(), SCENARIO, metric, palette, 2.8)
    for axes, scene in panels.items():
        sizes, means = np.sort(scene[SIZE].unique()), dict[str, FloatArray]()
        for height, (name, look) in zip(_FIRST + _STEP * np.arange(len(look_of)), look_of.items(), strict=True):
            runs = scene[scene["method"] == name]
            means[name] = _draw_means(axes, runs, SIZE, sizes, metric, look, name, figure.axes[0])
            noticed = smallest_noticed(runs) if len(runs) else float("nan")
            axes.plot([noticed], [height], "^", color=look.colour, transform=axes.get_xaxis_transform())
        for crossing in crossings(sizes, means):
            axes.plot([crossing.size], [crossing.cost], "x", color="black", markersize=5.0)
        axes.set_xlabel(literal(scene[NAME].iloc[0]))
        if scene[SIZE].min() > 0:
            axes.set_xscale("log")
        style_axes(axes)
    legend_below(figure)
    return figure


def _panels_of(
    swept: "pd.DataFrame", scene: str, metric: str, palette: Palette | None, height_in: float, *, sharex: bool = False
) -> tuple[Figure, "dict[Axes, pd.DataFrame]", dict[str, MethodStyle]]:
    """Return a figure, its panels with the rows of each value of the column ``scene``, and the look of each method."""
    swept["method"] = swept["filter"].astype(str) + " + " + swept["adaptation"].astype(str)
    scenes = {str(name): group for name, group in swept.groupby(scene, sort=False)}
    figure = new_figure(0.6 + height_in * len(scenes))
    panels = figure.subplots(len(scenes), 1, sharex=sharex, squeeze=False)[:, 0]
    for axes, name in zip(panels, scenes, strict=True):
        axes.set(title=literal(name), ylabel=literal(quantity(metric).heading), yscale="log")
    looks = dict(method_styles(swept["method"].unique(), palette))
    return figure, dict(zip(panels, scenes.values(), strict=True)), looks


def _draw_means(
    axes: Axes, runs: "pd.DataFrame", over: str, at: FloatArray, metric: str, look: MethodStyle, name: str, first: Axes
) -> FloatArray:
    """Draw and return a method's means at some values of the column ``over``; the ``first`` panel has its label."""
    groups = [runs[runs[over] == x] for x in at]
    good = [group.loc[group["status"] == "ok", metric] for group in groups]
    means, *ends = mean_intervals(Samples.of(good))
    label = name if axes is first else None
    axes.plot(at, means, **look.stroke, linewidth=1.0, label=label)
    for x, group, values, mean, low, high in zip(at, groups, good, means, *ends, strict=True):
        axes.plot([x, x], [low, high], color=look.colour, linewidth=0.8)
        face = look.colour if len(values) == len(group) else "white"
        axes.plot([x], [mean], "o", color=look.colour, markerfacecolor=face, markersize=4.0)
    return means


# The figure of a search: the profile of each parameter, the map of two of them, the budget's curve.

_COLUMNS = 3


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
    rows = -(-count // _COLUMNS)
    figure = new_figure(2.7 * rows, 3.3 * min(count, _COLUMNS))
    axes = list(np.ravel(figure.subplots(rows, min(count, _COLUMNS), squeeze=False)))
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
    style_axes(axes)


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
