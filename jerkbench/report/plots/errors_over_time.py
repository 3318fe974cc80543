"""Figures of the errors of a run over time: of the position, also around a disturbance, and of the inclination."""

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
    SIGMAS,
    Palette,
    coinciding,
    end_with,
    legend_below,
    literal,
    method_styles,
    new_figure,
    say,
    shade_outages,
    style_axes,
    thinned,
)
from jerkbench.report.tables.table_model import number

LOGARITHMIC_FROM = 30.0
"""The error's axis is logarithmic where the largest error is so many times the best filter's median."""

BAND = "±3σ"  # noqa: RUF001 - sigma is the sign of a standard deviation


def error_figure(
    recording: Recording,
    estimates: Mapping[str, Estimate],
    panels: int | None = None,
    *,
    burn_in_s: float = 0.0,
    window_s: tuple[float, float] | None = None,
    palette: Palette | None = None,
) -> Figure:
    """Draw the length of the position error [m] over time [s], with each estimate's RMSE.

    Lines that coincide are drawn once, with all their names. A single estimate also gets its errors east, north and
    up, with the three sigmas that it claims, unless ``panels`` is 1.

    Args:
        recording: with its reference.
        estimates: by the names of their methods.
        panels: how many; None: as many as there is something to show.
        burn_in_s: the RMSE counts from then on: that of the protocol gives the tables' `position_rmse_m`.
        window_s: begin and end of what is shown; None: all.
        palette: of the study.
    """
    single = len(estimates) == 1 and recording.reference.enu_m is not None and panels != 1
    panels = 4 if single else 1
    figure = new_figure(7.5 if single else 3.2)
    ratios = [1.5, 1.0, 1.0, 1.0][:panels]
    top, *below = figure.subplots(panels, 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    _draw_norms(top, recording, estimates, burn_in_s, window_s or (-np.inf, np.inf), palette)
    top.set_title(literal(recording.name))
    for name, look in method_styles(estimates, palette):
        for axis, axes in enumerate(below):
            _draw_axis(axes, recording, estimates[name], axis, look.colour)
    if window_s is None:
        end_with(top, recording.reference.t_s)
    for axes in (top, *below):
        shade_outages(axes, recording.outages_s, "outage" if axes is top else None)
        style_axes(axes)
    (below or [top])[-1].set_xlabel("Time [s]")
    figure.align_ylabels()
    legend_below(figure)
    return figure


def _draw_norms(
    axes: Axes,
    recording: Recording,
    estimates: Mapping[str, Estimate],
    burn_in_s: float,
    window_s: tuple[float, float],
    palette: Palette | None,
) -> None:
    axes.set_ylabel("Position error [m]")
    if recording.reference.enu_m is None:
        say(axes, "The recording has no position reference.")
        return
    norms = {name: position_error_length_m(estimate, recording) for name, estimate in estimates.items()}
    look_of = dict(method_styles(estimates, palette))
    for place, names in enumerate(coinciding(norms)):
        name = names[0]
        t_s = recording.reference.t_s[estimates[name].index]
        seen = (t_s >= window_s[0]) & (t_s <= window_s[1])
        rmses = dict.fromkeys(_rmse(recording, estimates[each], burn_in_s) for each in names)
        curve, label = thinned(t_s[seen], norms[name][seen]), f"{' = '.join(names)}: {', '.join(rmses)}"
        order = 3 - 0.01 * place  # the first on top
        axes.plot(*curve, **look_of[name].stroke, linewidth=1.0, label=label, zorder=order)
    if _spread(norms) > LOGARITHMIC_FROM:
        lowest = [np.percentile(norm[norm > 0], 1) for norm in norms.values() if (norm > 0).any()]
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5 * min(lowest))
    else:
        axes.set_ylim(bottom=0.0)


def _rmse(recording: Recording, estimate: Estimate, burn_in_s: float) -> str:
    rows = counted_rows(estimate, recording, burn_in_s) & known(recording.reference.enu_m, estimate)
    rmse_m = rms_norm(position_error_m(estimate, recording)[rows])
    since = f" from {burn_in_s:g} s on" if burn_in_s else ""
    return f"RMSE {number(rmse_m)} m{since}" if np.isfinite(rmse_m) else "no finite RMSE"


def _spread(norms: Mapping[str, FloatArray]) -> float:
    """Return how many times the best median the largest error is."""
    kept = [norm[np.isfinite(norm) & (norm > 0)] for norm in norms.values()]
    kept = [norm for norm in kept if len(norm)]
    return max(norm.max() for norm in kept) / min(float(np.median(norm)) for norm in kept) if kept else 1.0


