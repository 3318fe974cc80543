"""The figure of a metric over the process noise."""

import re
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from jerkbench.evaluation.statistics.intervals.signed_over_seeds import mean_intervals
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import DOTS_PER_INCH, legend_below, literal, quiet

if TYPE_CHECKING:
    import pandas as pd

SIGMA = re.compile(r"(?:^|[ (,])accel_mps2=([0-9.eE+-]+)")


def sensitivity_figure(rows: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` over sigma_a [m/s2] with its interval, a panel for each disturbance and data set.

    Runs that diverged or failed are left out of a mean, and make its point hollow.
    """
    swept = with_sigma(rows)
    scenarios = list(dict.fromkeys(zip(swept["dataset"], swept["disturbance"], strict=True)))
    figure = Figure(figsize=(7.0, 0.6 + 2.6 * len(scenarios)), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplots(len(scenarios), 1, sharex=True, squeeze=False)[:, 0]
    swept["method"] = swept["filter"] + " + " + swept["adaptation"]
    names = list(dict.fromkeys(swept["method"]))
    for axes, (dataset, disturbance) in zip(panels, scenarios, strict=True):
        scene = swept[(swept["dataset"] == dataset) & (swept["disturbance"] == disturbance)]
        for name, look in looks(names, palette):
            colour, dash = look.colour, look.line
            groups = [(x, group) for x, group in scene[scene["method"] == name].groupby("sigma_a")]
            good = [group.loc[group["status"] == "ok", metric] for _, group in groups]
            for (x, group), values, interval in zip(groups, good, mean_intervals(good), strict=True):
                axes.plot([x, x], [interval.low, interval.high], color=colour, linewidth=0.8)
                face = colour if len(values) == len(group) else "white"
                axes.plot([x], [interval.mean], "o", color=colour, markerfacecolor=face, markersize=4.0)
            means = [interval.mean for interval in mean_intervals(good)]
            label = name if axes is panels[0] else None
            axes.plot([x for x, _ in groups], means, color=colour, linestyle=dash, linewidth=1.0, label=label)
        axes.set(
            title=literal(f"{dataset}: {disturbance}"),
            ylabel=literal(quantity(metric).heading),
            xscale="log",
            yscale="log",
        )
        quiet(axes)
    panels[-1].set_xlabel("sigma_a [m/s$^2$]")
    legend_below(figure)
    return figure


def with_sigma(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return the rows whose noise label says sigma_a, with the column ``sigma_a``."""
    sigma_a = rows["noise"].astype(str).str.extract(SIGMA.pattern)[0].astype(float)
    return rows.assign(sigma_a=sigma_a)[sigma_a.notna()].copy()
