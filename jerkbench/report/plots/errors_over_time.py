"""The figure of the position error over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_length_m, position_error_m, rms_norm
from jerkbench.recording import Recording
from jerkbench.report.plots.style import DOTS_PER_INCH, OKABE_ITO, OUTAGE, legend_below, lines, quiet, say
from jerkbench.report.tables.table_model import number

LOGARITHMIC_FROM = 30.0
"""The error's axis is logarithmic where the largest error is so many times the best filter's median."""

BAND = "±3σ"  # noqa: RUF001 - sigma is the sign of a standard deviation


def error_figure(recording: Recording, estimates: Mapping[str, Estimate], panels: int | None = None) -> Figure:
    """Draw the length of the position error [m] over time [s], with each estimate's RMSE over the scored stamps.

    That RMSE counts the burn-in too, as the line shows it: it is the tables' `position_rmse_whole_m`.

    A single estimate also gets its errors east, north and up, with the three sigmas that it claims, unless ``panels``
    is 1.
    """
    single = len(estimates) == 1 and recording.reference.enu_m is not None and panels != 1
    panels = 4 if single else 1
    figure = Figure(figsize=(7.0, 7.5 if single else 3.2), dpi=DOTS_PER_INCH, layout="constrained")
    ratios = [1.5, 1.0, 1.0, 1.0][:panels]
    top, *below = figure.subplots(panels, 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    _draw_norms(top, recording, estimates)
    top.set_title(recording.name)
    for estimate in estimates.values():
        for axis, axes in enumerate(below):
            _draw_axis(axes, recording, estimate, axis)
    for axes in (top, *below):
        _shade(axes, recording, "outage" if axes is top else None)
        quiet(axes)
    (below or [top])[-1].set_xlabel("Time [s]")
    figure.align_ylabels()
    legend_below(figure)
    return figure


def _draw_norms(axes: Axes, recording: Recording, estimates: Mapping[str, Estimate]) -> None:
    axes.set_ylabel("Position error [m]")
    if recording.reference.enu_m is None:
        say(axes, "The recording has no position reference.")
        return
    norms = {name: position_error_length_m(estimate, recording) for name, estimate in estimates.items()}
    for place, (name, colour, dash) in enumerate(lines(estimates)):
        t_s = recording.reference.t_s[estimates[name].index]
        label = f"{name}: {_rmse(recording, estimates[name])}"
        above = 3 - 0.01 * place  # the first on top
        axes.plot(t_s, norms[name], color=colour, linestyle=dash, linewidth=1.0, label=label, zorder=above)
    if _spread(norms) > LOGARITHMIC_FROM:
        lowest = [np.percentile(norm[norm > 0], 1) for norm in norms.values() if (norm > 0).any()]
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5 * min(lowest))
    else:
        axes.set_ylim(bottom=0.0)


def _rmse(recording: Recording, estimate: Estimate) -> str:
    rows = recording.reference.scored[estimate.index] & known(recording.reference.enu_m, estimate)
    rmse_m = rms_norm(position_error_m(estimate, recording)[rows])
    return f"RMSE with burn-in {number(rmse_m)} m" if np.isfinite(rmse_m) else "no finite RMSE"


def _spread(norms: Mapping[str, FloatArray]) -> float:
    """Return how many times the best median the largest error is."""
    kept = [norm[np.isfinite(norm) & (norm > 0)] for norm in norms.values()]
    kept = [norm for norm in kept if len(norm)]
    return max(norm.max() for norm in kept) / min(float(np.median(norm)) for norm in kept) if kept else 1.0


def _draw_axis(axes: Axes, recording: Recording, estimate: Estimate, axis: int) -> None:
    """Draw the error of one axis and the band of three sigmas; the error decides what is shown."""
    t_s = recording.reference.t_s[estimate.index]
    error = position_error_m(estimate, recording)[:, axis]
    error = np.where(np.isfinite(error), error, np.nan)
    with np.errstate(invalid="ignore"):
        three_sigma = 3 * np.sqrt(estimate.covariance[:, axis, axis])
    axes.fill_between(
        t_s, -three_sigma, three_sigma, color=OKABE_ITO[5], alpha=0.5, linewidth=0, label=BAND if axis == 0 else None
    )
    axes.plot(t_s, error, color=OKABE_ITO[0], linewidth=0.9)
    axes.set_ylabel(f"{('East', 'North', 'Up')[axis]} error [m]")
    seen = [1.3 * np.abs(error[~np.isnan(error)]).max(initial=0.0)]
    seen += [1.6 * float(np.median(sigma)) for sigma in (three_sigma[np.isfinite(three_sigma)],) if len(sigma)]
    if max(seen) > 0:
        axes.set_ylim(-max(seen), max(seen))


def _shade(axes: Axes, recording: Recording, label: str | None) -> None:
    """Shade the outages; the first of them carries the label."""
    for k, (begin, end) in enumerate(recording.outages_s):
        axes.axvspan(begin, end, color=OUTAGE, alpha=0.28, linewidth=0, label=label if k == 0 else None, zorder=0)
