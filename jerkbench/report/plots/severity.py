"""The figure of a metric over the size of a fault."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals.signed_over_seeds import mean_intervals
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.severity import NAME, SCENARIO, SIZE, crossings, smallest_noticed
from jerkbench.report.plots.palette import Look, Palette, looks
from jerkbench.report.plots.style import DOTS_PER_INCH, legend_below, literal, quiet

if TYPE_CHECKING:
    import pandas as pd


FIRST, STEP = 0.03, 0.04
"""Heights of the triangles, from the axis upwards: several methods may act at the same size."""


def severity_figure(swept: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` over the size of a fault with its interval, a panel for each scenario.

    Runs that diverged or failed are left out of a mean, and make its point hollow. A cross stands where two methods are
    equally good, a triangle near the axis at the smallest fault that a method's adaptation acts on.

    Args:
        swept: rows as `with_severity` returns them.
        metric: the metric's column.
        palette: of the study.
    """
    scenarios = list(dict.fromkeys(swept[SCENARIO]))
    figure = Figure(figsize=(7.0, 0.6 + 2.8 * len(scenarios)), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplots(len(scenarios), 1, squeeze=False)[:, 0]
    swept = swept.assign(method=swept["filter"].astype(str) + " + " + swept["adaptation"].astype(str))
    names = list(dict.fromkeys(swept["method"]))
    for axes, scenario in zip(panels, scenarios, strict=True):
        scene = swept[swept[SCENARIO] == scenario]
        _draw(axes, scene, dict(looks(names, palette)), metric, labelled=axes is panels[0])
        axes.set(
            title=literal(scenario),
            xlabel=literal(scene[NAME].iloc[0]),
            ylabel=literal(quantity(metric).heading),
            yscale="log",
        )
        if scene[SIZE].min() > 0:
            axes.set_xscale("log")
        quiet(axes)
    legend_below(figure)
    return figure


def _draw(axes: Axes, scene: "pd.DataFrame", look_of: Mapping[str, Look], metric: str, *, labelled: bool) -> None:
    sizes = np.sort(scene[SIZE].unique())
    means: dict[str, FloatArray] = {}
    for height, (name, look) in zip(FIRST + STEP * np.arange(len(look_of)), look_of.items(), strict=True):
        colour, dash = look.colour, look.line
        runs = scene[scene["method"] == name]
        groups = [runs[runs[SIZE] == size] for size in sizes]
        good = [group.loc[group["status"] == "ok", metric] for group in groups]
        intervals = mean_intervals(good)
        means[name] = np.array([interval.mean for interval in intervals])
        label = name if labelled else None
        axes.plot(sizes, means[name], color=colour, linestyle=dash, linewidth=1.0, label=label)
        for size, group, values, interval in zip(sizes, groups, good, intervals, strict=True):
            axes.plot([size, size], [interval.low, interval.high], color=colour, linewidth=0.8)
            face = colour if len(values) == len(group) else "white"
            axes.plot([size], [interval.mean], "o", color=colour, markerfacecolor=face, markersize=4.0)
        noticed = smallest_noticed(runs) if len(runs) else float("nan")
        axes.plot([noticed], [height], "^", color=colour, transform=axes.get_xaxis_transform())
    for crossing in crossings(sizes, means):
        axes.plot([crossing.size], [crossing.cost], "x", color="black", markersize=5.0)
