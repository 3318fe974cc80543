"""The figures of a study with their captions, and the selection of the scenarios and methods in the figures."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from jerkbench.report.columns import FACTORS, METHOD, checked, competes, quantity
from jerkbench.report.comparisons import runs_by_combination
from jerkbench.report.findings import certain_size, informative_standings
from jerkbench.report.plots.studies import (
    SIZE,
    bars_figure,
    curves_figure,
    heat_map_figure,
    with_noise_sigma,
    with_severity,
)
from jerkbench.report.plots.style import Palette
from jerkbench.report.study_verdicts import study_verdicts
from jerkbench.report.summary import main_metric, summarise

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


NOTABLE = 0.5
"""A method is drawn if its difference is at least this fraction of the largest difference in the scenario."""

SCENES = 3
"""Maximum number of scenarios that are drawn. Each scenario has up to eight figures."""

METHODS = 4
"""Maximum number of methods that are drawn in a scenario in addition to the best method."""

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
    figure: "Figure"


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
        f"{title}: averages with 95 % intervals. Pale bars: with the fraction of failed runs. No bar: the median run"
        " failed."
    )
    floors = {runs.floor for runs in runs_by_combination(checked(rows, metric), metric).values()}
    floor = max(floors) if len(set(rows["dataset"])) == 1 else 0.0
    yield Drawing("bars", means, bars_figure(summarise(rows, metric, leaders=False), palette, floor))
    yield from _heat_map(rows, metric)
    noises = with_noise_sigma(rows)
    if len(noises[SIZE].unique()) > 1:
        figure = curves_figure(noises, metric, palette)
        yield Drawing("sensitivity", f"{title} over the process noise; hollow: some runs failed.", figure)
    swept = with_severity(rows)
    if len(swept) and len(set(rows["noise"])) == 1:
        caption = f"{title} over the size of a fault; hollow: some runs failed."
        yield Drawing("severity", caption, curves_figure(swept, metric, palette))


def _heat_map(rows: "pd.DataFrame", metric: str) -> Iterator[Drawing]:
    """Yield the heat map, if the study has at least two scenarios and at least two methods."""
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    of_scenario, of_method = ([key for key in varying if (key in METHOD) is made_of] for made_of in (False, True))
    if not (of_scenario and of_method):
        return
    table = summarise(rows, metric, of_scenario, of_method, leaders=False)
    competing = [competes(dict(zip(table.column_keys, column, strict=True))) for column in table.columns]
    references = "" if all(competing) else " In parentheses: references, which do not compete."
    caption = (
        f"{quantity(metric).heading}, averages by method and scenario. Bold: best of a scenario. White, 1/5: fraction"
        f" of failed runs.{references}"
    )
    yield Drawing("heat-map", caption, heat_map_figure(table, competing))


def telling_scenes(scenes: Mapping[str, Methods]) -> dict[str, Methods]:
    """Return the first `SCENES` scenarios with a significant difference.

    If no difference is significant, return the first scenario.
    """
    informative = [(name, methods) for name, methods in scenes.items() if methods]
    return dict(informative[:SCENES] or list(scenes.items())[:1])


def by_difference(rows: "pd.DataFrame", metric: str, names: Sequence[str]) -> dict[str, Methods]:
    """Return all scenarios, sorted by decreasing difference between methods, and the methods that differ significantly.

    The function `certain_size` measures the size of a difference. A method is left out if its differences are less than
    `NOTABLE` times the largest difference in the scenario. Scenarios without a significant difference come last, in the
    order of ``names``, with an empty tuple of methods.

    Args:
        rows: one row for each combination and seed.
        metric: main metric of the study.
        names: names of the scenarios that can be drawn, in the form "data set, disturbance, attitude".
    """
    weights: dict[str, float] = {}
    scenes: dict[str, Methods] = {}
    informative = informative_standings(study_verdicts(rows, metric).standings)
    pairs = [(certain_size(pair.judgement), pair) for standing in informative for pair in standing.tested]
    for weight, pair in sorted(pairs, key=lambda one: -one[0]):
        for combination in (pair.baseline, pair.subject):
            name = ", ".join(combination[:3])
            if weight and name in names and weight >= NOTABLE * weights.setdefault(name, weight):
                method = (combination.filter, combination.adaptation)
                scenes[name] = tuple(dict.fromkeys((*scenes.get(name, ()), method)))[:METHODS]
    return {**scenes, **{name: () for name in names if name not in scenes}}
