"""The figure of the tilt against the truth, with a bar chart of its errors (the paper's Fig. 4)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import euler_error_rad, known
from jerkbench.recording import Recording
from jerkbench.report.plots.style import DOTS_PER_INCH, REFERENCE, legend_below, lines, quiet
from jerkbench.report.tables.table_model import number

ANGLES = ("Roll", "Pitch")


def tilt_figure(recording: Recording, estimates: Mapping[str, Estimate]) -> Figure:
    """Draw roll and pitch [deg] over time with the reference's, and their RMSE [deg] over the scored stamps as bars.

    Without a reference of the attitude there are no bars.
    """
    judged = recording.reference.euler_rad is not None
    figure = Figure(figsize=(7.0, 6.0 if judged else 4.2), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplot_mosaic("RR;PP;rp" if judged else "R;P")
    panels["R"].set_title(recording.name + ("" if judged else ": no reference of the attitude"))
    for axis, letter in enumerate("RP"):
        _draw_angle(panels[letter], recording, estimates, axis)
        if judged:
            _draw_bars(panels[letter.lower()], recording, estimates, axis)
    panels["P"].sharex(panels["R"])
    panels["P"].set_xlabel("Time [s]")
    legend_below(figure)
    return figure


def _draw_angle(axes: Axes, recording: Recording, estimates: Mapping[str, Estimate], axis: int) -> None:
    axes.set_ylabel(f"{ANGLES[axis]} [deg]")
    truth = recording.reference.euler_rad
    named = axis == 0
    for name, colour, dash in lines(estimates):
        one = estimates[name]
        t_s = recording.reference.t_s[one.index]
        label = name if named else None
        axes.plot(t_s, np.degrees(one.euler_rad[:, axis]), color=colour, linestyle=dash, linewidth=1.0, label=label)
    if truth is not None:
        label = "reference" if named else None
        axes.plot(recording.reference.t_s, np.degrees(truth[:, axis]), color=REFERENCE, linewidth=0.6, label=label)
    quiet(axes)


def _draw_bars(axes: Axes, recording: Recording, estimates: Mapping[str, Estimate], axis: int) -> None:
    """Draw one bar an estimate; its value stands on it."""
    axes.set_ylabel(f"{ANGLES[axis]} RMSE [deg]")
    for place, (name, colour, _) in enumerate(lines(estimates)):
        one = estimates[name]
        rows = known(recording.reference.euler_rad, one, (axis,)) & recording.reference.scored[one.index]
        error = euler_error_rad(one, recording)[rows][:, axis]
        if len(error):
            rmse_deg = float(np.degrees(np.sqrt(np.mean(error**2))))
            axes.bar_label(axes.bar([place], [rmse_deg], width=0.6, color=colour), [number(rmse_deg)], fontsize=8)
    axes.set_xticks([])
    axes.set_xlim(-1.0, max(len(estimates), 3))
    quiet(axes)
    axes.margins(y=0.2)
