"""The figure of performance profiles over scenarios."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.profiles import mean_ranks, performance_profile
from jerkbench.report.plots.curves import coinciding, joined
from jerkbench.report.plots.palette import Look
from jerkbench.report.plots.style import DOTS_PER_INCH, legend_below, literal, quiet

FURTHEST = 100.0
SHOWN = 8
"""As many methods are drawn, by their mean rank."""


def profile_figure(costs: FloatArray, methods: Sequence[str], title: str, looks_of: Sequence[Look]) -> Figure:
    """Draw for each method in how many of the scenarios (p, s) it is within a factor of the best.

    On the left: how often it is the best; far right: how often it comes through at all. Drawn are the best by rank,
    each with its look.
    """
    figure = Figure(figsize=(7.0, 3.6), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    factors = np.geomspace(1.0, FURTHEST, 400)
    shares, ranks = performance_profile(costs, factors), mean_ranks(costs)
    order = np.argsort(ranks, kind="stable")[:SHOWN]
    for names in coinciding({methods[s]: shares[s] for s in order}):
        s = methods.index(names[0])
        label = joined(f"{name} (mean rank {ranks[methods.index(name)]:.1f})" for name in names)
        look = looks_of[s]
        axes.step(
            factors, 100 * shares[s], where="post", color=look.colour, linestyle=look.line, linewidth=1.3, label=label
        )
    axes.set(xscale="log", xlim=(1.0, FURTHEST), ylim=(0.0, 103.0), title=literal(title))
    axes.set_xlabel(f"Times the best of a scenario ({len(costs)} scenarios)")
    axes.set_ylabel("Scenarios within [%]")
    quiet(axes)
    axes.set_xticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
    legend_below(figure)
    return figure
