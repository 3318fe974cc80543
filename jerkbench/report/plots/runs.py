"""Figures of single runs: position and inclination errors over time, and the trajectory from above."""

from collections.abc import Mapping

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
)
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
)
from jerkbench.report.table_model import number

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
    axes.set_ylabel(f"{('East', 'North', 'Up')[axis]} error [m]")
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
