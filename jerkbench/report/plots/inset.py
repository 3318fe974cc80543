"""The figure of a trajectory with a part of it enlarged (the paper's Fig. 5)."""

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.recording import Recording
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import MEASURED, REFERENCE, quiet
from jerkbench.report.plots.trajectory import distinct, trajectory_figure
from jerkbench.report.tables.table_model import number

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
    middle = np.clip(middle, *_inner(main, half))  # the box stays inside the axes
    above_in = figure.get_figheight()
    figure.set_figheight(above_in + INSET_IN)
    figure.set_layout_engine("constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=[above_in, INSET_IN])
    main.set_subplotspec(grid[0])
    inset = figure.add_subplot(grid[1])
    if recording.position is not None:
        inset.plot(*recording.position.enu_m[:, :2].T, ".", color=MEASURED, markersize=4.0, alpha=0.6, zorder=1)
    look_of = dict(looks(estimates, palette))
    for name, *_ in distinct(recording, estimates):
        path, look = estimates[name].position_m[:, :2], look_of[name]
        near = np.abs(path - middle).max(axis=1) < 20 * half
        inset.plot(
            *np.where(near[:, None], path, np.nan).T, color=look.colour, linestyle=look.line, linewidth=1.4, zorder=4
        )
    inset.plot(*truth[:, :2].T, color=REFERENCE, linewidth=1.8, zorder=3)
    inset.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half / 2, middle[1] + half / 2))
    inset.set(xlabel="East [m]", ylabel="North [m]", aspect="equal")
    inset.set_title(f"Enlarged {number(width_m / (2 * half))} times", fontsize="medium")
    quiet(inset)
    _draw_scale(inset, 2 * half)
    main.indicate_inset_zoom(inset, edgecolor="black")
    return figure


def _inner(axes: Axes, half: float) -> tuple[FloatArray, FloatArray]:
    """Return the corners (2,), (2,) between which the middle of a box may lie, ``half`` to each side, half that up."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    return np.array([left + half, bottom + half / 2]), np.array([right - half, top - half / 2])


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
