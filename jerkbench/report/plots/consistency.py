"""The figure of NEES and NIS over time, each with the band of a consistent filter."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m, velocity_error_mps
from jerkbench.evaluation.statistics.consistency import chi2_band
from jerkbench.recording import Recording
from jerkbench.report.plots.curves import thinned
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import DOTS_PER_INCH, MEASURED, SIGMAS, end_with, legend_below, literal, quiet, say

WINDOW = 21
"""Updates over which NIS is averaged; odd."""


def consistency_figure(runs: Sequence[tuple[Recording, Estimate]], name: str, palette: Palette | None = None) -> Figure:
    """Draw NEES, averaged over the runs, and NIS per row, averaged over `WINDOW` updates too.

    NEES is of position and velocity; of the position alone where no velocity is known.
    The band is the 95 % interval of chi-square at one moment: a consistent filter is outside it for 5 % of the time.
    All runs must have the same reference stamps; of the updates those with the same number are averaged.
    """
    figure = Figure(figsize=(7.0, 5.0), dpi=DOTS_PER_INCH, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    recording = runs[0][0]
    above.set_title(literal(f"{recording.name}: {name}, {len(runs)} {'run' if len(runs) == 1 else 'runs'}"))
    ((_, look),) = looks([name], palette)
    _draw_nees(above, runs, look.colour)
    _draw_nis(below, runs, look.colour)
    end_with(below, recording.reference.t_s)
    below.set_xlabel("Time [s]")
    legend_below(figure)
    return figure


def nees(recording: Recording, estimate: Estimate) -> FloatArray:
    """Return (k,) the NEES of `states`; NaN where the reference is not known or scored, or P is not invertible."""
    m = states(recording)
    error = np.hstack([position_error_m(estimate, recording), velocity_error_mps(estimate, recording)])[:, :m]
    rows = known(recording.reference.enu_m, estimate) & recording.reference.scored[estimate.index]
    if m == 6:
        rows &= known(recording.reference.velocity_mps, estimate)
    values = np.full(len(error), np.nan)
    try:
        root = np.linalg.cholesky(estimate.covariance[rows][:, :m, :m])
    except np.linalg.LinAlgError:
        return values
    with np.errstate(over="ignore", invalid="ignore"):
        values[rows] = np.sum(np.linalg.solve(root, error[rows][:, :, None])[:, :, 0] ** 2, axis=1)
    return values


def states(recording: Recording) -> int:
    """How many states NEES is of: position and velocity, or position alone where no velocity is known."""
    return 3 if recording.reference.velocity_mps is None else 6


def _draw_nees(axes: Axes, runs: Sequence[tuple[Recording, Estimate]], colour: str) -> None:
    reached = min(len(estimate.index) for _, estimate in runs)
    t_s = runs[0][0].reference.t_s[runs[0][1].index[:reached]]
    average = np.mean([nees(*run)[:reached] for run in runs], axis=0)
    m = states(runs[0][0])
    axes.set_ylabel(f"NEES ({m} states)")
    t_s, average = t_s[np.isfinite(average)], average[np.isfinite(average)]
    if len(average) == 0:
        say(axes, "There is no reference of the position, or no covariance.")
        return
    low, high = chi2_band(m, len(runs))
    inside = float(np.mean((average >= low) & (average <= high)))
    axes.axhspan(low, high, color=SIGMAS, linewidth=0, label="95 % of a consistent filter")
    label = f"NEES: {100 * inside:.0f} % of the time inside"
    axes.plot(*thinned(t_s, average), color=colour, linewidth=0.8, label=label)
    axes.set_yscale("log")
    quiet(axes)


def _draw_nis(axes: Axes, runs: Sequence[tuple[Recording, Estimate]], colour: str) -> None:
    updates = [estimate.updates for _, estimate in runs]
    count = min(len(update.t_s) for update in updates)
    axes.set_ylabel("NIS per row")
    if count < WINDOW:
        say(axes, "There are too few updates.")
        return
    rows = np.sum([update.rows[:count] for update in updates], axis=0)
    t_s = updates[0].t_s[:count][WINDOW // 2 : count - WINDOW // 2]
    summed = _moving(rows)
    kinds = (("nis", MEASURED, 2.4, "NIS, reported R"), ("nis_used", colour, 0.9, "NIS, R that was used"))
    for attribute, shade, width, label in kinds:  # the wider one stays visible behind an equal one
        total = np.sum([np.nan_to_num(getattr(update, attribute)[:count], posinf=0.0) for update in updates], axis=0)
        curve = thinned(t_s, _moving(total) / np.maximum(summed, 1))
        axes.plot(*curve, color=shade, linewidth=width, label=label)
    low, high = np.array([chi2_band(1, max(n, 1)) for n in np.unique(summed)]).T[
        :, np.searchsorted(np.unique(summed), summed)
    ]
    axes.fill_between(t_s, low, high, color=SIGMAS, linewidth=0)
    axes.set_yscale("log")
    quiet(axes)


def _moving(values: FloatArray) -> FloatArray:
    """Return the sums over `WINDOW` values in a row."""
    return np.convolve(values, np.ones(WINDOW), mode="valid")
