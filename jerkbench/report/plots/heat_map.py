"""The figure of methods by scenarios: what is best where, and by how much the others miss it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.report.plots.style import DOTS_PER_INCH, literal
from jerkbench.report.tables.table_model import number

WORST = 100.0
"""The colour goes no further than so many times the best."""


def heat_map_figure(
    costs: FloatArray,
    scenarios: Sequence[str],
    methods: Sequence[str],
    title: str,
    competing: Sequence[bool],
    lost: Sequence[Sequence[str]],
) -> Figure:
    """Draw (p, s) costs of s methods in p scenarios: each number as it is, its colour by the ratio to the best.

    Methods make the rows, scenarios the columns.
    Where a cost is infinite, runs were lost: there stands how many, as ``lost`` says it. NaN, that it was not run, is
    an empty field. What does not compete is there, in parentheses, but is no best.
    """
    size = (
        2.2 + 0.085 * _longest(methods) + 0.56 * len(scenarios),
        1.3 + 0.085 * _longest(scenarios) + 0.24 * len(methods),
    )
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    best = np.where(np.isfinite(costs) & np.asarray(competing), costs, np.inf).min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(np.isfinite(costs), costs / best, np.nan)
    image = axes.imshow(np.clip(ratio, 1.0, WORST).T, cmap="cividis_r", norm=LogNorm(1.0, WORST), aspect="auto")
    for p, s in np.argwhere(np.isfinite(costs)):
        leads = competing[s] and costs[p, s] == best[p]
        colour, weight = "white" if ratio[p, s] > 10 else "black", "bold" if leads else "normal"
        axes.text(p, s, number(float(costs[p, s])), ha="center", va="center", fontsize=7, color=colour, weight=weight)
    for p, s in np.argwhere(np.isinf(costs)):
        axes.text(p, s, lost[p][s], ha="center", va="center", fontsize=7, color="#777777")
    axes.set_xticks(range(len(scenarios)), map(literal, scenarios), rotation=90, fontsize=8)
    named = [name if competes else f"({name})" for name, competes in zip(methods, competing, strict=True)]
    axes.set_yticks(range(len(methods)), map(literal, named), fontsize=8)
    axes.set_title(literal(title), fontsize="medium")
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    bar = figure.colorbar(image, ax=axes, ticks=[1, 2, 5, 10, 20, 50, 100], format="%g")
    bar.set_label(f"Times the best of the scenario (up to {WORST:g})", fontsize=8)
    return figure


def _longest(names: Sequence[str]) -> int:
    return max(map(len, [*names, ""]))
