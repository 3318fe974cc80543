"""Figures over methods and scenarios: bars, heat map, performance profile, mean ranks."""

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.ranks import mean_ranks, performance_profile, rank_cliques
from jerkbench.report.columns import SCENARIO_FACTORS
from jerkbench.report.plots.style import (
    MEASURED,
    NO_ADAPTATION,
    REFERENCE,
    DrawnMethod,
    MethodStyle,
    Palette,
    coinciding,
    legend_below,
    literal,
    new_figure,
    style_axes,
)
from jerkbench.report.table_model import Table, TableCell, number

_LOGARITHMIC_FROM = 30.0
"""The axis is logarithmic where the largest mean is so many times the smallest."""

_NAMED = 8
"""Up to so many bars in a panel, each has its value on it."""

PALE = 0.35
"""How opaque the bar of a combination is that lost some runs."""

_GAP = 0.8
"""Between two groups, in bars."""


Bar = tuple[TableCell, MethodStyle]
"""A combination, and the look of its method."""


def bars_figure(table: Table, palette: Palette | None = None, floor: float = 0.0) -> Figure:
    """Draw a panel for each scenario of ``table``, in it a group for each of its rows, and a bar for each column.

    The colour is the filter's, the hatch the adaptation's. A combination that was not run has no place. Of one that
    lost runs the bar is pale and says how many; where the median run was lost there is no bar. A dashed line is the
    ``floor`` that the reference's own sigma puts under the metric.
    """
    names = [" / ".join(column) or "mean" for column in table.columns]
    methods = (_method(table, *place) for place in itertools.product(table.rows, table.columns))
    scenes = _scenes(table, names, palette or Palette.of(methods))
    columns = 1 if len(scenes) == 1 else 2
    height = -(-len(scenes) // columns)
    figure = new_figure(0.9 + 2.0 * height, 7.0 if columns == 1 else 9.0)
    panels = figure.subplots(height, columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(scenes) :]:
        axes.set_axis_off()
    for axes, (scene, groups) in zip(panels, scenes.items(), strict=False):
        axes.set_title(literal(scene), fontsize=8)
        _draw_groups(axes, groups)
        if floor > 0:
            label = "floor: the reference's own sigma" if axes is panels[0] else None
            axes.axhline(floor, color="black", linestyle="--", linewidth=0.8, label=label)
    _name_columns(panels[0], names, scenes)
    cells = [c for row in table.cells for c in row if c is not None and math.isfinite(c.mean) and c.mean > 0]
    means = [c.mean for c in cells]
    if means and max(means) > _LOGARITHMIC_FROM * min(means):  # of all panels
        panels[0].set_yscale("log")
        highest = max([3.0 * max(means), *(1.5 * c.high for c in cells if math.isfinite(c.high))])
        panels[0].set_ylim(bottom=0.5 * min(means), top=highest)
    else:
        panels[0].margins(y=0.15)
    for axes in panels[: len(scenes)]:
        style_axes(axes)
        axes.grid(visible=False, axis="x")
    figure.supylabel(literal(table.title), fontsize=9)
    legend_below(figure)
    return figure


def _method(table: Table, row: Sequence[str], column: Sequence[str]) -> DrawnMethod:
    keys = (*table.row_keys, *table.column_keys)
    label = {**dict(table.constants), **dict(zip(keys, (*row, *column), strict=True))}
    return label.get("filter", ""), label.get("adaptation", NO_ADAPTATION)


def _name_columns(axes: Axes, names: Sequence[str], scenes: Mapping[str, Mapping[str, Mapping[str, Bar]]]) -> None:
    """Put the columns into the legend, in grey where several filters are in one."""
    groups = [group for scene in scenes.values() for group in scene.values()]
    for name in names:
        seen = [group[name][1] for group in groups if name in group]
        colours, hatches = {look.colour for look in seen}, {look.hatch for look in seen}
        colour = colours.pop() if len(colours) == 1 else MEASURED
        hatch = hatches.pop() if len(hatches) == 1 else ""
        axes.bar([0], [np.nan], color=colour, hatch=hatch, edgecolor="white", label=name)


def _scenes(table: Table, names: list[str], palette: Palette) -> dict[str, dict[str, dict[str, Bar]]]:
    """Scenario -> label of the row -> name of the column -> bar."""
    scenes: dict[str, dict[str, dict[str, Bar]]] = {}
    for row, cells in zip(table.rows, table.cells, strict=True):
        named = dict(zip(table.row_keys, row, strict=True))
        scene = ", ".join(value for key, value in named.items() if key in SCENARIO_FACTORS)
        label = ", ".join(value for key, value in named.items() if key not in SCENARIO_FACTORS)
        looks = [palette.look(_method(table, row, column)) for column in table.columns]
        scenes.setdefault(scene, {})[label] = {
            name: (cell, look)
            for name, cell, look in zip(names, cells, looks, strict=True)
            if cell is not None and (math.isfinite(cell.mean) or cell.diverged + cell.failed)
        }
    return scenes


def _draw_groups(axes: Axes, groups: Mapping[str, Mapping[str, Bar]]) -> None:
    middles, place = [], 0.0
    named = sum(map(len, groups.values())) <= _NAMED
    for bars in groups.values():
        middles.append(place + (max(len(bars), 1) - 1) / 2)
        for bar in bars.values():
            _draw_bar(axes, place, bar, named=named)
            place += 1.0
        place += _GAP if bars else 1.0 + _GAP
    axes.set_xticks(middles, [literal(label.replace("_", "\n", 1)) for label in groups], fontsize=7)  # narrow groups
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.9, place - _GAP - 0.1)


