"""Figures of a complete study with their captions, and the selection of the scenarios and methods in its figures."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.intervals import Samples, mean_intervals
from jerkbench.report.columns import METHOD, SCENARIO_FACTORS, competes, quantity, varying_factors
from jerkbench.report.findings import certain_size, study_verdicts
from jerkbench.report.plots.style import (
    LOGARITHMIC_FROM,
    MEASURED,
    NO_ADAPTATION,
    MethodStyle,
    Palette,
    legend_below,
    literal,
    method_styles,
    new_figure,
    style_axes,
)
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.table_model import Table, TableCell

if TYPE_CHECKING:
    import pandas as pd

PALE = 0.35
"""Opacity of the bars of combinations with failed runs."""

_GAP = 0.8
"""Distance between two groups of bars, in bar widths."""


class Bar(NamedTuple):
    """The bar of one combination, with its panel, its group in the panel, its name in the legend, style and results."""

    scene: str
    group: str
    column: str
    style: MethodStyle
    cell: TableCell


def bars_figure(table: Table, palette: Palette | None = None) -> Figure:
    """Draw a panel for each scenario of ``table``, with a group of bars for each row and a bar for each column.

    The colour of a bar represents the filter, and its hatch represents the adaptation. Combinations that were not run
    are left out. The bar of a combination with failed runs is pale, and the number of failed runs is printed at the
    foot of the bar. If the median run of a combination failed, the combination has no bar.
    """
    bars = _bars(table, palette)
    scenes = list(dict.fromkeys(bar.scene for bar in bars))
    columns = 1 if len(scenes) == 1 else 2
    height = -(-len(scenes) // columns)
    figure = new_figure(0.9 + 2.0 * height, 7.0 if columns == 1 else 9.0)
    panels = figure.subplots(height, columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(scenes) :]:
        axes.set_axis_off()
    for axes, scene in zip(panels, scenes, strict=False):
        axes.set_title(literal(scene), fontsize=8)
        _draw_groups(axes, [bar for bar in bars if bar.scene == scene])
    for name in (" / ".join(column) or "mean" for column in table.columns):  # invisible bars for the legend
        styles = [bar.style for bar in bars if bar.column == name]
        colours, hatches = {style.colour for style in styles}, {style.hatch for style in styles}
        colour, hatch = colours.pop() if len(colours) == 1 else MEASURED, hatches.pop() if len(hatches) == 1 else ""
        panels[0].bar([0], [np.nan], color=colour, hatch=hatch, edgecolor="white", label=name)
    cells = [bar.cell for bar in bars if math.isfinite(bar.cell.mean) and bar.cell.mean > 0]
    means = [cell.mean for cell in cells]
    if means and max(means) > LOGARITHMIC_FROM * min(means):  # all panels have the same vertical axis
        panels[0].set_yscale("log")
        highest = max([3.0 * max(means), *(1.5 * cell.high for cell in cells if math.isfinite(cell.high))])
        panels[0].set_ylim(bottom=0.5 * min(means), top=highest)
    else:
        panels[0].margins(y=0.15)
    for axes in panels[: len(scenes)]:
        style_axes(axes)
        axes.grid(visible=False, axis="x")
    figure.supylabel(literal(table.title), fontsize=9)
    legend_below(figure)
    return figure


def _bars(table: Table, palette: Palette | None) -> list[Bar]:
    """Return a bar for each combination that has an average or failed runs, in the order of the table."""
    placed = list(table.placed())
    methods = [(labels.get("filter", ""), labels.get("adaptation", NO_ADAPTATION)) for labels, _ in placed]
    palette = palette or Palette.of(methods)
    bars = []
    for (labels, cell), method in zip(placed, methods, strict=True):
        scene = ", ".join(labels[key] for key in table.row_keys if key in SCENARIO_FACTORS)
        group = ", ".join(labels[key] for key in table.row_keys if key not in SCENARIO_FACTORS)
        column = " / ".join(labels[key] for key in table.column_keys) or "mean"
        if math.isfinite(cell.mean) or cell.diverged + cell.failed:
            bars.append(Bar(scene, group, column, palette.style(method), cell))
    return bars


def _draw_groups(axes: Axes, bars: Sequence[Bar]) -> None:
    middles, position = {}, 0.0
    for group, of_group in itertools.groupby(bars, key=lambda bar: bar.group):
        places = []
        for bar in of_group:
            _draw_bar(axes, position, bar)
            places.append(position)
            position += 1.0
        middles[literal(group.replace("_", "\n", 1))] = np.mean(places)  # the groups are narrow, so break long names
        position += _GAP
    axes.set_xticks(list(middles.values()), list(middles), fontsize=7)
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.9, position - _GAP - 0.1)


def _draw_bar(axes: Axes, position: float, bar: Bar) -> None:
    """Draw a bar with its interval, and the number of failed runs at its foot."""
    cell, style = bar.cell, bar.style
    if failed := cell.diverged + cell.failed:
        foot = {"transform": axes.get_xaxis_transform(), "rotation": 90, "ha": "center", "va": "bottom", "fontsize": 5}
        axes.text(position, 0.03, f"{failed}/{cell.runs} failed", **foot)  # type: ignore[arg-type]  # as documented
    if not math.isfinite(cell.mean):
        return
    alpha = 1.0 if cell.complete else PALE
    axes.bar(
        position, cell.mean, 0.9, color=style.colour, hatch=style.hatch, edgecolor="white", alpha=alpha, linewidth=0.3
    )
    if math.isfinite(cell.low) and math.isfinite(cell.high):
        ends = [[max(0.0, cell.mean - cell.low)], [max(0.0, cell.high - cell.mean)]]
        axes.errorbar([position], [cell.mean], yerr=ends, fmt="none", ecolor="black", elinewidth=0.8, capsize=1.5)


# The heat map of methods and scenarios. The colour of a cell represents the ratio to the best error of the scenario.

WORST = 100.0
"""Upper end of the colour scale, as a ratio to the best error of the scenario."""


def heat_map_figure(table: Table, competing: Sequence[bool]) -> Figure:
    """Draw a heat map of the averages in ``table``. Colours represent the ratio to the best average of the scenario.

    The methods (columns of the table) are the rows of the figure, and the scenarios (rows of the table) are its
    columns. A cell with failed runs has no colour and contains the number of failed runs. Cells of combinations that
    were not run are empty. The names of references (methods that are not ``competing``) are in parentheses. The best
    average excludes references and cells with failed runs.
    """
    scenarios = [", ".join(values) for values in table.rows]
    names = [" + ".join(values) for values in table.columns]
    methods = [name if competes else f"({name})" for name, competes in zip(names, competing, strict=True)]
    height = 1.3 + 0.085 * max(map(len, scenarios)) + 0.24 * len(methods)
    figure = new_figure(height, 2.2 + 0.085 * max(map(len, methods)) + 0.56 * len(scenarios))
    axes = figure.add_subplot()
    complete = np.array([[cell.mean if cell and cell.complete else np.nan for cell in row] for row in table.cells])
    best = np.where(np.isfinite(complete) & np.asarray(competing), complete, np.inf).min(axis=1, keepdims=True)
    ratio = complete / best
    image = axes.imshow(np.clip(ratio, 1.0, WORST).T, cmap="cividis_r", norm=LogNorm(1.0, WORST), aspect="auto")
    for p, row in enumerate(table.cells):
        for s, cell in enumerate(row):
            if cell is None:
                continue
            style = {"color": "white" if ratio[p, s] > 10 else "black", "fontsize": 7.0}
            if competing[s] and complete[p, s] == best[p]:
                style["weight"] = "bold"
            text = cell.number
            if failed := cell.diverged + cell.failed:
                text, style = f"{text}\n{failed}/{cell.runs}".strip(), {"color": "#555555", "fontsize": 6.0}
            axes.text(p, s, text, ha="center", va="center", **style)  # type: ignore[arg-type]  # as documented
    axes.set_xticks(range(len(scenarios)), map(literal, scenarios), rotation=90, fontsize=8)
    axes.set_yticks(range(len(methods)), map(literal, methods), fontsize=8)
    axes.set_title(literal(table.title), fontsize="medium")
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    bar = figure.colorbar(image, ax=axes, ticks=[1, 2, 5, 10, 20, 50, 100], format="%g")
    bar.set_label(f"Times the best of the scenario (up to {WORST:g})", fontsize=8)
    return figure


# Curves of the metric as a function of a parameter: the process noise, or the size of a fault.

PARAMETER = re.compile(r"([A-Za-z_0-9.]+)=(-?[0-9.]+(?:[eE][+-]?[0-9]+)?)(?=[,)]|$)")
MIN_SIZES = 3
"""Minimum number of values of a parameter for which a curve is drawn."""

SCENARIO, SIZE, NAME = "swept_in", "swept_value", "swept_name"
"""Columns that `curves_figure` reads: the panel of a row, the value of the parameter, and the label of its axis."""


def swept_rows(rows: "pd.DataFrame", factor: str) -> "pd.DataFrame":
    """Return the rows whose labels of ``factor`` differ in one parameter, with the columns `curves_figure` reads.

    Parameters with fewer than `MIN_SIZES` different values are ignored.

    Args:
        rows: one row for each combination and seed.
        factor: "noise" or "disturbance".
    """
    import pandas as pd

    rows = rows.assign(**{key: rows[key].astype(str) for key in ("dataset", "disturbance", "noise")})
    found = [
        (label, f"{label[: match.start(2)]}...{label[match.end(2) :]}", match[1], float(match[2]))
        for label in rows[factor].unique()
        for match in PARAMETER.finditer(label)
    ]
    places = pd.DataFrame(found, columns=[factor, SCENARIO, NAME, SIZE])
    places["values"] = places.groupby([SCENARIO, NAME])[SIZE].transform("nunique")
    most = places.loc[places.groupby(factor)["values"].idxmax()]  # parameter with the most values
    swept = rows.merge(most[most["values"] >= MIN_SIZES].drop(columns="values"), on=factor)
    unswept = swept["disturbance"] + ", " if factor == "noise" else ""
    return swept.assign(**{SCENARIO: swept["dataset"] + ": " + unswept + swept[SCENARIO]})


def curves_figure(swept: "pd.DataFrame", metric: str, palette: Palette | None = None) -> Figure:
    """Draw the mean of ``metric`` and its interval as a function of a parameter, with a panel for each scenario.

    A mean excludes runs that diverged or failed. A hollow point marks a mean that excludes at least one run.

    Args:
        swept: rows that `swept_rows` returned.
        metric: column of the metric.
        palette: colours and line styles of the methods of the study.
    """
    swept = swept.assign(method=swept["filter"].astype(str) + " + " + swept["adaptation"].astype(str))
    scenes = list(swept.groupby(SCENARIO, sort=False))
    figure = new_figure(0.6 + 2.8 * len(scenes))
    panels = figure.subplots(len(scenes), 1, squeeze=False)[:, 0]
    for axes, (name, scene) in zip(panels, scenes, strict=True):
        for method, style in method_styles(swept["method"].unique(), palette):
            runs = scene[scene["method"] == method]
            _draw_means(axes, runs, np.sort(scene[SIZE].unique()), metric, style, method if axes is panels[0] else None)
        axes.set(title=literal(str(name)), ylabel=literal(quantity(metric).heading), yscale="log")
        axes.set_xlabel(scene[NAME].iloc[0])
        if scene[SIZE].min() > 0:
            axes.set_xscale("log")
        style_axes(axes)
    legend_below(figure)
    return figure


def _draw_means(
    axes: Axes, runs: "pd.DataFrame", at: FloatArray, metric: str, style: MethodStyle, label: str | None
) -> None:
    """Draw the means of one method at the values ``at`` of the parameter."""
    groups = [runs[runs[SIZE] == x] for x in at]
    good = [group.loc[group["status"] == "ok", metric] for group in groups]
    means, low, high = mean_intervals(Samples.of(good))
    complete = np.array([len(values) == len(group) for values, group in zip(good, groups, strict=True)])
    axes.plot(at, means, **style.stroke, linewidth=1.0, label=label)
    axes.vlines(at, low, high, color=style.colour, linewidth=0.8)
    for face, where in ((style.colour, complete), ("white", ~complete)):
        axes.plot(at[where], means[where], "o", color=style.colour, markerfacecolor=face, markersize=4.0)


# The figures of a study with their captions, and the selection of scenarios and methods.

SCENES = 3
"""Number of scenarios that are drawn with ``figures=few``. Each scenario has up to seven figures."""

Methods = tuple[tuple[str, str], ...]
"""Filter and adaptation of each method."""


class Drawing(NamedTuple):
    """A Matplotlib figure with its name and its caption.

    Attributes:
        name: name of the figure files, without the extension.
        caption: caption of the figure.
        figure: Matplotlib figure.
    """

    name: str
    caption: str
    figure: Figure


class Picture(NamedTuple):
    """An encoded figure with its caption, as it is embedded in the report.

    Attributes:
        name: name of the figure files, without the extension.
        caption: caption of the figure.
        scenario: name of the scenario in the figure, or an empty text for a figure of the complete study.
        data: the encoded image as a data URL.
        width: width of the image [pixels].
        height: height of the image [pixels].
    """

    name: str
    caption: str
    scenario: str
    data: str
    width: int
    height: int


def palette_of(rows: "pd.DataFrame") -> Palette:
    """Return the colour palette for all figures and for the report of a study."""
    return Palette.of(zip(rows["filter"].astype(str), rows["adaptation"].astype(str), strict=True))


def of_rows(rows: "pd.DataFrame", palette: Palette | None = None) -> Iterator[Drawing]:
    """Yield the figures of a study that need only the stored rows, and no repeated runs."""
    metric, palette = main_metric(rows), palette or palette_of(rows)
    title = quantity(metric).heading
    means = (
        f"{title} of each combination with its 95 % interval. Pale bars: with the fraction of failed runs. No bar:"
        " the median run failed."
    )
    yield Drawing("bars", means, bars_figure(summarise(rows, metric, leaders=False), palette))
    yield from _heat_map(rows, metric)
    curves = [("sensitivity", "noise", "the process noise")]
    if len(set(rows["noise"])) == 1:
        curves.append(("severity", "disturbance", "the size of a fault"))
    for name, factor, parameter in curves:
        if len(swept := swept_rows(rows, factor)):
            caption = f"{quantity(metric).heading} over {parameter}; hollow: some runs failed."
            yield Drawing(name, caption, curves_figure(swept, metric, palette))


def _heat_map(rows: "pd.DataFrame", metric: str) -> Iterator[Drawing]:
    """Yield the heat map, if the study has at least two scenarios and at least two methods."""
    varying = varying_factors(rows)
    of_scenario, of_method = ([key for key in varying if (key in METHOD) is made_of] for made_of in (False, True))
    if not (of_scenario and of_method):
        return
    table = summarise(rows, metric, of_scenario, of_method, leaders=False)
    competing = [competes(dict(zip(table.column_keys, column, strict=True))) for column in table.columns]
    references = "" if all(competing) else " In parentheses: references, which do not compete."
    caption = (
        f"{quantity(metric).heading} by method and scenario. Bold: best of a scenario. White, 1/5: fraction"
        f" of failed runs.{references}"
    )
    yield Drawing("heat-map", caption, heat_map_figure(table, competing))


def by_difference(rows: "pd.DataFrame", metric: str, names: Sequence[str]) -> list[str]:
    """Return the names of all scenarios, sorted by decreasing size of the largest significant difference.

    The function `certain_size` measures the size of a difference. Scenarios without a significant difference come last.

    Args:
        rows: one row for each combination and seed.
        metric: main metric of the study.
        names: names of the scenarios that can be drawn, in the form "data set, disturbance, attitude".
    """
    largest = dict.fromkeys(names, 0.0)
    for standing in study_verdicts(rows, metric).standings:
        for pair in standing.tested:
            name = ", ".join(pair.subject[:3])
            largest[name] = max(largest.get(name, 0.0), certain_size(pair.judgement))
    return sorted(names, key=lambda name: -largest[name])
