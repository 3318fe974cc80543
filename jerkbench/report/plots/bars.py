"""The figure of a metric as bars with intervals (the paper's Fig. 3)."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.report.plots.palette import PLAIN, Look, Method, Palette
from jerkbench.report.plots.style import MEASURED, legend_below, literal, new_figure, quiet
from jerkbench.report.tables.table_model import Table, TableCell, number

LOGARITHMIC_FROM = 30.0
"""The axis is logarithmic where the largest mean is so many times the smallest."""

SCENARIO = ("dataset", "disturbance", "attitude")
"""Factors that get a panel each; the other rows of a table make groups of bars in it."""

NAMED = 8
"""Up to so many bars in a panel, each has its value on it."""

PALE = 0.35
"""How opaque the bar of a combination is that lost some runs."""

GAP = 0.8
"""Between two groups, in bars."""


class Bar(NamedTuple):
    """A combination.

    Attributes:
        cell: of the table.
        look: of its method.
    """

    cell: TableCell
    look: Look


def bars_figure(table: Table, palette: Palette | None = None) -> Figure:
    """Draw a panel for each scenario of ``table``, in it a group for each of its rows, and a bar for each column.

    The colour is the filter's, the hatch the adaptation's. A combination that was not run has no place. Of one that
    lost runs the bar is pale and says how many; where the median run was lost there is no bar.
    """
    names = [" / ".join(column) or "mean" for column in table.columns]
    scenes = _scenes(table, names, palette or Palette.of(_methods(table)))
    columns = 1 if len(scenes) == 1 else 2
    height = -(-len(scenes) // columns)
    figure = new_figure(0.9 + 2.0 * height, 7.0 if columns == 1 else 9.0)
    panels = figure.subplots(height, columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(scenes) :]:
        axes.set_axis_off()
    for axes, (scene, groups) in zip(panels, scenes.items(), strict=False):
        axes.set_title(literal(scene), fontsize=8)
        _draw_groups(axes, groups)
    _name_columns(panels[0], names, scenes)
    _scale(panels[0], table)
    for axes in panels[: len(scenes)]:
        quiet(axes)
        axes.grid(visible=False, axis="x")
    figure.supylabel(literal(table.title), fontsize=9)
    legend_below(figure)
    return figure


def _methods(table: Table) -> Iterator[Method]:
    """Yield filter and adaptation of each combination of a table."""
    for row, column in itertools.product(table.rows, table.columns):
        yield _method(table, row, column)


def _method(table: Table, row: Sequence[str], column: Sequence[str]) -> Method:
    keys = (*table.row_keys, *table.column_keys)
    label = {**dict(table.constants), **dict(zip(keys, (*row, *column), strict=True))}
    return label.get("filter", ""), label.get("adaptation", PLAIN)


def _name_columns(axes: Axes, names: Sequence[str], scenes: Mapping[str, Mapping[str, Mapping[str, Bar]]]) -> None:
    """Put the columns into the legend, in grey where several filters are in one."""
    groups = [group for scene in scenes.values() for group in scene.values()]
    for name in names:
        seen = [group[name].look for group in groups if name in group]
        colours, hatches = {look.colour for look in seen}, {look.hatch for look in seen}
        colour = colours.pop() if len(colours) == 1 else MEASURED
        hatch = hatches.pop() if len(hatches) == 1 else ""
        axes.bar([0], [np.nan], color=colour, hatch=hatch, edgecolor="white", label=name)


def _scenes(table: Table, names: list[str], palette: Palette) -> dict[str, dict[str, dict[str, Bar]]]:
    """Scenario -> label of the row -> name of the column -> bar."""
    scenes: dict[str, dict[str, dict[str, Bar]]] = {}
    for row, cells in zip(table.rows, table.cells, strict=True):
        named = dict(zip(table.row_keys, row, strict=True))
        scene = ", ".join(value for key, value in named.items() if key in SCENARIO)
        label = ", ".join(value for key, value in named.items() if key not in SCENARIO)
        looks = [palette.look(_method(table, row, column)) for column in table.columns]
        scenes.setdefault(scene, {})[label] = {
            name: Bar(cell, look)
            for name, cell, look in zip(names, cells, looks, strict=True)
            if cell is not None and (math.isfinite(cell.mean) or cell.diverged + cell.failed)
        }
    return scenes


def _draw_groups(axes: Axes, groups: Mapping[str, Mapping[str, Bar]]) -> None:
    middles, place = [], 0.0
    named = sum(map(len, groups.values())) <= NAMED
    for bars in groups.values():
        middles.append(place + (max(len(bars), 1) - 1) / 2)
        for bar in bars.values():
            _draw_bar(axes, place, bar, named=named)
            place += 1.0
        place += GAP if bars else 1.0 + GAP
    axes.set_xticks(middles, [literal(label.replace("_", "\n", 1)) for label in groups], fontsize=7)  # narrow groups
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.9, place - GAP - 0.1)


def _draw_bar(axes: Axes, place: float, bar: Bar, *, named: bool) -> None:
    """Draw one bar with its interval, its value on it, and at its foot how many runs were lost."""
    cell, alpha = bar.cell, 1.0 if bar.cell.complete else PALE
    if lost := cell.diverged + cell.failed:
        foot = {"transform": axes.get_xaxis_transform(), "rotation": 90, "ha": "center", "va": "bottom", "fontsize": 5}
        axes.text(place, 0.03, f"{lost}/{cell.runs} lost", **foot)  # type: ignore[arg-type]  # as documented
    if not math.isfinite(cell.mean):
        return
    colours = {"color": bar.look.colour, "edgecolor": "white", "alpha": alpha}
    axes.bar(place, cell.mean, 0.9, hatch=bar.look.hatch, linewidth=0.3, **colours)  # type: ignore[arg-type]  # as documented
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
    cells = [c for row in table.cells for c in row if c is not None and math.isfinite(c.mean) and c.mean > 0]
    means = [c.mean for c in cells]
    if means and max(means) > LOGARITHMIC_FROM * min(means):
        axes.set_yscale("log")
        highest = max([3.0 * max(means), *(1.5 * c.high for c in cells if math.isfinite(c.high))])
        axes.set_ylim(bottom=0.5 * min(means), top=highest)
    else:
        axes.margins(y=0.15)