def _draw_bar(axes: Axes, place: float, bar: Bar, *, named: bool) -> None:
    """Draw one bar with its interval, its value on it, and at its foot how many runs were lost."""
    cell, look = bar
    if lost := cell.diverged + cell.failed:
        foot = {"transform": axes.get_xaxis_transform(), "rotation": 90, "ha": "center", "va": "bottom", "fontsize": 5}
        axes.text(place, 0.03, f"{lost}/{cell.runs} lost", **foot)  # type: ignore[arg-type]  # as documented
    if not math.isfinite(cell.mean):
        return
    alpha = 1.0 if cell.complete else PALE
    axes.bar(place, cell.mean, 0.9, color=look.colour, hatch=look.hatch, edgecolor="white", alpha=alpha, linewidth=0.3)
    end = cell.mean
    if math.isfinite(cell.low) and math.isfinite(cell.high):
        ends = np.array([[max(0.0, cell.mean - cell.low)], [max(0.0, cell.high - cell.mean)]])
        axes.errorbar([place], [cell.mean], yerr=ends, fmt="none", ecolor="black", elinewidth=0.8, capsize=1.5)
        end = max(cell.mean, cell.high)
    if named:
        offset = {"xytext": (0, 2), "textcoords": "offset points"}
        axes.annotate(number(cell.mean), (place, end), ha="center", fontsize=6, **offset)  # type: ignore[arg-type]  # as documented


# The figure of methods by scenarios: what is best where, and by how much the others miss it.

WORST = 100.0
"""The colour goes no further than so many times the best."""


def heat_map_figure(table: Table, competing: Sequence[bool]) -> Figure:
    """Draw the cells of ``table``: each number as it is there, its colour by the ratio to the best of its scenario.

    Columns of the table, the methods, make the rows, its rows, the scenarios, the columns. A cell that lost runs has no
    colour and is no best: below its number stands how many it lost. A combination that was not run is an empty field.
    What does not compete is in parentheses, and is no best.
    """
    scenarios = [", ".join(values) for values in table.rows]
    names = [" + ".join(values) for values in table.columns]
    methods = [name if competes else f"({name})" for name, competes in zip(names, competing, strict=True)]
    height = 1.3 + 0.085 * max(map(len, scenarios)) + 0.24 * len(methods)
    figure = new_figure(height, 2.2 + 0.085 * max(map(len, methods)) + 0.56 * len(scenarios))
    axes = figure.add_subplot()
    whole = np.array([[cell.mean if cell and cell.complete else np.nan for cell in row] for row in table.cells])
    best = np.where(np.isfinite(whole) & np.asarray(competing), whole, np.inf).min(axis=1, keepdims=True)
    ratio = whole / best
    image = axes.imshow(np.clip(ratio, 1.0, WORST).T, cmap="cividis_r", norm=LogNorm(1.0, WORST), aspect="auto")
    for p, row in enumerate(table.cells):
        for s, cell in enumerate(row):
            if cell is None:
                continue
            look = {"color": "white" if ratio[p, s] > 10 else "black", "fontsize": 7.0}
            if competing[s] and whole[p, s] == best[p]:
                look["weight"] = "bold"
            text = cell.number
            if lost := cell.diverged + cell.failed:
                text, look = f"{text}\n{lost}/{cell.runs}".strip(), {"color": "#555555", "fontsize": 6.0}
            axes.text(p, s, text, ha="center", va="center", **look)  # type: ignore[arg-type]  # as documented
    axes.set_xticks(range(len(scenarios)), map(literal, scenarios), rotation=90, fontsize=8)
    axes.set_yticks(range(len(methods)), map(literal, methods), fontsize=8)
    axes.set_title(literal(table.title), fontsize="medium")
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    bar = figure.colorbar(image, ax=axes, ticks=[1, 2, 5, 10, 20, 50, 100], format="%g")
    bar.set_label(f"Times the best of the scenario (up to {WORST:g})", fontsize=8)
    return figure


