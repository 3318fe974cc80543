"""The figure of performance profiles over scenarios."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.profiles import mean_ranks, performance_profile
from jerkbench.report.plots.style import DOTS_PER_INCH, legend_below, lines, quiet

FURTHEST = 100.0
SHOWN = 8
"""As many methods are drawn, by their mean rank."""


def profile_figure(costs: FloatArray, methods: Sequence[str], title: str) -> Figure:
    """Draw for each method in how many of the scenarios (p, s) it is within a factor of the best.

    On the left: how often it is the best; far right: how often it comes through at all. Drawn are the best by rank.
    """
    figure = Figure(figsize=(7.0, 3.6), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    factors = np.geomspace(1.0, FURTHEST, 400)
    shares, ranks = performance_profile(costs, factors), mean_ranks(costs)
    order = np.argsort(ranks, kind="stable")[:SHOWN]
    labels = [f"{methods[s]} (mean rank {ranks[s]:.1f})" for s in order]
    for (label, colour, dash), s in zip(lines(labels), order, strict=True):
        axes.step(factors, 100 * shares[s], where="post", color=colour, linestyle=dash, linewidth=1.3, label=label)
    axes.set(xscale="log", xlim=(1.0, FURTHEST), ylim=(0.0, 103.0), title=title)
    axes.set_xlabel(f"Times the best of a scenario ({len(costs)} scenarios)")
    axes.set_ylabel("Scenarios within [%]")
    quiet(axes)
    axes.set_xticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
    legend_below(figure)
    return figure
