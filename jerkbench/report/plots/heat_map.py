"""The figure of scenarios by methods: what is best where, and by how much the others miss it."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.report.style import DOTS_PER_INCH
from jerkbench.report.table import number

WORST = 100.0
"""The colour goes no further than so many times the best."""


def heat_map_figure(costs: FloatArray, scenarios: Sequence[str], methods: Sequence[str], title: str) -> Figure:
    """Draw (p, s) costs of s methods in p scenarios: each number as it is, its colour by the ratio to the row's best.

    An infinite cost says that runs were lost; NaN, that it was not run, is an empty field.
    """
    longest = max(map(len, [*scenarios, ""]))
    size = (
        1.2 + 0.075 * longest + 0.62 * len(methods),
        1.5 + 0.085 * max(map(len, [*methods, ""])) + 0.26 * len(scenarios),
    )
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    filled = np.where(np.isfinite(costs), costs, np.inf)
    best = filled.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(np.isfinite(costs), costs / best, np.nan)
    image = axes.imshow(np.clip(ratio, 1.0, WORST), cmap="cividis_r", norm=LogNorm(1.0, WORST), aspect="auto")
    for p, s in np.argwhere(np.isfinite(costs)):
        dark = ratio[p, s] > 10
        weight = "bold" if ratio[p, s] <= 1.0 else "normal"
        colour = "white" if dark else "black"
        axes.text(s, p, number(float(costs[p, s])), ha="center", va="center", fontsize=6, color=colour, weight=weight)
    for p, s in np.argwhere(np.isinf(costs)):
        axes.text(s, p, "lost", ha="center", va="center", fontsize=6, color="#555555")
    axes.set_xticks(range(len(methods)), methods, rotation=90, fontsize=7)
    axes.set_yticks(range(len(scenarios)), scenarios, fontsize=7)
    axes.set_title(title, fontsize="medium")
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    bar = figure.colorbar(image, ax=axes, ticks=[1, 2, 5, 10, 20, 50, 100], format="%g")
    bar.set_label("Times the best of the row" + (f" (up to {WORST:g})" if math.isfinite(WORST) else ""), fontsize=8)
    return figure