# Figures of methods over scenarios: performance profiles, mean ranks with the critical difference.

FURTHEST = 100.0
PROFILES = 8
"""As many methods are drawn, by their mean rank."""


def profile_figure(costs: FloatArray, methods: Sequence[str], title: str, looks_of: Sequence[MethodStyle]) -> Figure:
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
        label = " = ".join(f"{name} (mean rank {ranks[methods.index(name)]:.1f})" for name in names)
        look = looks_of[s]
        axes.step(factors, 100 * shares[s], where="post", **look.stroke, linewidth=1.3, label=label)
    axes.set(xscale="log", xlim=(1.0, FURTHEST), ylim=(0.0, 103.0), title=literal(title))
    axes.set_xlabel(f"Times the best of a scenario ({len(costs)} scenarios)")
    axes.set_ylabel("Scenarios within [%]")
    style_axes(axes)
    axes.set_xticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
    legend_below(figure)
    return figure


RANKED = 24
"""As many methods are drawn, the best by mean rank."""

_ROW_IN = 0.24
STRIP = 0.028
"""Width that a group's line takes beside the ranks, of that of the axes."""


def critical_difference_figure(
    ranks: FloatArray, least: float, methods: Sequence[str], looks_of: Sequence[MethodStyle], title: str, scenarios: int
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
    figure = new_figure(1.5 + _ROW_IN * len(order))
    axes = figure.add_subplot()
    for row, k in enumerate(order):
        axes.plot([0, ranks[k]], [row, row], color="#D0D0D0", linewidth=0.8, zorder=1)
        face = looks_of[k].colour if not looks_of[k].dash else "white"
        axes.plot(ranks[k], row, "o", color=looks_of[k].colour, markerfacecolor=face, markersize=5.0, zorder=2)
    right = max(float(ranks[order[-1]]), 1.0 + least) + 0.25
    axes.set(xlim=(0.75, right), ylim=(len(order) - 0.4, -1.9), title=literal(title))
    left_out = len(ranks) - len(order)
    others = f"; {left_out} worse ones are not drawn" if left_out else ""
    axes.set_xlabel(f"Mean rank over {scenarios} scenarios, 1 the best{others}")
    style_axes(axes)
    axes.grid(visible=False, axis="y")
    axes.set_yticks(range(len(order)), [f"{literal(methods[k])}  {ranks[k]:.1f}" for k in order])
    axes.errorbar([1 + least / 2], [-1.0], xerr=least / 2, color=REFERENCE, capsize=3.0, linewidth=1.2)  # to scale
    axes.text(1.0, -1.25, f"critical difference {least:.1f} (Nemenyi, 5 %)", fontsize="small", va="bottom")
    _draw_cliques(axes, rank_cliques(ranks, least), order)
    return figure


def _draw_cliques(axes: Axes, groups: Sequence[IntArray], order: IntArray) -> None:
    """Draw a line for each group beside the ranks, as far left as others leave room."""
    place_of = {int(method): row for row, method in enumerate(order)}
    last: list[int] = []
    for group in groups:
        rows = [place_of[int(k)] for k in group if int(k) in place_of]
        if len(rows) < 2:
            continue
        lane = next((lane for lane, end in enumerate(last) if end < rows[0]), len(last))
        last[lane : lane + 1] = [rows[-1]]
        line = {"color": REFERENCE, "linewidth": 2.2, "solid_capstyle": "butt", "clip_on": False}
        ends = [rows[0] - 0.3, rows[-1] + 0.3]
        axes.plot([1.02 + STRIP * lane] * 2, ends, transform=axes.get_yaxis_transform(), **line)  # type: ignore[arg-type]  # as documented
