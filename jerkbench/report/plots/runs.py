"""Figures of single runs: errors over time, trajectory, consistency (NEES, NIS) and adapted noise."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import (
    counted_rows,
    inclination_error_rad,
    known,
    position_error_length_m,
    position_error_m,
    rms_norm,
    velocity_error_mps,
)
from jerkbench.evaluation.intervals import chi2_band
from jerkbench.evaluation.metrics.consistency import squared_distances
from jerkbench.recording import Recording
from jerkbench.report.plots.style import (
    BAND_COLOUR,
    LOGARITHMIC_FROM,
    MEASURED,
    REFERENCE,
    SHADE,
    Palette,
    finished,
    legend_below,
    literal,
    method_styles,
    new_figure,
    panels_over_time,
    say,
    shade_outages,
    style_axes,
    with_gaps,
)
from jerkbench.report.table_model import number

_AXES = ("East", "North", "Up")

BAND = "±3σ"  # noqa: RUF001 - sigma is the sign of a standard deviation


def error_figure(
    recording: Recording,
    estimates: Mapping[str, Estimate],
    panels: int | None = None,
    *,
    burn_in_s: float = 0.0,
    palette: Palette | None = None,
) -> Figure:
    """Draw the length of the position error [m] over time [s]. The legend contains the RMSE of each estimate.

    A figure of a single estimate has three more panels with the east, north and up errors and their three-sigma bands,
    unless ``panels`` is 1.

    Args:
        recording: recording whose reference is used.
        estimates: estimate of each method, by the name of the method.
        panels: number of panels. If ``panels`` is 1, only the length of the error is drawn. If ``panels`` is None, all
            available panels are drawn.
        burn_in_s: duration at the start whose errors do not count for the RMSE [s]. If ``burn_in_s`` is the burn-in of
            the protocol, the RMSE equals `position_rmse_m` in the tables.
        palette: colours and line styles of the methods of the study.
    """
    single = len(estimates) == 1 and recording.reference.enu_m is not None and panels != 1
    ratios, height_in = ([1.5, 1.0, 1.0, 1.0], 7.5) if single else ([1.0], 3.2)
    figure, (top, *below) = panels_over_time(recording.name, height_in, len(ratios), height_ratios=ratios)
    top.set_ylabel("Position error [m]")
    styles = dict(method_styles(estimates, palette))
    if recording.reference.enu_m is None:
        say(top, "The recording has no position reference.")
    else:
        t_s = recording.reference.t_s
        norms = {name: position_error_length_m(one, recording) for name, one in estimates.items()}
        for position, (name, style) in enumerate(styles.items()):
            label = f"{name}: {_rmse(recording, estimates[name], burn_in_s)}"
            order = 3 - 0.01 * position  # the first line is on top
            top.plot(t_s[estimates[name].index], norms[name], **style.stroke, linewidth=1.0, label=label, zorder=order)
        if _spread(norms) > LOGARITHMIC_FROM:
            lowest = [np.percentile(norm[norm > 0], 1) for norm in norms.values() if (norm > 0).any()]
            top.set_yscale("log")
            top.set_ylim(bottom=0.5 * min(lowest))
        else:
            top.set_ylim(bottom=0.0)
    for name, style in styles.items():
        for axis, axes in enumerate(below):
            _draw_axis(axes, recording, estimates[name], axis, style.colour)
    for axes in (top, *below):
        shade_outages(axes, recording.outages_s, "outage" if axes is top else None)
    return finished(figure, recording.reference.t_s)


def _rmse(recording: Recording, estimate: Estimate, burn_in_s: float) -> str:
    rows = counted_rows(estimate, recording, burn_in_s) & known(recording.reference.enu_m, estimate)
    rmse_m = rms_norm(position_error_m(estimate, recording)[rows])
    since = f" from {burn_in_s:g} s on" if burn_in_s else ""
    return f"RMSE {number(rmse_m)} m{since}" if np.isfinite(rmse_m) else "no finite RMSE"


def _spread(norms: Mapping[str, FloatArray]) -> float:
    """Return the ratio of the largest error in the figure to the smallest median error of a method."""
    positive = [norm[np.isfinite(norm) & (norm > 0)] for norm in norms.values()]
    positive = [norm for norm in positive if len(norm)]
    return max(norm.max() for norm in positive) / min(float(np.median(norm)) for norm in positive) if positive else 1.0


def _draw_axis(axes: Axes, recording: Recording, estimate: Estimate, axis: int, colour: str) -> None:
    """Draw the position error along one axis and its three-sigma band.

    The range of the vertical axis contains all errors and the median width of the three-sigma band.
    """
    t_s = recording.reference.t_s[estimate.index]
    error = position_error_m(estimate, recording)[:, axis]
    error = np.where(np.isfinite(error), error, np.nan)
    with np.errstate(invalid="ignore"):
        three_sigma = 3 * np.sqrt(estimate.covariance[:, axis, axis])
    axes.fill_between(t_s, -three_sigma, three_sigma, color=BAND_COLOUR, linewidth=0, label=BAND if axis == 0 else None)
    axes.plot(t_s, error, color=colour, linewidth=0.9)
    axes.set_ylabel(f"{_AXES[axis]} error [m]")
    seen = [1.3 * np.abs(error[~np.isnan(error)]).max(initial=0.0)]
    seen += [1.6 * float(np.median(sigma)) for sigma in (three_sigma[np.isfinite(three_sigma)],) if len(sigma)]
    if max(seen) > 0:
        axes.set_ylim(-max(seen), max(seen))


def inclination_figure(
    recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None
) -> Figure:
    """Draw the inclination error [deg] over time [s].

    Rows that are not scored are drawn as a thin line, and are excluded from the RMSE.
    """
    figure, (axes,) = panels_over_time(recording.name, 3.2, 1)
    axes.set_ylabel("Inclination error [deg]")
    for name, style in method_styles(estimates, palette):
        index = estimates[name].index
        t_s, scored = recording.reference.t_s[index], recording.reference.scored[index]
        error_deg = np.degrees(inclination_error_rad(estimates[name], recording))
        rmse_deg = rms_norm(error_deg[scored & np.isfinite(error_deg), None])
        axes.plot(t_s, error_deg, **style.stroke, linewidth=0.5, alpha=0.6)
        shown = np.where(scored, error_deg, np.nan)
        axes.plot(t_s, shown, **style.stroke, linewidth=1.2, label=f"{name}: RMSE {number(rmse_deg)} deg")
    axes.set_ylim(bottom=0.0)
    return finished(figure, recording.reference.t_s)


# The figure of a trajectory from above.


WIDTH_IN = 7.0
LABELS_IN = 0.7
"""Height of the title and the axis labels [inch]."""


def trajectory_figure(
    recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None
) -> Figure:
    """Draw the reference, fixes, outages and all estimates in the plane of east and north [m] with equal axis scales.

    The range of the axes is determined by the reference. The legend marks estimates that leave the range of the axes.
    """
    low, high = _window(recording, estimates)
    span = high - low
    map_in = float(np.clip(WIDTH_IN * span[1] / span[0], 2.5, 7.5))
    figure = new_figure(map_in + LABELS_IN, WIDTH_IN, layout="compressed")
    axes = figure.add_subplot(title=literal(recording.name))
    _draw_recording(axes, recording)
    for name, style in method_styles(estimates, palette):
        path = estimates[name].position_m[:, :2]
        inside = ((path >= low) & (path <= high)).all()
        label = name + ("" if inside else " (leaves the picture)")
        shown = np.where(np.isfinite(path) & (np.abs(path - low) < 1e3 * span), path, np.nan)
        axes.plot(*shown.T, **style.stroke, linewidth=1.2, label=label, zorder=4)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="East [m]", ylabel="North [m]", aspect="equal")
    style_axes(axes)
    legend_below(figure)
    return figure


def _draw_recording(axes: Axes, recording: Recording) -> None:
    """Draw the position fixes and the reference, and highlight the parts of the reference during outages."""
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
        axes.plot(*dark.T, color=SHADE, linewidth=7.0, alpha=0.7, solid_capstyle="round", label="outage", zorder=2)
    axes.plot(*truth[:, :2].T, color=REFERENCE, linewidth=1.6, label="reference", zorder=3)
    known = np.flatnonzero(np.isfinite(truth[:, :2]).all(axis=1))
    axes.plot(*truth[known[:1], :2].T, "o", color=REFERENCE, markersize=5, label="start", zorder=5)


def _window(recording: Recording, estimates: Mapping[str, Estimate]) -> tuple[FloatArray, FloatArray]:
    """Return the lower left and the upper right corner (2,) of the area of the reference plus a margin [m].

    Without a reference, the area contains all estimates.
    """
    truth = recording.reference.enu_m
    paths = [estimate.position_m for estimate in estimates.values()] if truth is None else [truth]
    points = np.vstack([np.zeros((0, 3)), *paths])[:, :2]
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        points = np.zeros((1, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(0.08 * float((high - low).max()), 0.5)
    return low - margin, high + margin


# Figures of the consistency (NEES, NIS) and of the adapted noise.

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
            tick = {"color": style.colour, "markersize": 4.0, "transform": axes.get_xaxis_transform()}
            axes.plot(updates.t_s[dropped], np.full(dropped.sum(), 0.97), "|", **tick)  # type: ignore[arg-type]  # as documented
        shade_outages(axes, recording.outages_s)
        unit, quantity = ("m", "position") if row < 3 else ("m/s", "velocity")
        axes.set_ylabel(f"{_AXES[row % 3]} {quantity},\nsigma of R [{unit}]", fontsize=8)
        if any(np.isfinite(estimate.updates.R_diagonal[:, row]).any() for estimate in estimates.values()):
            axes.set_yscale("log")
    return finished(figure, recording.reference.t_s)
