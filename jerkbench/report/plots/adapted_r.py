"""The figure of the adapted measurement noise, axis by axis."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from jerkbench.estimate import Estimate
from jerkbench.recording import Recording
from jerkbench.report.plots.style import DOTS_PER_INCH, OUTAGE, legend_below, lines, quiet

AXES = ("East", "North", "Up")


def adapted_r_figure(recording: Recording, estimates: Mapping[str, Estimate]) -> Figure:
    """Draw the square roots of R's diagonal: position [m] on the left, velocity [m/s] on the right.

    Where the first lines are covered by the next, they are the same.

    A row that was dropped (an infinite variance) stands as a tick on the upper edge.
    """
    figure = Figure(figsize=(7.0, 6.0), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplots(3, 2, sharex=True)
    figure.suptitle(recording.name, fontsize="medium")
    for row in range(6):
        axes = panels[row % 3][row // 3]
        for place, (name, colour, dash) in enumerate(lines(estimates)):
            updates = estimates[name].updates
            sigma = np.sqrt(updates.R_diagonal[:, row])
            there, dropped = np.isfinite(sigma), np.isinf(sigma)
            label = name if row == 0 else None
            width = 0.8 + 0.8 * (len(estimates) - 1 - place)  # of equal ones each is seen behind the next
            axes.plot(updates.t_s[there], sigma[there], color=colour, linestyle=dash, linewidth=width, label=label)
            axes.plot(
                updates.t_s[dropped],
                np.full(int(dropped.sum()), 0.97),
                "|",
                color=colour,
                markersize=4.0,
                transform=axes.get_xaxis_transform(),
            )
        for begin, end in recording.outages_s:
            axes.axvspan(begin, end, color=OUTAGE, alpha=0.28, linewidth=0, zorder=0)
        unit, what = ("m", "position") if row < 3 else ("m/s", "velocity")
        axes.set_ylabel(f"{AXES[row % 3]} {what} [{unit}]", fontsize=8)
        if any(np.isfinite(one.updates.R_diagonal[:, row]).any() for one in estimates.values()):
            axes.set_yscale("log")
        quiet(axes)
    for axes in panels[2]:
        axes.set_xlabel("Time [s]")
    legend_below(figure)
    return figure
