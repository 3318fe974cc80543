"""Figures of consistency (NEES, NIS, adapted noise) and of attitude."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import euler_error_rad, known, position_error_m, rms_norm, velocity_error_mps
from jerkbench.evaluation.metrics.consistency import squared_distances
from jerkbench.evaluation.over_seeds import chi2_band
from jerkbench.recording import Recording
from jerkbench.report.plots.style import (
    BAND_COLOUR,
    MEASURED,
    REFERENCE,
    Palette,
    coinciding,
    draw_ticks,
    finished,
    method_styles,
    panels_over_time,
    say,
    shade_outages,
    with_gaps,
)
from jerkbench.report.table_model import number

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

    Methods with the same R have one common line, whose label contains the names of all these methods. A tick at the
    upper edge marks an update in which the adaptation dropped this measurement (infinite variance).
    """
    figure, panels = panels_over_time(recording.name, 6.0, 3, 2)
    style_of = dict(method_styles(estimates, palette))
    groups = coinciding({name: np.sqrt(estimate.updates.R_diagonal) for name, estimate in estimates.items()})
    for row, axes in enumerate(panels):
        for names in groups:
            updates, style = estimates[names[0]].updates, style_of[names[0]]
            sigma = np.sqrt(updates.R_diagonal[:, row])
            known, dropped = np.isfinite(sigma), np.isinf(sigma)
            label = " = ".join(names) if row == 0 else None
            curve = with_gaps(updates.t_s, np.where(known, sigma, np.nan))
            axes.plot(*curve, **style.stroke, linewidth=1.0, label=label)
            draw_ticks(axes, updates.t_s[dropped], 0.97, style.colour)
        shade_outages(axes, recording.outages_s)
        unit, quantity = ("m", "position") if row < 3 else ("m/s", "velocity")
        axes.set_ylabel(f"{_AXES[row % 3]} {quantity},\nsigma of R [{unit}]", fontsize=8)
        if any(np.isfinite(estimate.updates.R_diagonal[:, row]).any() for estimate in estimates.values()):
            axes.set_yscale("log")
    return finished(figure, recording.reference.t_s)


# The figure of roll and pitch over time (Fig. 4 of the paper).

_ANGLES = ("Roll", "Pitch")


def tilt_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw estimated roll and pitch [deg] and the reference over time.

    The legend contains the RMSE of both angles over the scored time stamps.
    """
    reference = recording.reference
    missing = ": no reference of the attitude" if reference.euler_rad is None else ""
    figure, panels = panels_over_time(recording.name + missing, 4.2, 2)
    for axis, axes in enumerate(panels):
        for name, style in method_styles(estimates, palette):
            t_s, angle_deg = reference.t_s[estimates[name].index], np.degrees(estimates[name].euler_rad[:, axis])
            label = f"{name}{_tilt_rmse(recording, estimates[name])}" if axis == 0 else None
            axes.plot(t_s, angle_deg, **style.stroke, linewidth=1.0, label=label)
        if reference.euler_rad is not None:
            label, angle_deg = "reference" if axis == 0 else None, np.degrees(reference.euler_rad[:, axis])
            axes.plot(reference.t_s, angle_deg, color=REFERENCE, linewidth=0.6, label=label)
        axes.set_ylabel(f"{_ANGLES[axis]} [deg]")
    return finished(figure, reference.t_s)


def _tilt_rmse(recording: Recording, estimate: Estimate) -> str:
    """Return the RMSE of roll and pitch as text, or an empty text if the recording has no attitude reference."""
    rmses = []
    for axis, angle in enumerate(_ANGLES):
        rows = known(recording.reference.euler_rad, estimate, (axis,)) & recording.reference.scored[estimate.index]
        rmse_rad = rms_norm(euler_error_rad(estimate, recording)[rows][:, [axis]])
        rmses += [f"{angle.lower()} {number(float(np.degrees(rmse_rad)))}"] * bool(rows.any())
    return f": RMSE {', '.join(rmses)} deg" if rmses else ""
