"""The figure of the adapted measurement noise, axis by axis."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from jerkbench.estimate import Estimate
from jerkbench.recording import Recording
from jerkbench.report.plots.curves import coinciding, joined, thinned, with_gaps
from jerkbench.report.plots.palette import Palette, looks
from jerkbench.report.plots.style import DOTS_PER_INCH, OUTAGE, end_with, legend_below, literal, quiet

AXES = ("East", "North", "Up")


def adapted_r_figure(recording: Recording, estimates: Mapping[str, Estimate], palette: Palette | None = None) -> Figure:
    """Draw the square roots of R's diagonal: position [m] on the left, velocity [m/s] on the right.

    Methods that use the same R are one line, with all their names.

    A row that was dropped (an infinite variance) stands as a tick on the upper edge.
    """
    figure = Figure(figsize=(7.0, 6.0), dpi=DOTS_PER_INCH, layout="constrained")
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
        for begin, end in recording.outages_s:
            axes.axvspan(begin, end, color=OUTAGE, alpha=0.28, linewidth=0, zorder=0)
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
