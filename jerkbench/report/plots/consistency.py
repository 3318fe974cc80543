"""Figures of consistency (NEES, NIS, adapted noise) and of attitude."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import position_error_m, velocity_error_mps
from jerkbench.evaluation.metrics.consistency import squared_distances
from jerkbench.evaluation.over_seeds import chi2_band
from jerkbench.recording import Recording
from jerkbench.report.plots.style import (
    BAND_COLOUR,
    MEASURED,
    Palette,
    draw_ticks,
    finished,
    method_styles,
    panels_over_time,
    say,
    shade_outages,
    with_gaps,
)

_WINDOW = 21
"""Number of successive updates over which NIS is averaged (an odd number)."""


def consistency_figure(runs: Sequence[tuple[Recording, Estimate]], name: str, palette: Palette | None = None) -> Figure:
    """Draw the mean NEES over the runs, and the mean NIS per measured row over the runs and over `_WINDOW` updates.

    If the velocity of the reference is unknown, NEES is computed only from the position error. The band in both panels
    is the 95 % interval of the chi-square distribution. The NEES of a consistent filter is outside this band for 5 % of
    the time. All runs must have the same reference time stamps. The NIS values of updates with the same index are
    averaged.
    """
    recording, count = runs[0][0], f"{len(runs)} {'run' if len(runs) == 1 else 'runs'}"
    figure, (above, below) = panels_over_time(f"{recording.name}: {name}, {count}", 5.0, 2)
    ((_, style),) = method_styles([name], palette)
    _draw_nees(above, runs, style.colour)
    _draw_nis(below, runs, style.colour)
    return finished(figure, recording.reference.t_s)


def nees(recording: Recording, estimate: Estimate) -> FloatArray:
    """Return the NEES (k,) of position and velocity, or only of the position if the reference velocity is unknown.

    The NEES is NaN where the reference is unknown or not scored, and where the covariance P is not positive definite.
    """
    m = 3 if recording.reference.velocity_mps is None else 6
    error = np.hstack([position_error_m(estimate, recording), velocity_error_mps(estimate, recording)])[:, :m]
    scored = recording.reference.scored[estimate.index] & np.isfinite(error).all(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(scored, squared_distances(error, estimate.covariance[:, :m, :m]), np.nan)


def _draw_nees(axes: Axes, runs: Sequence[tuple[Recording, Estimate]], colour: str) -> None:
    reached = min(len(estimate.index) for _, estimate in runs)
    t_s = runs[0][0].reference.t_s[runs[0][1].index[:reached]]
    average = np.mean([nees(*run)[:reached] for run in runs], axis=0)
    m = 3 if runs[0][0].reference.velocity_mps is None else 6
    axes.set_ylabel(f"NEES ({m} states)")
    t_s, average = t_s[np.isfinite(average)], average[np.isfinite(average)]
    if len(average) == 0:
        say(axes, "The reference has no position, or the estimate no covariance.")
        return
    low, high = chi2_band(m, len(runs))
    inside = float(np.mean((average >= low) & (average <= high)))
    axes.axhspan(low, high, color=BAND_COLOUR, linewidth=0, label="95 % of a consistent filter")
    label = f"NEES: {100 * inside:.0f} % of the time inside"
    axes.plot(t_s, average, color=colour, linewidth=0.8, label=label)
    axes.set_yscale("log")


def _draw_nis(axes: Axes, runs: Sequence[tuple[Recording, Estimate]], colour: str) -> None:
    updates = [estimate.updates for _, estimate in runs]
    count = min(len(update.t_s) for update in updates)
    axes.set_ylabel("NIS per row")
    if count < _WINDOW:
        say(axes, "Too few updates.")
        return
    rows = np.sum([update.rows[:count] for update in updates], axis=0)
    t_s = updates[0].t_s[:count][_WINDOW // 2 : count - _WINDOW // 2]
    summed = _moving(rows)
    kinds = (("nis", MEASURED, 2.4, "NIS, reported R"), ("nis_used", colour, 0.9, "NIS, R that was used"))
    for attribute, shade, width, label in kinds:  # a wider line is visible behind a line with equal values
        total = np.sum([np.nan_to_num(getattr(update, attribute)[:count], posinf=0.0) for update in updates], axis=0)
        axes.plot(t_s, _moving(total) / np.maximum(summed, 1), color=shade, linewidth=width, label=label)
    counts, places = np.unique(summed, return_inverse=True)
    bands = np.array([chi2_band(1, max(n, 1)) for n in counts])[places]
    axes.fill_between(t_s, *bands.T, color=BAND_COLOUR, linewidth=0)
    axes.set_yscale("log")


def _moving(values: FloatArray) -> FloatArray:
    """Return the sum of each window of `_WINDOW` successive values."""
    return np.convolve(values, np.ones(_WINDOW), mode="valid")


_AXES = ("East", "North", "Up")


def adapted_r_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw the square roots of the diagonal of R: position [m] on the left, velocity [m/s] on the right.

    A tick at the upper edge marks an update in which the adaptation dropped this measurement (infinite variance).
    """
    figure, panels = panels_over_time(recording.name, 6.0, 3, 2)
    for row, axes in enumerate(panels):
        for name, style in method_styles(estimates, palette):
            updates = estimates[name].updates
            sigma = np.sqrt(updates.R_diagonal[:, row])
            known, dropped = np.isfinite(sigma), np.isinf(sigma)
            label = name if row == 0 else None
            curve = with_gaps(updates.t_s, np.where(known, sigma, np.nan))
            axes.plot(*curve, **style.stroke, linewidth=1.0, label=label)
            draw_ticks(axes, updates.t_s[dropped], 0.97, style.colour)
        shade_outages(axes, recording.outages_s)
        unit, quantity = ("m", "position") if row < 3 else ("m/s", "velocity")
        axes.set_ylabel(f"{_AXES[row % 3]} {quantity},\nsigma of R [{unit}]", fontsize=8)
        if any(np.isfinite(estimate.updates.R_diagonal[:, row]).any() for estimate in estimates.values()):
            axes.set_yscale("log")
    return finished(figure, recording.reference.t_s)
