"""Figures of consistency (NEES, NIS, adapted noise) and of attitude."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.consistency_verdict import chi2_band
from jerkbench.evaluation.counted_rows import euler_error_rad, known, position_error_m, velocity_error_mps
from jerkbench.recording import Recording
from jerkbench.report.plots.style import (
    BAND_COLOUR,
    MEASURED,
    REFERENCE,
    MethodStyle,
    Palette,
    coinciding,
    draw_ticks,
    end_with,
    legend_below,
    literal,
    method_styles,
    new_figure,
    say,
    shade_outages,
    style_axes,
    thinned,
    with_gaps,
)
from jerkbench.report.table_model import number

_WINDOW = 21
"""Updates over which NIS is averaged; odd."""


def consistency_figure(runs: Sequence[tuple[Recording, Estimate]], name: str, palette: Palette | None = None) -> Figure:
    """Draw NEES, averaged over the runs, and NIS per row, averaged over `WINDOW` updates too.

    NEES is of position and velocity; of the position alone where no velocity is known.
    The band is the 95 % interval of chi-square at one moment: a consistent filter is outside it for 5 % of the time.
    All runs must have the same reference stamps; of the updates those with the same number are averaged.
    """
    figure = new_figure(5.0)
    above, below = figure.subplots(2, 1, sharex=True)
    recording = runs[0][0]
    above.set_title(literal(f"{recording.name}: {name}, {len(runs)} {'run' if len(runs) == 1 else 'runs'}"))
    ((_, look),) = method_styles([name], palette)
    _draw_nees(above, runs, look.colour)
    _draw_nis(below, runs, look.colour)
    end_with(below, recording.reference.t_s)
    below.set_xlabel("Time [s]")
    legend_below(figure)
    return figure


def nees(recording: Recording, estimate: Estimate) -> FloatArray:
    """Return (k,) the NEES of position and velocity, of position alone where no velocity is known.

    NaN where the reference is not known or scored, or P is not invertible.
    """
    m = 3 if recording.reference.velocity_mps is None else 6
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


def _draw_nees(axes: Axes, runs: Sequence[tuple[Recording, Estimate]], colour: str) -> None:
    reached = min(len(estimate.index) for _, estimate in runs)
    t_s = runs[0][0].reference.t_s[runs[0][1].index[:reached]]
    average = np.mean([nees(*run)[:reached] for run in runs], axis=0)
    m = 3 if runs[0][0].reference.velocity_mps is None else 6
    axes.set_ylabel(f"NEES ({m} states)")
    t_s, average = t_s[np.isfinite(average)], average[np.isfinite(average)]
    if len(average) == 0:
        say(axes, "There is no reference of the position, or no covariance.")
        return
    low, high = chi2_band(m, len(runs))
    inside = float(np.mean((average >= low) & (average <= high)))
    axes.axhspan(low, high, color=BAND_COLOUR, linewidth=0, label="95 % of a consistent filter")
    label = f"NEES: {100 * inside:.0f} % of the time inside"
    axes.plot(*thinned(t_s, average), color=colour, linewidth=0.8, label=label)
    axes.set_yscale("log")
    style_axes(axes)


def _draw_nis(axes: Axes, runs: Sequence[tuple[Recording, Estimate]], colour: str) -> None:
    updates = [estimate.updates for _, estimate in runs]
    count = min(len(update.t_s) for update in updates)
    axes.set_ylabel("NIS per row")
    if count < _WINDOW:
        say(axes, "There are too few updates.")
        return
    rows = np.sum([update.rows[:count] for update in updates], axis=0)
    t_s = updates[0].t_s[:count][_WINDOW // 2 : count - _WINDOW // 2]
    summed = _moving(rows)
    kinds = (("nis", MEASURED, 2.4, "NIS, reported R"), ("nis_used", colour, 0.9, "NIS, R that was used"))
    for attribute, shade, width, label in kinds:  # the wider one stays visible behind an equal one
        total = np.sum([np.nan_to_num(getattr(update, attribute)[:count], posinf=0.0) for update in updates], axis=0)
        curve = thinned(t_s, _moving(total) / np.maximum(summed, 1))
        axes.plot(*curve, color=shade, linewidth=width, label=label)
    counts, places = np.unique(summed, return_inverse=True)
    bands = np.array([chi2_band(1, max(n, 1)) for n in counts])[places]
    axes.fill_between(t_s, *bands.T, color=BAND_COLOUR, linewidth=0)
    axes.set_yscale("log")
    style_axes(axes)


def _moving(values: FloatArray) -> FloatArray:
    """Return the sums over `WINDOW` values in a row."""
    return np.convolve(values, np.ones(_WINDOW), mode="valid")


_AXES = ("East", "North", "Up")


def adapted_r_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw the square roots of R's diagonal: position [m] on the left, velocity [m/s] on the right.

    Methods that use the same R are one line, with all their names.

    A row that was dropped (an infinite variance) stands as a tick on the upper edge.
    """
    figure = new_figure(6.0)
    panels = figure.subplots(3, 2, sharex=True)
    figure.suptitle(literal(recording.name), fontsize="medium")
    look_of = dict(method_styles(estimates, palette))
    groups = coinciding({name: np.sqrt(estimate.updates.R_diagonal) for name, estimate in estimates.items()})
    for row in range(6):
        axes = panels[row % 3][row // 3]
        for names in groups:
            updates, look = estimates[names[0]].updates, look_of[names[0]]
            sigma = np.sqrt(updates.R_diagonal[:, row])
            known, dropped = np.isfinite(sigma), np.isinf(sigma)
            label = " = ".join(names) if row == 0 else None
            curve = thinned(*with_gaps(updates.t_s, np.where(known, sigma, np.nan)))
            axes.plot(*curve, **look.stroke, linewidth=1.0, label=label)
            draw_ticks(axes, updates.t_s[dropped], 0.97, look.colour)
        shade_outages(axes, recording.outages_s)
        unit, quantity = ("m", "position") if row < 3 else ("m/s", "velocity")
        axes.set_ylabel(f"{_AXES[row % 3]} {quantity},\nsigma of R [{unit}]", fontsize=8)
        end_with(axes, recording.reference.t_s)
        if any(np.isfinite(estimate.updates.R_diagonal[:, row]).any() for estimate in estimates.values()):
            axes.set_yscale("log")
        style_axes(axes)
    for axes in panels[2]:
        axes.set_xlabel("Time [s]")
    legend_below(figure)
    return figure


# Figures of the attitude: the tilt against the truth (the paper's Fig. 4), the compensated acceleration (Fig. 6).

_ANGLES = ("Roll", "Pitch")


def tilt_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw roll and pitch [deg] over time with the reference's, and their RMSE [deg] over the scored stamps as bars.

    Without a reference of the attitude there are no bars.
    """
    judged = recording.reference.euler_rad is not None
    figure = new_figure(6.0 if judged else 4.2)
    panels = figure.subplot_mosaic("RR;PP;rp" if judged else "R;P")
    panels["R"].set_title(literal(recording.name) + ("" if judged else ": no reference of the attitude"))
    reference, looks = recording.reference, dict(method_styles(estimates, palette))
    for axis, letter in enumerate("RP"):
        axes, named = panels[letter], letter == "R"
        axes.set_ylabel(f"{_ANGLES[axis]} [deg]")
        for name, look in looks.items():
            curve = thinned(reference.t_s[estimates[name].index], np.degrees(estimates[name].euler_rad[:, axis]))
            axes.plot(*curve, **look.stroke, linewidth=1.0, label=name if named else None)
        if reference.euler_rad is not None:
            curve = thinned(reference.t_s, np.degrees(reference.euler_rad[:, axis]))
            axes.plot(*curve, color=REFERENCE, linewidth=0.6, label="reference" if named else None)
        style_axes(axes)
        if judged:
            _draw_bars(panels[letter.lower()], recording, estimates, axis, looks)
    panels["P"].sharex(panels["R"])
    end_with(panels["P"], recording.reference.t_s)
    panels["P"].set_xlabel("Time [s]")
    legend_below(figure)
    return figure


def _draw_bars(
    axes: Axes, recording: Recording, estimates: Mapping[str, Estimate], axis: int, looks: Mapping[str, MethodStyle]
) -> None:
    """Draw one bar an estimate; its value stands on it."""
    axes.set_ylabel(f"{_ANGLES[axis]} RMSE [deg]")
    for place, (name, look) in enumerate(looks.items()):
        estimate = estimates[name]
        rows = known(recording.reference.euler_rad, estimate, (axis,)) & recording.reference.scored[estimate.index]
        error = euler_error_rad(estimate, recording)[rows][:, axis]
        if len(error):
            rmse_deg = float(np.degrees(np.sqrt(np.mean(error**2))))
            bar = axes.bar([place], [rmse_deg], width=0.6, color=look.colour, hatch=look.hatch, edgecolor="white")
            axes.bar_label(bar, [number(rmse_deg)], fontsize=8)
    axes.set_xticks([])
    axes.set_xlim(-1.0, max(len(estimates), 3))
    style_axes(axes)
    axes.margins(y=0.2)


RAW = ("Forward", "Left", "Up")
ENU = ("east", "north", "up")
COMPENSATED, TRIGGERED = "#20405A", "#B00020"
"""Colours that no filter has."""


def acceleration_figure(recording: Recording, attitude: Attitude) -> Figure:
    """Draw the raw specific force [m/s2] of each body axis and, over it, the gravity-compensated one in ENU.

    Where the tilt filter saw an external acceleration, a tick stands on the lower edge.
    """
    figure = new_figure(6.0)
    panels = figure.subplots(3, 1, sharex=True)
    panels[0].set_title(literal(recording.name))
    t_s = recording.inertial.t_s
    for axis, axes in enumerate(panels):
        raw = recording.inertial.accel_mps2[:, axis]
        named = axis == 0
        axes.plot(*thinned(t_s, raw), color=MEASURED, linewidth=0.5, label="raw, body (FLU)" if named else None)
        compensated = attitude.accel_enu_mps2[:, axis]
        label = "compensated, ENU" if named else None
        axes.plot(*thinned(attitude.t_s, compensated), color=COMPENSATED, linewidth=0.6, label=label)
        axes.set_ylabel(f"{RAW[axis]} / {ENU[axis]} [m/s$^2$]")
        axes.set_ylim(*_limits(raw, compensated))
        style_axes(axes)
    ticks = attitude.t_s[attitude.triggered]
    if len(ticks):
        label = f"external acceleration seen ({100 * attitude.triggered.mean():.0f} % of samples)"
        draw_ticks(panels[2], ticks, 0.02, TRIGGERED, label)
    panels[2].set_xlabel("Time [s]")
    end_with(panels[2], t_s)
    figure.align_ylabels()
    legend_below(figure)
    return figure


def _limits(*series: FloatArray) -> tuple[float, float]:
    """Room for all but the rarest spikes: an impact must not flatten the rest."""
    values = np.concatenate([curve[np.isfinite(curve)] for curve in series])
    if len(values) == 0:
        return -1.0, 1.0
    low, high = np.percentile(values, [0.05, 99.95])
    room = 0.15 * max(high - low, 0.1)
    return float(low - room), float(high + room)
