"""The figure of a trajectory seen from above."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import position_error_length_m
from jerkbench.recording import Recording
from jerkbench.report.plots.curves import coinciding, joined
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import DOTS_PER_INCH, MEASURED, OUTAGE, REFERENCE, legend_below, literal, quiet

WIDTH_IN = 7.0
LABELS_IN = 0.7
"""Height that title and labels take [inch]."""


def trajectory_figure(
    recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None
) -> Figure:
    """Draw reference, fixes, outages and every estimate in the plane of east and north [m], to scale.

    The reference decides what is shown: an estimate that diverged leaves the picture, and the legend says so. Lines
    whose errors coincide are drawn once, with all their names.
    """
    low, high = _window(recording, estimates)
    span = high - low
    map_in = float(np.clip(WIDTH_IN * span[1] / span[0], 2.5, 7.5))
    figure = Figure(figsize=(WIDTH_IN, map_in + LABELS_IN), dpi=DOTS_PER_INCH, layout="compressed")
    axes = figure.add_subplot()
    _draw_recording(axes, recording)
    look_of = dict(looks(estimates, palette))
    for names in distinct(recording, estimates):
        name, look = joined(names), look_of[names[0]]
        path = estimates[names[0]].position_m[:, :2]
        inside = ((path >= low) & (path <= high)).all()
        label = name if inside else f"{name} (leaves the picture)"
        shown = np.where(np.isfinite(path) & (np.abs(path - low) < 1e3 * span), path, np.nan)
        axes.plot(*shown.T, color=look.colour, linestyle=look.line, linewidth=1.2, label=label, zorder=4)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="East [m]", ylabel="North [m]")
    axes.set_title(literal(recording.name))
    axes.set_aspect("equal", adjustable="box")
    quiet(axes)
    legend_below(figure)
    return figure


def distinct(recording: Recording, estimates: Mapping[str, Estimate]) -> list[list[str]]:
    """Return the names of the estimates in groups whose position errors coincide; without a reference each alone."""
    if recording.reference.enu_m is None:
        return [[name] for name in estimates]
    return coinciding({name: position_error_length_m(estimate, recording) for name, estimate in estimates.items()})


def _draw_recording(axes: Axes, recording: Recording) -> None:
    """Draw the fixes, the reference, and where it was without aiding."""
    if recording.position is not None:
        fixes = recording.position.enu_m[:, :2]
        axes.plot(*fixes.T, ".", color=MEASURED, markersize=2.5, alpha=0.5, label="measured", zorder=1)
    truth = recording.reference.enu_m
    if truth is None:
        return
    if len(recording.outages_s):
        dark = np.where(_in_outage(recording)[:, None], truth[:, :2], np.nan)
        axes.plot(*dark.T, color=OUTAGE, linewidth=7.0, alpha=0.7, solid_capstyle="round", label="outage", zorder=2)
    axes.plot(*truth[:, :2].T, color=REFERENCE, linewidth=1.6, label="reference", zorder=3)
    known = np.flatnonzero(np.isfinite(truth[:, :2]).all(axis=1))
    axes.plot(*truth[known[:1], :2].T, "o", color=REFERENCE, markersize=5, label="start", zorder=5)


def _in_outage(recording: Recording) -> BoolArray:
    t_s = recording.reference.t_s[:, None]
    return np.asarray(((t_s >= recording.outages_s[:, 0]) & (t_s < recording.outages_s[:, 1])).any(axis=1))


def _window(recording: Recording, estimates: Mapping[str, Estimate]) -> tuple[FloatArray, FloatArray]:
    """Return the corners (2,), (2,) of what is shown: where the reference was, and some room around it."""
    truth = recording.reference.enu_m
    paths = [estimate.position_m for estimate in estimates.values()] if truth is None else [truth]
    points = np.vstack([np.zeros((0, 3)), *paths])[:, :2]
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        points = np.zeros((1, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    room = max(0.08 * float((high - low).max()), 0.5)
    return low - room, high + room
