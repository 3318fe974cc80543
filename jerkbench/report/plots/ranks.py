"""Figures of methods over scenarios: performance profiles, mean ranks with the critical difference."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.statistics.ranks import mean_ranks, performance_profile, rank_cliques
from jerkbench.report.plots.curves import coinciding, joined
from jerkbench.report.plots.palette import Look
from jerkbench.report.plots.style import REFERENCE, legend_below, literal, new_figure, quiet

FURTHEST = 100.0
PROFILES = 8
"""As many methods are drawn, by their mean rank."""


def profile_figure(costs: FloatArray, methods: Sequence[str], title: str, looks_of: Sequence[Look]) -> Figure:
    """Draw for each method in how many of the scenarios (p, s) it is within a factor of the best.

    On the left: how often it is the best; far right: how often it comes through at all. Drawn are the best by rank,
    each with its look.
    """
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    factors = np.geomspace(1.0, FURTHEST, 400)
    shares, ranks = performance_profile(costs, factors), mean_ranks(costs)
    order = np.argsort(ranks, kind="stable")[:PROFILES]
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


RANKED = 24
"""As many methods are drawn, the best by mean rank."""

ROW_IN = 0.24
STRIP = 0.028
"""Width that a group's line takes beside the ranks, of that of the axes."""


def critical_difference_figure(
    ranks: FloatArray, least: float, methods: Sequence[str], looks_of: Sequence[Look], title: str, scenarios: int
) -> Figure:
    """Draw the mean rank (k,) of each method; those that a line on the right joins do not differ.

    Args:
        ranks: mean ranks over the scenarios, 1 the best.
        least: the critical difference.
        methods: their names.
        looks_of: how each is drawn; the marker has the filter's colour, and is hollow with an adaptation.
        title: of the metric.
        scenarios: how many.
    """
    order = np.argsort(ranks, kind="stable")[:RANKED]
    figure = new_figure(1.5 + ROW_IN * len(order))
    axes = figure.add_subplot()
    for row, k in enumerate(order):
        axes.plot([0, ranks[k]], [row, row], color="#D0D0D0", linewidth=0.8, zorder=1)
        face = looks_of[k].colour if not looks_of[k].dash else "white"
        axes.plot(ranks[k], row, "o", color=looks_of[k].colour, markerfacecolor=face, markersize=5.0, zorder=2)
    axes.set_yticks(range(len(order)), [f"{literal(methods[k])}  {ranks[k]:.1f}" for k in order])
    right = max(float(ranks[order[-1]]), 1.0 + least) + 0.25
    axes.set(xlim=(0.75, right), ylim=(len(order) - 0.4, -1.9), title=literal(title))
    axes.set_xlabel(f"Mean rank over {scenarios} scenarios, 1 the best{_others(len(ranks) - len(order))}")
    quiet(axes)
    axes.grid(visible=False, axis="y")
    axes.set_yticks(range(len(order)), [f"{literal(methods[k])}  {ranks[k]:.1f}" for k in order])
    _draw_difference(axes, least)
    _draw_groups(axes, rank_cliques(ranks, least), order)
    return figure


def _others(left_out: int) -> str:
    return f"; {left_out} worse ones are not drawn" if left_out else ""


def _draw_difference(axes: Axes, least: float) -> None:
    """Draw the critical difference to scale."""
    axes.errorbar([1 + least / 2], [-1.0], xerr=least / 2, color=REFERENCE, capsize=3.0, linewidth=1.2)
    axes.text(1.0, -1.25, f"critical difference {least:.1f} (Nemenyi, 5 %)", fontsize="small", va="bottom")


def _draw_groups(axes: Axes, groups: Sequence[IntArray], order: IntArray) -> None:
    """Draw a line for each group beside the ranks, as far left as others leave room."""
    place_of = {int(method): row for row, method in enumerate(order)}
    ends: list[int] = []
    for group in groups:
        rows = [place_of[int(k)] for k in group if int(k) in place_of]
        if len(rows) < 2:
            continue
        lane = next((lane for lane, end in enumerate(ends) if end < rows[0]), len(ends))
        ends[lane : lane + 1] = [rows[-1]]
        x = 1.02 + STRIP * lane
        axes.plot(
            [x, x],
            [rows[0] - 0.3, rows[-1] + 0.3],
            transform=axes.get_yaxis_transform(),
            color=REFERENCE,
            linewidth=2.2,
            solid_capstyle="butt",
            clip_on=False,
        )
