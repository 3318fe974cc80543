"""The figure of the position error around a disturbance (the paper's Fig. 2)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import position_error_m
from jerkbench.recording import Recording
from jerkbench.report.plots.errors_over_time import error_figure
from jerkbench.report.plots.palette import Palette
from jerkbench.report.plots.style import literal

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
        with np.errstate(over="ignore", invalid="ignore"):
            row[estimate.index] = np.sqrt(np.sum(position_error_m(estimate, recording) ** 2, axis=1))
    known = np.isfinite(norms).all(axis=0) & recording.reference.scored & (t_s >= t_s[0] + HALF_WIDTH_S)
    if not known.any():
        return float(t_s[0]), float(t_s[-1])
    spread = np.where(known, np.nanmax(np.where(known, norms, 0.0), axis=0), -1.0)
    centre = float(t_s[int(np.argmax(spread))])
    return max(float(t_s[0]), centre - HALF_WIDTH_S), min(float(t_s[-1]), centre + HALF_WIDTH_S)
