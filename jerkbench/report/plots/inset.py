"""The figure of a trajectory with a part of it enlarged (the paper's Fig. 5)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.recording import Recording
from jerkbench.report.plots.style import MEASURED, REFERENCE, lines, quiet
from jerkbench.report.plots.trajectory import trajectory_figure

INSET_IN = 3.5
"""Height of the enlarged part, which is twice as wide as high [inch]."""

LEAST_M = 0.2
"""Half the width of what is enlarged is five times the largest error, and at least this."""


def inset_trajectory_figure(recording: Recording, estimates: Mapping[str, Estimate]) -> Figure:
    """Draw the trajectory from above, and below it enlarged where the horizontal errors are largest."""
    figure = trajectory_figure(recording, estimates)
    main = figure.axes[0]
    truth = recording.reference.enu_m
    if truth is None:
        return figure
    width_m = float(np.ptp(main.get_xlim()))
    middle, worst_m = _place(recording, truth, estimates, width_m)
    half = min(max(LEAST_M, 5.0 * worst_m), width_m / 2)
    above_in = figure.get_figheight()
    figure.set_figheight(above_in + INSET_IN)
    figure.set_layout_engine("constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=[above_in, INSET_IN])
    main.set_subplotspec(grid[0])
    inset = figure.add_subplot(grid[1])
    if recording.position is not None:
        inset.plot(*recording.position.enu_m[:, :2].T, ".", color=MEASURED, markersize=4.0, alpha=0.6, zorder=1)
    for name, colour, dash in lines(estimates):
        path = estimates[name].position_m[:, :2]
        near = np.abs(path - middle).max(axis=1) < 20 * half
        inset.plot(*np.where(near[:, None], path, np.nan).T, color=colour, linestyle=dash, linewidth=1.4, zorder=4)
    inset.plot(*truth[:, :2].T, color=REFERENCE, linewidth=1.8, zorder=3)
    inset.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half / 2, middle[1] + half / 2))
    inset.set(xlabel="East [m]", ylabel="North [m]", aspect="equal")
    quiet(inset)
    main.indicate_inset_zoom(inset, edgecolor="black")
    return figure


def _place(
    recording: Recording, truth: FloatArray, estimates: Mapping[str, Estimate], width_m: float
) -> tuple[FloatArray, float]:
    """Return where the horizontal errors are largest (of those that fit into the picture), and how large."""
    worst = np.zeros(len(truth))
    for one in estimates.values():
        with np.errstate(over="ignore", invalid="ignore"):
            error = np.linalg.norm((one.position_m - truth[one.index])[:, :2], axis=1)
        fits = np.isfinite(error) & (error < width_m / 4) & recording.reference.scored[one.index]
        worst[one.index] = np.maximum(worst[one.index], np.where(fits, error, 0.0))
    row = int(np.argmax(np.where(np.isfinite(truth[:, :2]).all(axis=1), worst, -1.0)))
    return np.asarray(truth[row, :2]), float(worst[row])
