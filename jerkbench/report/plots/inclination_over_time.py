"""The figure of the inclination's error over time, for runs that estimate the attitude only."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import inclination_error_rad, rms_norm
from jerkbench.recording import Recording
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import DOTS_PER_INCH, end_with, legend_below, literal, quiet
from jerkbench.report.tables.table_model import number


def inclination_figure(
    recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None
) -> Figure:
    """Draw the error of the inclination [deg] over time [s]; thin where it is not scored, RMSE over what is."""
    figure = Figure(figsize=(7.0, 3.2), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    for name, look in looks(estimates, palette):
        colour, dash = look.colour, look.line
        index = estimates[name].index
        t_s, scored = recording.reference.t_s[index], recording.reference.scored[index]
        error_deg = np.degrees(inclination_error_rad(estimates[name], recording))
        rmse_deg = rms_norm(error_deg[scored & np.isfinite(error_deg), None])
        axes.plot(t_s, error_deg, color=colour, linestyle=dash, linewidth=0.5, alpha=0.6)
        shown = np.where(scored, error_deg, np.nan)
        axes.plot(t_s, shown, color=colour, linestyle=dash, linewidth=1.2, label=f"{name}: RMSE {number(rmse_deg)} deg")
    axes.set(xlabel="Time [s]", ylabel="Inclination error [deg]", title=literal(recording.name))
    axes.set_ylim(bottom=0.0)
    end_with(axes, recording.reference.t_s)
    quiet(axes)
    legend_below(figure)
    return figure
