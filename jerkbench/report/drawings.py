"""Every figure of a study, with its caption; the scenarios and methods that carry its findings."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.ranks import critical_difference
from jerkbench.recording import Recording
from jerkbench.report.columns import FACTORS, METHOD, competes, quantity
from jerkbench.report.comparisons import runs_by_combination
from jerkbench.report.findings import largest
from jerkbench.report.plots.bars import bars_figure, critical_difference_figure, heat_map_figure, profile_figure
from jerkbench.report.plots.consistency import (
    acceleration_figure,
    adapted_r_figure,
    consistency_figure,
    tilt_figure,
)
from jerkbench.report.plots.runs import disturbed_window_s, error_figure, inset_trajectory_figure, zoomed_error_figure
from jerkbench.report.plots.style import Palette
from jerkbench.report.plots.sweeps import sensitivity_figure, severity_figure, with_noise_sigma
from jerkbench.report.study_verdicts import common_field, study_verdicts
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.sweeps import (
    at_best_noise,
    costs,
    of_all_methods,
    with_severity,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


AT_BEST = "Each method has its best noise of the sweep, which the other seeds choose for each seed."

NOTABLE = 0.5
"""A method is drawn where its difference is at least so large, as a part of the scenario's largest."""

SCENES = 3
"""Scenarios that are drawn at most: of each there are eight figures."""

METHODS = 4
"""Methods that are drawn in a scenario at most, beside the best."""

Methods = tuple[tuple[str, str], ...]
"""Filter and adaptation of each."""


class Drawing(NamedTuple):
    """A figure with what belongs under it.

    Attributes:
        name: of its files, without the ending.
        caption: what it shows.
        figure: the figure.
    """

    name: str
    caption: str
    figure: "Figure"


class Picture(NamedTuple):
    """A figure as bytes, with what belongs under it.

    Attributes:
        name: of its files, without the ending.
        caption: what it shows.
        scenario: whose runs; empty for a figure of all rows.
        png: the picture.
    """

    name: str
    caption: str
    scenario: str
    png: bytes


class Scene(NamedTuple):
    """One scenario, its first seed.

    Attributes:
        name: data set, disturbance, attitude.
        stem: the beginning of its files' names.
        recording: what the filters saw; its name is the figures' title.
        attitude: what they were given.
        estimates: of each method, by its name.
        tilts: the best method with each way of the tilt filter to adapt; if its attitude is no `tilt`, its own alone.
        best: the method with the lowest mean, of those that compete.
        best_runs: recordings and estimates of its first seeds.
        burn_in_s: errors count from then on.
    """

    name: str
    stem: str
    recording: Recording
    attitude: Attitude
    estimates: Mapping[str, Estimate]
    tilts: Mapping[str, Estimate]
    best: str
    best_runs: tuple[tuple[Recording, Estimate], ...]
    burn_in_s: float


def palette_of(rows: "pd.DataFrame") -> Palette:
    """Return the palette of a study: the same in all its figures, and on its page."""
    return Palette.of(zip(rows["filter"].astype(str), rows["adaptation"].astype(str), strict=True))


def of_rows(rows: "pd.DataFrame", palette: Palette | None = None) -> Iterator[Drawing]:
    """Yield the figures that need the rows alone."""
    metric, palette = main_metric(rows), palette or palette_of(rows)
    title = quantity(metric).heading
    best = at_best_noise(rows, metric)
    noise = f" {AT_BEST}" if len(best) < len(rows) else ""  # not if each method has one noise, as tuned methods do
    means = (
        f"{title}: means with 95 % intervals; pale, 1/5 lost: so many runs were lost, no bar: the median run.{noise}"
    )
    floors = {runs.floor for runs in runs_by_combination(best, metric).values()}
    floor = max(floors) if len(set(best["dataset"])) == 1 else 0.0
    yield Drawing("bars", means, bars_figure(summarise(best, metric, leaders=False), palette, floor))
    yield from _over_scenarios(best, metric, noise, palette)
    yield from _ranked(best, metric, noise, palette)
    if len(with_noise_sigma(rows)["sigma_a"].unique()) > 1:
        figure = sensitivity_figure(rows, metric, palette)
        yield Drawing("sensitivity", f"{title} over the process noise; hollow: some runs were lost.", figure)
    swept = with_severity(best)
    if len(swept):
        caption = (
            f"{title} over the size of a fault; hollow: some runs were lost; crosses: two methods are equally good;"
            f" triangles: the smallest fault that a method's adaptation acts on.{noise}"
        )
        yield Drawing("severity", caption, severity_figure(swept, metric, palette))


