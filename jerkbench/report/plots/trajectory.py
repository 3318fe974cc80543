"""The figure of a trajectory seen from above, also with a part of it enlarged (the paper's Fig. 5)."""

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import position_error_length_m
from jerkbench.recording import Recording
from jerkbench.report.plots.style import (
    MEASURED,
    OUTAGE,
    REFERENCE,
    Palette,
    coinciding,
    legend_below,
    literal,
    method_styles,
    new_figure,
    style_axes,
)
from jerkbench.report.tables.table_model import number

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
    figure = new_figure(map_in + LABELS_IN, WIDTH_IN, layout="compressed")
    axes = figure.add_subplot()
    _draw_recording(axes, recording)
    look_of = dict(method_styles(estimates, palette))
    for names in distinct(recording, estimates):
        name, look = " = ".join(names), look_of[names[0]]
        path = estimates[names[0]].position_m[:, :2]
        inside = ((path >= low) & (path <= high)).all()
        label = name if inside else f"{name} (leaves the picture)"
        shown = np.where(np.isfinite(path) & (np.abs(path - low) < 1e3 * span), path, np.nan)
        axes.plot(*shown.T, **look.stroke, linewidth=1.2, label=label, zorder=4)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="East [m]", ylabel="North [m]")
    axes.set_title(literal(recording.name))
    axes.set_aspect("equal", adjustable="box")
    style_axes(axes)
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
        t_s, (begin_s, end_s) = recording.reference.t_s[:, None], recording.outages_s.T
        inside = ((t_s >= begin_s) & (t_s < end_s)).any(axis=1)
        dark = np.where(inside[:, None], truth[:, :2], np.nan)
        axes.plot(*dark.T, color=OUTAGE, linewidth=7.0, alpha=0.7, solid_capstyle="round", label="outage", zorder=2)
    axes.plot(*truth[:, :2].T, color=REFERENCE, linewidth=1.6, label="reference", zorder=3)
    known = np.flatnonzero(np.isfinite(truth[:, :2]).all(axis=1))
    axes.plot(*truth[known[:1], :2].T, "o", color=REFERENCE, markersize=5, label="start", zorder=5)


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


INSET_IN = 3.5
"""Height of the enlarged part, which is twice as wide as high [inch]."""

LEAST_M = 0.2
"""Half the width of what is enlarged is five times the largest error, and at least this."""

ENLARGED = 4.0
"""It is enlarged so many times at least."""


def inset_trajectory_figure(
    recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None
) -> Figure:
    """Draw the trajectory from above, and below it enlarged where the horizontal errors are largest.

    That is the largest error that is seen when the trajectory is enlarged `ENLARGED` times; larger ones are seen above.
    """
    figure = trajectory_figure(recording, estimates, palette)
    main = figure.axes[0]
    truth = recording.reference.enu_m
    if truth is None:
        return figure
    width_m = float(np.ptp(main.get_xlim()))
    widest_m = width_m / (2 * ENLARGED)
    middle, worst_m = _place(recording, truth, estimates, widest_m / 2)
    half = min(max(LEAST_M, 5.0 * worst_m), widest_m)
    low, high = np.transpose([main.get_xlim(), main.get_ylim()])
    room = np.array([half, half / 2])  # to each side of the middle, so that the box stays inside the axes
    middle = np.clip(middle, low + room, high - room)
    above_in = figure.get_figheight()
    figure.set_figheight(above_in + INSET_IN)
    figure.set_layout_engine("constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=[above_in, INSET_IN])
    main.set_subplotspec(grid[0])
    inset = figure.add_subplot(grid[1])
    if recording.position is not None:
        inset.plot(*recording.position.enu_m[:, :2].T, ".", color=MEASURED, markersize=4.0, alpha=0.6, zorder=1)
    look_of = dict(method_styles(estimates, palette))
    for name, *_ in distinct(recording, estimates):
        path, look = estimates[name].position_m[:, :2], look_of[name]
        near = np.abs(path - middle).max(axis=1) < 20 * half
        inset.plot(*np.where(near[:, None], path, np.nan).T, **look.stroke, linewidth=1.4, zorder=4)
    inset.plot(*truth[:, :2].T, color=REFERENCE, linewidth=1.8, zorder=3)
    inset.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half / 2, middle[1] + half / 2))
    inset.set(xlabel="East [m]", ylabel="North [m]", aspect="equal")
    inset.set_title(f"Enlarged {number(width_m / (2 * half))} times", fontsize="medium")
    style_axes(inset)
    _draw_scale(inset, 2 * half)
    main.indicate_inset_zoom(inset, edgecolor="black")
    return figure


def _draw_scale(axes: Axes, width_m: float) -> None:
    """Draw a bar of a round length, about a fifth of the width, near the lower left corner."""
    decade = 10.0 ** math.floor(math.log10(width_m / 5))
    length_m = max(step * decade for step in (1, 2, 5) if step * decade <= width_m / 5)
    left, bottom = axes.get_xlim()[0] + 0.03 * width_m, axes.get_ylim()[0] + 0.03 * width_m
    axes.plot([left, left + length_m], [bottom, bottom], color=REFERENCE, linewidth=3.0, zorder=6, gid="scale")
    place = {"xytext": (0, 4), "textcoords": "offset points", "zorder": 6}
    axes.annotate(f"{length_m:g} m", (left, bottom), fontsize=8, **place)  # type: ignore[arg-type]  # as documented


def _place(
    recording: Recording, truth: FloatArray, estimates: Mapping[str, Estimate], largest_m: float
) -> tuple[FloatArray, float]:
    """Return where the horizontal errors are largest, of those below ``largest_m``, and how large."""
    worst = np.zeros(len(truth))
    for estimate in estimates.values():
        with np.errstate(over="ignore", invalid="ignore"):
            error = np.linalg.norm((estimate.position_m - truth[estimate.index])[:, :2], axis=1)
        fits = np.isfinite(error) & (error < largest_m) & recording.reference.scored[estimate.index]
        worst[estimate.index] = np.maximum(worst[estimate.index], np.where(fits, error, 0.0))
    row = int(np.argmax(np.where(np.isfinite(truth[:, :2]).all(axis=1), worst, -1.0)))
    return np.asarray(truth[row, :2]), float(worst[row])