def _draw_axis(axes: Axes, recording: Recording, estimate: Estimate, axis: int, colour: str) -> None:
    """Draw the error of one axis and the band of three sigmas; the error decides what is shown."""
    t_s = recording.reference.t_s[estimate.index]
    error = position_error_m(estimate, recording)[:, axis]
    error = np.where(np.isfinite(error), error, np.nan)
    with np.errstate(invalid="ignore"):
        three_sigma = 3 * np.sqrt(estimate.covariance[:, axis, axis])
    edge_s, edge = thinned(t_s, three_sigma)
    axes.fill_between(edge_s, -edge, edge, color=SIGMAS, linewidth=0, label=BAND if axis == 0 else None)
    axes.plot(*thinned(t_s, error), color=colour, linewidth=0.9)
    axes.set_ylabel(f"{('East', 'North', 'Up')[axis]} error [m]")
    seen = [1.3 * np.abs(error[~np.isnan(error)]).max(initial=0.0)]
    seen += [1.6 * float(np.median(sigma)) for sigma in (three_sigma[np.isfinite(three_sigma)],) if len(sigma)]
    if max(seen) > 0:
        axes.set_ylim(-max(seen), max(seen))


HALF_WIDTH_S = 10.0


def zoomed_error_figure(
    recording: Recording,
    estimates: Mapping[str, Estimate],
    window_s: tuple[float, float],
    *,
    burn_in_s: float = 0.0,
    palette: Palette | None = None,
) -> Figure:
    """Draw the length of the position error [m] within ``window_s``; the vertical axis fits what is seen there."""
    figure = error_figure(recording, estimates, 1, burn_in_s=burn_in_s, window_s=window_s, palette=palette)
    axes = figure.axes[0]
    axes.set_xlim(*window_s)
    axes.set_title(f"{literal(recording.name)}, {window_s[0]:.1f} to {window_s[1]:.1f} s")
    seen = [
        values[(line.get_xdata() >= window_s[0]) & (line.get_xdata() <= window_s[1])]  # type: ignore[operator]  # arrays
        for line in axes.get_lines()
        for values in [np.asarray(line.get_ydata(), dtype=np.float64)]
    ]
    finite = np.concatenate([np.empty(0), *(norm[np.isfinite(norm) & (norm > 0)] for norm in seen)])
    if len(finite):
        bottom = 0.5 * float(np.percentile(finite, 1)) if axes.get_yscale() == "log" else 0.0
        axes.set_ylim(bottom, 1.1 * float(finite.max()))
    return figure


def disturbed_window_s(recording: Recording, estimates: Mapping[str, Estimate]) -> tuple[float, float]:
    """Return the first outage with some room, or else the time around the moment at which the estimates differ most."""
    if len(recording.outages_s):
        begin, end = recording.outages_s[0]
        return float(begin - HALF_WIDTH_S / 2), float(end + HALF_WIDTH_S)
    t_s = recording.reference.t_s  # what is drawn ends with it
    norms = np.full((max(len(estimates), 1), len(t_s)), np.nan)
    for row, estimate in zip(norms, estimates.values(), strict=False):
        row[estimate.index] = position_error_length_m(estimate, recording)
    known = np.isfinite(norms).all(axis=0) & recording.reference.scored & (t_s >= t_s[0] + HALF_WIDTH_S)
    if not known.any():
        return float(t_s[0]), float(t_s[-1])
    spread = np.where(known, np.nanmax(np.where(known, norms, 0.0), axis=0), -1.0)
    centre = float(t_s[int(np.argmax(spread))])
    return max(float(t_s[0]), centre - HALF_WIDTH_S), min(float(t_s[-1]), centre + HALF_WIDTH_S)


def inclination_figure(
    recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None
) -> Figure:
    """Draw the error of the inclination [deg] over time [s]; thin where it is not scored, RMSE over what is."""
    figure = new_figure(3.2)
    axes = figure.add_subplot()
    for name, look in method_styles(estimates, palette):
        index = estimates[name].index
        t_s, scored = recording.reference.t_s[index], recording.reference.scored[index]
        error_deg = np.degrees(inclination_error_rad(estimates[name], recording))
        rmse_deg = rms_norm(error_deg[scored & np.isfinite(error_deg), None])
        axes.plot(t_s, error_deg, **look.stroke, linewidth=0.5, alpha=0.6)
        shown = np.where(scored, error_deg, np.nan)
        axes.plot(t_s, shown, **look.stroke, linewidth=1.2, label=f"{name}: RMSE {number(rmse_deg)} deg")
    axes.set(xlabel="Time [s]", ylabel="Inclination error [deg]", title=literal(recording.name))
    axes.set_ylim(bottom=0.0)
    end_with(axes, recording.reference.t_s)
    style_axes(axes)
    legend_below(figure)
    return figure
