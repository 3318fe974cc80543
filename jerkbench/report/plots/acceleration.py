"""The figure of the raw and the compensated acceleration (the paper's Fig. 6)."""

import numpy as np
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Attitude
from jerkbench.recording import Recording
from jerkbench.report.plots.curves import thinned
from jerkbench.report.plots.style import DOTS_PER_INCH, MEASURED, end_with, legend_below, literal, quiet

RAW = ("Forward", "Left", "Up")
ENU = ("east", "north", "up")
COMPENSATED, TRIGGERED = "#20405A", "#B00020"
"""Colours that no filter has."""


def acceleration_figure(recording: Recording, attitude: Attitude) -> Figure:
    """Draw the raw specific force [m/s2] of each body axis and, over it, the gravity-compensated one in ENU.

    Where the tilt filter saw an external acceleration, a tick stands on the lower edge.
    """
    figure = Figure(figsize=(7.0, 6.0), dpi=DOTS_PER_INCH, layout="constrained")
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
