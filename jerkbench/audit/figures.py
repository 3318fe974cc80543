"""The picture of an audit: methods by kinds of faults, and beside it the ratio over all drives with its interval."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.plots.style import DOTS_PER_INCH, OKABE_ITO

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FARTHEST = 5.0
"""The colour goes no further than five times better or worse."""
DARK = 2.5
"""From this ratio on, or its inverse, the field is so dark that its number is white."""
TICKS = (0.25, 0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0, 4.0)
ROW_IN, COLUMN_IN = 0.19, 0.44


def kinds_figure(kinds: pd.DataFrame, overall: pd.DataFrame, margin: float) -> Figure:
    """Draw ratios to the plain filter, tuned alike: blue is better, red is worse, bold is shown.

    Args:
        kinds: name, kind, ratio, verdict.
        overall: name, own_ratio, own_low, own_high, best_ratio, best_low, best_high; a row each, in this order.
        margin: what lies within 1 + margin is equal.
    """
    names, columns = list(overall["name"]), list(dict.fromkeys(kinds["kind"]))
    size = (4.6 + COLUMN_IN * max(len(columns), 4), 1.5 + ROW_IN * max(len(names), 6))
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[COLUMN_IN * max(len(columns), 4), 2.4], sharey=True)
    _draw_kinds(figure, left, kinds, names, columns)
    _draw_overall(right, overall, margin)
    return figure


def _draw_kinds(figure: Figure, axes: "Axes", kinds: pd.DataFrame, names: list[str], columns: list[str]) -> None:
    table = kinds.pivot_table(index="name", columns="kind", values="ratio").reindex(index=names, columns=columns)
    shown = set(kinds.loc[kinds["verdict"] != Verdict.UNDECIDED, ["name", "kind"]].itertuples(index=False, name=None))
    scale = LogNorm(1 / FARTHEST, FARTHEST, clip=True)
    image = axes.imshow(table.to_numpy(dtype=float), cmap="RdBu_r", norm=scale, aspect="auto")
    for row, name in enumerate(names):
        for column, kind in enumerate(columns):
            ratio, bold = float(table.loc[name, kind]), (name, kind) in shown  # type: ignore[arg-type]
            ink = "black" if bold else "0.35"
            style: dict[str, Any] = {
                "weight": "bold" if bold else "normal",
                "color": ink if 1 / DARK < ratio < DARK else "white",
            }
            axes.text(column, row, f"{ratio:.2f}", ha="center", va="center", fontsize=6, **style)
    axes.set_xticks(range(len(columns)), [kind.replace("_", " ") for kind in columns], rotation=90, fontsize=7)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    ticks = [0.2, 0.5, 1, 2, 5]
    bar = figure.colorbar(image, ax=axes, ticks=ticks, format="%g", location="bottom", shrink=0.5, aspect=40)
    bar.minorticks_off()
    bar.ax.tick_params(labelsize=7)
    bar.set_label("error / that of the plain filter of its model, tuned alike; bold: shown", fontsize=7)


def _draw_overall(axes: "Axes", overall: pd.DataFrame, margin: float) -> None:
    rows = np.arange(len(overall))
    axes.axvspan(1 / (1 + margin), 1 + margin, color="0.9", linewidth=0)
    axes.axvline(1.0, color="0.6", linewidth=0.8)
    for against, colour, shift in (("own", OKABE_ITO[0], -0.17), ("best", OKABE_ITO[1], 0.17)):
        label = {"own": "plain filter of its model", "best": "best plain filter"}[against]
        ends = overall[f"{against}_low"], overall[f"{against}_high"]
        axes.hlines(rows + shift, *ends, color=colour, linewidth=1.2)
        axes.plot(overall[f"{against}_ratio"], rows + shift, "o", color=colour, markersize=3, label=label)
    axes.set_xscale("log")
    low, high = _limits(overall)
    axes.set_xlim(low, high)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks([tick for tick in TICKS if low < tick < high])
    axes.tick_params(axis="x", labelsize=7)
    axes.tick_params(axis="y", length=0, labelleft=False)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.set_xlabel("over all drives, relative to", fontsize=7)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), fontsize=7, frameon=False, borderaxespad=4.0)


def _limits(overall: pd.DataFrame) -> tuple[float, float]:
    """The span of all intervals, as far as the ratios themselves and five times about 1."""
    low, high = overall[["own_low", "best_low"]].min().min(), overall[["own_high", "best_high"]].max().max()
    return max(float(low), 1 / FARTHEST) / 1.05, min(float(high), FARTHEST) * 1.05
