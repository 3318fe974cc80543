"""Figures of what a filter believes: NEES and NIS with the band of a consistent filter, the adapted R."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m, velocity_error_mps
from jerkbench.evaluation.statistics.consistency import chi2_band
from jerkbench.recording import Recording
from jerkbench.report.plots.curves import coinciding, joined, thinned, with_gaps
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import (
    MEASURED,
    SIGMAS,
    end_with,
    legend_below,
    literal,
    new_figure,
    quiet,
    say,
    shade_outages,
)

WINDOW = 21
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


AXES = ("East", "North", "Up")


def adapted_r_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw the square roots of R's diagonal: position [m] on the left, velocity [m/s] on the right.

    Methods that use the same R are one line, with all their names.

    A row that was dropped (an infinite variance) stands as a tick on the upper edge.
    """
    figure = new_figure(6.0)
    panels = figure.subplots(3, 2, sharex=True)
    figure.suptitle(literal(recording.name), fontsize="medium")
    look_of = dict(looks(estimates, palette))
    groups = coinciding({name: np.sqrt(estimate.updates.R_diagonal) for name, estimate in estimates.items()})
    for row in range(6):
        axes = panels[row % 3][row // 3]
        for names in groups:
            updates, look = estimates[names[0]].updates, look_of[names[0]]
            sigma = np.sqrt(updates.R_diagonal[:, row])
            known, dropped = np.isfinite(sigma), np.isinf(sigma)
            label = joined(names) if row == 0 else None
            curve = thinned(*with_gaps(updates.t_s, np.where(known, sigma, np.nan)))
            axes.plot(*curve, color=look.colour, linestyle=look.line, linewidth=1.0, label=label)
            axes.plot(
                updates.t_s[dropped],
                np.full(int(dropped.sum()), 0.97),
                "|",
                color=look.colour,
                markersize=4.0,
                transform=axes.get_xaxis_transform(),
            )
        shade_outages(axes, recording.outages_s)
        unit, quantity = ("m", "position") if row < 3 else ("m/s", "velocity")
        axes.set_ylabel(f"{AXES[row % 3]} {quantity},\nsigma of R [{unit}]", fontsize=8)
        end_with(axes, recording.reference.t_s)
        if any(np.isfinite(estimate.updates.R_diagonal[:, row]).any() for estimate in estimates.values()):
            axes.set_yscale("log")
        quiet(axes)
    for axes in panels[2]:
        axes.set_xlabel("Time [s]")
    legend_below(figure)
    return figure
