"""The figure of a metric as bars with intervals (the paper's Fig. 3)."""

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.report.plots.style import DOTS_PER_INCH, legend_below, lines, quiet
from jerkbench.report.tables.table_model import Cell, Table, number

LOGARITHMIC_FROM = 30.0
"""The axis is logarithmic where the largest mean is so many times the smallest."""

SCENARIO = ("dataset", "disturbance", "attitude")
"""Factors that get a panel each; the other rows of a table make groups of bars in it."""

NAMED = 8
"""Up to so many bars in a panel, each has its value on it."""

GAP = 0.8
"""Between two groups, in bars."""


def bars_figure(table: Table) -> Figure:
    """Draw a panel for each scenario of ``table``, in it a group for each of its rows, and a colour for each column.

    A combination that was not run, or of which no run went well, has no bar; of one that lost some runs it is hatched.
    """
    names = [" / ".join(column) or "mean" for column in table.columns]
    colours = {name: colour for name, colour, _ in lines(names)}
    scenes = _scenes(table, names)
    columns = 1 if len(scenes) == 1 else 2
    height = -(-len(scenes) // columns)
    figure = Figure(figsize=(7.0 if columns == 1 else 9.0, 0.9 + 2.0 * height), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplots(height, columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(scenes) :]:
        axes.set_axis_off()
    for axes, (scene, groups) in zip(panels, scenes.items(), strict=False):
        axes.set_title(scene, fontsize=8)
        _draw_groups(axes, groups, colours)
    for name, colour in colours.items():
        panels[0].bar([0], [np.nan], color=colour, label=name)
    _scale(panels[0], table)
    for axes in panels[: len(scenes)]:
        quiet(axes)
        axes.grid(visible=False, axis="x")
    figure.supylabel(table.title, fontsize=9)
    legend_below(figure)
    return figure


def _scenes(table: Table, names: list[str]) -> dict[str, dict[str, dict[str, Cell]]]:
    """Scenario -> label of the row -> name of the column -> cell."""
    scenes: dict[str, dict[str, dict[str, Cell]]] = {}
    for row, cells in zip(table.rows, table.cells, strict=True):
        named = dict(zip(table.row_keys, row, strict=True))
        scene = ", ".join(value for key, value in named.items() if key in SCENARIO)
        label = ", ".join(value for key, value in named.items() if key not in SCENARIO)
        there = {n: c for n, c in zip(names, cells, strict=True) if c is not None and math.isfinite(c.mean)}
        scenes.setdefault(scene, {})[label] = there
    return scenes


def _draw_groups(axes: Axes, groups: Mapping[str, Mapping[str, Cell]], colours: Mapping[str, str]) -> None:
    middles, place = [], 0.0
    named = sum(map(len, groups.values())) <= NAMED
    for cells in groups.values():
        middles.append(place + (max(len(cells), 1) - 1) / 2)
        for name, cell in cells.items():
            _draw_bar(axes, place, cell, colours[name], named=named)
            place += 1.0
        place += GAP if cells else 1.0 + GAP
    axes.set_xticks(middles, [label.replace("_", "\n", 1) for label in groups], fontsize=7)  # narrow groups
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.9, place - GAP - 0.1)


def _draw_bar(axes: Axes, place: float, cell: Cell, colour: str, *, named: bool) -> None:
    """Draw one bar with its interval, and its value on it."""
    hatch = None if cell.complete else "////"
    axes.bar(place, cell.mean, 0.9, color=colour, hatch=hatch, edgecolor="white", linewidth=0.3)
    end = cell.mean
    if math.isfinite(cell.low) and math.isfinite(cell.high):
        ends = np.array([[max(0.0, cell.mean - cell.low)], [max(0.0, cell.high - cell.mean)]])
        axes.errorbar([place], [cell.mean], yerr=ends, fmt="none", ecolor="black", elinewidth=0.8, capsize=1.5)
        end = max(cell.mean, cell.high)
    if named:
        offset = {"xytext": (0, 2), "textcoords": "offset points"}
        axes.annotate(number(cell.mean), (place, end), ha="center", fontsize=6, **offset)  # type: ignore[arg-type]  # as documented


def _scale(axes: Axes, table: Table) -> None:
    """Choose the scale that all panels share."""
    means = [c.mean for row in table.cells for c in row if c is not None and math.isfinite(c.mean) and c.mean > 0]
    if means and max(means) > LOGARITHMIC_FROM * min(means):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5 * min(means), top=3.0 * max(means))
    else:
        axes.margins(y=0.15)