def _over_scenarios(rows: "pd.DataFrame", metric: str, noise: str, palette: Palette) -> Iterator[Drawing]:
    """Yield the heat map, and the profiles of the methods that compete, where there are several scenarios."""
    title = quantity(metric).heading
    found = costs(rows, metric)
    if min(found.means.shape) < 2:
        return
    rivals = found.rivals
    common, which = of_all_methods(found.means[:, rivals])
    profiled = len(common) > 1 and sum(rivals) > 1
    means = (
        f"{title}, means of the table, method by scenario; bold: the best of a scenario; white, 1/5: so many runs were"
        " lost."
    )
    references = "" if all(rivals) else " In parentheses: references, which do not compete."
    needs = f"two scenarios{which}" if sum(rivals) > 1 else "two methods that compete"
    none = "" if profiled else f" No performance profiles: they need {needs}."
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    of_scenario, of_method = ([key for key in varying if (key in METHOD) is made_of] for made_of in (False, True))
    table = summarise(rows, metric, of_scenario, of_method, leaders=False)
    competes_of = [competes(dict(zip(table.column_keys, column, strict=True))) for column in table.columns]
    figure = heat_map_figure(table, competes_of)
    yield Drawing("heat-map", f"{means}{references}{none}{noise}", figure)
    if profiled:
        contents = f"Performance profiles and mean ranks over the {len(common)} scenarios{which}."
        names = [name for name, rival in zip(found.methods, rivals, strict=True) if rival]
        excluded = "" if all(rivals) else " References do not compete."
        drawn = [palette.look(label) for label, rival in zip(found.labels, rivals, strict=True) if rival]
        yield Drawing("profile", f"{contents}{excluded}{noise}", profile_figure(common, names, title, drawn))


def _ranked(rows: "pd.DataFrame", metric: str, noise: str, palette: Palette) -> Iterator[Drawing]:
    """Yield the mean ranks with the critical difference, where at least three methods ran in several scenarios."""
    verdicts = study_verdicts(rows, metric, most=0)
    field = common_field(verdicts)
    if field is None or len(field.methods) < 3:
        return
    scenarios = len(field.scenarios)
    least = critical_difference(len(field.methods), scenarios)
    looks = {
        standing.name(rival): palette.look((rival.filter, rival.adaptation))
        for standing in verdicts.standings
        for rival in standing.rivals
    }
    title = quantity(metric).heading
    drawn = [looks[name] for name in field.methods]
    caption = (
        f"{title}: mean ranks over {scenarios} scenarios; a line joins methods that are not told "
        f"apart (Nemenyi, 5 %); hollow: with an adaptation.{noise}"
    )
    figure = critical_difference_figure(field.ranks, least, field.methods, drawn, title, scenarios)
    yield Drawing("critical-difference", caption, figure)


def of_scene(scene: Scene, palette: Palette) -> Iterator[Drawing]:
    """Yield the figures of one scenario's runs."""
    recording, estimates = scene.recording, scene.estimates
    common: dict[str, Any] = {"burn_in_s": scene.burn_in_s, "palette": palette}
    window_s = disturbed_window_s(recording, estimates)
    only = {scene.best: estimates[scene.best]}
    updated = {name: estimate for name, estimate in estimates.items() if len(estimate.updates.t_s)}
    figures = {
        "errors": ("position error, first seed", error_figure(recording, estimates, panels=1, **common)),
        "zoom": ("position error around a disturbance", zoomed_error_figure(recording, estimates, window_s, **common)),
        "trajectory": ("trajectory, and a part of it enlarged", inset_trajectory_figure(recording, estimates, palette)),
        "three-sigma": (f"errors of {scene.best} with three sigmas", error_figure(recording, only, **common)),
        "consistency": (f"NEES and NIS of {scene.best}", consistency_figure(scene.best_runs, scene.best, palette)),
        "adapted-r": ("measurement noise that was used", adapted_r_figure(recording, updated, palette)),
    }
    if recording.imu is not None:
        figures["tilt"] = ("roll and pitch against the reference", tilt_figure(recording, scene.tilts, palette))
        figures["acceleration"] = ("raw and compensated acceleration", acceleration_figure(recording, scene.attitude))
    for kind, (caption, figure) in figures.items():
        yield Drawing(f"{scene.stem}-{kind}", f"{scene.name}: {caption}.", figure)


def telling_scenes(scenes: Mapping[str, Methods]) -> dict[str, Methods]:
    """Return the first few of the scenarios `by_difference`; where none has a difference, the first of all."""
    told = [(name, methods) for name, methods in scenes.items() if methods]
    return dict(told[:SCENES] or list(scenes.items())[:1])


def by_difference(rows: "pd.DataFrame", metric: str, names: Sequence[str]) -> dict[str, Methods]:
    """Return all scenarios, the one with the largest certain difference first, each with the methods that differ.

    Methods whose difference is less than `NOTABLE` of the scenario's largest are left out. Scenarios without a
    difference come last, in their order, with no methods.

    Args:
        rows: one row a cell and seed.
        metric: the leading one.
        names: of the scenarios that can be drawn: data set, disturbance, attitude.
    """
    weights: dict[str, float] = {}
    scenes: dict[str, Methods] = {}
    for weight, pair in largest(study_verdicts(rows, metric).standings):
        for combination in (pair.baseline, pair.subject):
            name = ", ".join(combination[:3])
            if name in names and weight >= NOTABLE * weights.setdefault(name, weight):
                method = (combination.filter, combination.adaptation)
                scenes[name] = tuple(dict.fromkeys((*scenes.get(name, ()), method)))[:METHODS]
    return {**scenes, **{name: () for name in names if name not in scenes}}
