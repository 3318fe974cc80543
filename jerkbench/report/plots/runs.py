"""Figures of the runs of a scenario: errors over time, of position and inclination, and the trajectory from above."""

import math
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
    MEASURED,
    REFERENCE,
    SHADE,
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
from jerkbench.report.table_model import number

_LOGARITHMIC_FROM = 30.0
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
    top.set(title=literal(recording.name), ylabel="Position error [m]")
    looks = dict(method_styles(estimates, palette))
    if recording.reference.enu_m is None:
        say(top, "The recording has no position reference.")
    else:
        norms = {name: position_error_length_m(estimate, recording) for name, estimate in estimates.items()}
        begin_s, end_s = window_s or (-np.inf, np.inf)
        for place, names in enumerate(coinciding(norms)):
            t_s = recording.reference.t_s[estimates[names[0]].index]
            seen = (t_s >= begin_s) & (t_s <= end_s)
            rmses = dict.fromkeys(_rmse(recording, estimates[each], burn_in_s) for each in names)
            curve = thinned(t_s[seen], norms[names[0]][seen])
            label = f"{' = '.join(names)}: {', '.join(rmses)}"
            order = 3 - 0.01 * place  # the first on top
            top.plot(*curve, **looks[names[0]].stroke, linewidth=1.0, label=label, zorder=order)
        if _spread(norms) > _LOGARITHMIC_FROM:
            lowest = [np.percentile(norm[norm > 0], 1) for norm in norms.values() if (norm > 0).any()]
            top.set_yscale("log")
            top.set_ylim(bottom=0.5 * min(lowest))
        else:
            top.set_ylim(bottom=0.0)
    for name, look in looks.items():
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
    axes.fill_between(edge_s, -edge, edge, color=BAND_COLOUR, linewidth=0, label=BAND if axis == 0 else None)
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


# The figure of a trajectory seen from above, also with a part of it enlarged (the paper's Fig. 5).


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
        axes.plot(*dark.T, color=SHADE, linewidth=7.0, alpha=0.7, solid_capstyle="round", label="outage", zorder=2)
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

MIN_HALF_WIDTH_M = 0.2
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
    half = min(max(MIN_HALF_WIDTH_M, 5.0 * worst_m), widest_m)
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
