"""Figures of the attitude: the tilt against the truth (the paper's Fig. 4), the compensated acceleration (Fig. 6)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.navigation_errors import euler_error_rad, known
from jerkbench.recording import Recording
from jerkbench.report.plots.curves import thinned
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import MEASURED, REFERENCE, end_with, legend_below, literal, new_figure, quiet
from jerkbench.report.tables.table_model import number

ANGLES = ("Roll", "Pitch")


def tilt_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw roll and pitch [deg] over time with the reference's, and their RMSE [deg] over the scored stamps as bars.

    Without a reference of the attitude there are no bars.
    """
    judged = recording.reference.euler_rad is not None
    figure = new_figure(6.0 if judged else 4.2)
    panels = figure.subplot_mosaic("RR;PP;rp" if judged else "R;P")
    panels["R"].set_title(literal(recording.name) + ("" if judged else ": no reference of the attitude"))
    for axis, letter in enumerate("RP"):
        _draw_angle(panels[letter], recording, estimates, axis, palette)
        if judged:
            _draw_bars(panels[letter.lower()], recording, estimates, axis, palette)
    panels["P"].sharex(panels["R"])
    end_with(panels["P"], recording.reference.t_s)
    panels["P"].set_xlabel("Time [s]")
    legend_below(figure)
    return figure


def _draw_angle(
    axes: Axes, recording: Recording, estimates: Mapping[str, Estimate], axis: int, palette: Palette | None
) -> None:
    axes.set_ylabel(f"{ANGLES[axis]} [deg]")
    truth = recording.reference.euler_rad
    named = axis == 0
    for name, look in looks(estimates, palette):
        estimate = estimates[name]
        curve = thinned(recording.reference.t_s[estimate.index], np.degrees(estimate.euler_rad[:, axis]))
        label = name if named else None
        axes.plot(*curve, color=look.colour, linestyle=look.line, linewidth=1.0, label=label)
    if truth is not None:
        label = "reference" if named else None
        curve = thinned(recording.reference.t_s, np.degrees(truth[:, axis]))
        axes.plot(*curve, color=REFERENCE, linewidth=0.6, label=label)
    quiet(axes)


def _draw_bars(
    axes: Axes, recording: Recording, estimates: Mapping[str, Estimate], axis: int, palette: Palette | None
) -> None:
    """Draw one bar an estimate; its value stands on it."""
    axes.set_ylabel(f"{ANGLES[axis]} RMSE [deg]")
    for place, (name, look) in enumerate(looks(estimates, palette)):
        estimate = estimates[name]
        rows = known(recording.reference.euler_rad, estimate, (axis,)) & recording.reference.scored[estimate.index]
        error = euler_error_rad(estimate, recording)[rows][:, axis]
        if len(error):
            rmse_deg = float(np.degrees(np.sqrt(np.mean(error**2))))
            bar = axes.bar([place], [rmse_deg], width=0.6, color=look.colour, hatch=look.hatch, edgecolor="white")
            axes.bar_label(bar, [number(rmse_deg)], fontsize=8)
    axes.set_xticks([])
    axes.set_xlim(-1.0, max(len(estimates), 3))
    quiet(axes)
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
        quiet(axes)
    ticks = attitude.t_s[attitude.triggered]
    if len(ticks):
        panels[2].plot(
            ticks,
            np.full(len(ticks), 0.02),
            "|",
            color=TRIGGERED,
            markersize=4.0,
            transform=panels[2].get_xaxis_transform(),
            label=f"external acceleration seen ({100 * attitude.triggered.mean():.0f} % of samples)",
        )
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
