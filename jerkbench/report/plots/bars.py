"""The figure of a metric as bars with intervals (the paper's Fig. 3)."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.report.style import DOTS_PER_INCH, legend_below, lines, quiet
from jerkbench.report.table import Cell, Table, number

LOGARITHMIC_FROM = 30.0
"""The axis is logarithmic where the largest mean is so many times the smallest."""


def bars_figure(table: Table) -> Figure:
    """Draw a group of bars for each row of ``table`` and a colour for each column, with the interval of each mean.

    A combination that was not run, or of which no run went well, has no bar; of one that lost some runs it is hatched.
    """
    names = [" / ".join(column) or "mean" for column in table.columns]
    bars = sum(_there(cell) for row in table.cells for cell in row)
    size = (7.0, 1.2 + 0.11 * bars + 0.09 * len(table.rows))
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    colours = {name: colour for name, colour, _ in lines(names)}
    places, place = [], 0.0
    for row in table.cells:
        shown = [(name, cell) for name, cell in zip(names, row, strict=True) if cell is not None and _there(cell)]
        places.append(place + (len(shown) - 1) / 2)
        for name, cell in shown:
            _draw_bar(axes, place, cell, colours[name])
            place += 1.0
        place += 0.8
    for name, colour in colours.items():
        axes.barh([0], [np.nan], color=colour, label=name)
    axes.set_xlabel(table.title)
    means = [c.mean for row in table.cells for c in row if c is not None and math.isfinite(c.mean) and c.mean > 0]
    quiet(axes)
    axes.grid(visible=False, axis="y")
    if means and max(means) > LOGARITHMIC_FROM * min(means):
        axes.set_xscale("log")
        axes.set_xlim(left=0.5 * min(means), right=3.0 * max(means))
    else:
        axes.margins(x=0.15)
    axes.set_yticks(places, [", ".join(row) for row in table.rows], fontsize=7)
    axes.set_ylim(place - 0.5, -1.0)
    legend_below(figure)
    return figure


def _there(cell: Cell | None) -> bool:
    return cell is not None and math.isfinite(cell.mean)


def _draw_bar(axes: Axes, place: float, cell: Cell, colour: str) -> None:
    """Draw one bar with its interval, and its value behind it."""
    hatch = None if cell.complete else "////"
    axes.barh(place, cell.mean, 0.9, color=colour, hatch=hatch, edgecolor="white", linewidth=0.3)
    end = cell.mean
    if math.isfinite(cell.low):
        ends = np.array([[max(0.0, cell.mean - cell.low)], [max(0.0, cell.high - cell.mean)]])
        axes.errorbar([cell.mean], [place], xerr=ends, fmt="none", ecolor="black", elinewidth=0.8, capsize=1.5)
        end = max(cell.mean, cell.high)
    offset = {"xytext": (3, 0), "textcoords": "offset points"}
    axes.annotate(number(cell.mean), (end, place), va="center", fontsize=6, **offset)  # type: ignore[arg-type]  # as documented
