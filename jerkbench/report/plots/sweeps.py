"""Figures of a metric over what was swept: the process noise, or the size of a fault."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.over_seeds import mean_intervals
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.severity import NAME, SCENARIO, SIZE, crossings, smallest_noticed
from jerkbench.report.plots.palette import Look, Palette, looks
from jerkbench.report.plots.style import legend_below, literal, new_figure, quiet

if TYPE_CHECKING:
    import pandas as pd

SIGMA = re.compile(r"(?:^|[ (,])accel_mps2=([0-9.eE+-]+)")

FIRST, STEP = 0.03, 0.04
"""Heights of the triangles, from the axis upwards: several methods may act at the same size."""


def sensitivity_figure(rows: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` over sigma_a [m/s2] with its interval, a panel for each disturbance and data set.

    Runs that diverged or failed are left out of a mean, and make its point hollow.
    """
    swept = with_sigma(rows)
    swept["scene"] = swept["dataset"].astype(str) + ": " + swept["disturbance"].astype(str)
    scenes = list(swept["scene"].unique())
    figure = new_figure(0.6 + 2.6 * len(scenes))
    panels = figure.subplots(len(scenes), 1, sharex=True, squeeze=False)[:, 0]
    look_of = _looks(swept, palette)
    for axes, scene in zip(panels, scenes, strict=True):
        for name, look in look_of.items():
            runs = swept[(swept["scene"] == scene) & (swept["method"] == name)]
            _draw_means(axes, runs, "sigma_a", np.sort(runs["sigma_a"].unique()), metric, look, name, panels[0])
        axes.set(title=literal(scene), ylabel=literal(quantity(metric).heading), xscale="log", yscale="log")
        quiet(axes)
    panels[-1].set_xlabel("sigma_a [m/s$^2$]")
    legend_below(figure)
    return figure


def with_sigma(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return the rows whose noise label says sigma_a, with the column ``sigma_a``."""
    sigma_a = rows["noise"].astype(str).str.extract(SIGMA.pattern)[0].astype(float)
    return rows.assign(sigma_a=sigma_a)[sigma_a.notna()].copy()


def severity_figure(swept: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` over the size of a fault with its interval, a panel for each scenario.

    Runs that diverged or failed are left out of a mean, and make its point hollow. A cross stands where two methods are
    equally good, a triangle near the axis at the smallest fault that a method's adaptation acts on.

    Args:
        swept: rows as `with_severity` returns them.
        metric: the metric's column.
        palette: of the study.
    """
    scenarios = list(swept[SCENARIO].unique())
    figure = new_figure(0.6 + 2.8 * len(scenarios))
    panels = figure.subplots(len(scenarios), 1, squeeze=False)[:, 0]
    swept = swept.copy()
    look_of = _looks(swept, palette)
    for axes, scenario in zip(panels, scenarios, strict=True):
        scene = swept[swept[SCENARIO] == scenario]
        sizes, means = np.sort(scene[SIZE].unique()), dict[str, FloatArray]()
        for height, (name, look) in zip(FIRST + STEP * np.arange(len(look_of)), look_of.items(), strict=True):
            runs = scene[scene["method"] == name]
            means[name] = _draw_means(axes, runs, SIZE, sizes, metric, look, name, panels[0])
            noticed = smallest_noticed(runs) if len(runs) else float("nan")
            axes.plot([noticed], [height], "^", color=look.colour, transform=axes.get_xaxis_transform())
        for crossing in crossings(sizes, means):
            axes.plot([crossing.size], [crossing.cost], "x", color="black", markersize=5.0)
        heading = literal(quantity(metric).heading)
        axes.set(title=literal(scenario), xlabel=literal(scene[NAME].iloc[0]), ylabel=heading, yscale="log")
        if scene[SIZE].min() > 0:
            axes.set_xscale("log")
        quiet(axes)
    legend_below(figure)
    return figure


def _looks(swept: "pd.DataFrame", palette: Palette | None) -> Mapping[str, Look]:
    """Name the method of each row, and return the looks of all."""
    swept["method"] = swept["filter"].astype(str) + " + " + swept["adaptation"].astype(str)
    return dict(looks(swept["method"].unique(), palette))


def _draw_means(
    axes: Axes, runs: "pd.DataFrame", over: str, at: FloatArray, metric: str, look: Look, name: str, first: Axes
) -> FloatArray:
    """Draw and return a method's means at some values of the column ``over``; the ``first`` panel has its label."""
    groups = [runs[runs[over] == x] for x in at]
    good = [group.loc[group["status"] == "ok", metric] for group in groups]
    intervals = mean_intervals(good)
    means = np.array([interval.mean for interval in intervals])
    label = name if axes is first else None
    axes.plot(at, means, color=look.colour, linestyle=look.line, linewidth=1.0, label=label)
    for x, group, values, interval in zip(at, groups, good, intervals, strict=True):
        axes.plot([x, x], [interval.low, interval.high], color=look.colour, linewidth=0.8)
        face = look.colour if len(values) == len(group) else "white"
        axes.plot([x], [interval.mean], "o", color=look.colour, markerfacecolor=face, markersize=4.0)
    return means
