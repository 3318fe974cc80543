"""The gallery: figures of each disturbance on a simulated drive, and of each adaptation under faults."""

import io
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure
from panels import changed, draw

from jerkbench import api
from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.recording import Recording

DRIVE = {"name": "field_white", "duration_s": 80.0, "imu_rate_hz": 20.0, "reference_rate_hz": 20.0}
"""A short drive with low sample rates, so that all figures take seconds."""

SEED = 3
GNSS = ["multipath_single_axis", {"name": "noise_step", "times_s": [60.0]}]
"""The faults in the figures of adaptations."""

GREY, COLOUR = "0.65", "C0"


def disturbance_figures(names: Sequence[str]) -> dict[str, bytes]:
    """Return a figure of each disturbance with the measurements that it changes."""
    drive = api.load(DRIVE, SEED)
    return {name: _png(_disturbance_figure(drive, api.disturb(drive, name, SEED))) for name in names}


def adaptation_figures(names: Sequence[str]) -> dict[str, bytes]:
    """Return a figure of each adaptation with the error of the filter and the R that it used."""
    drive = api.disturb(api.load(DRIVE, SEED), GNSS, SEED)
    plain = _run(drive, "none")
    return {name: _png(_adaptation_figure(drive, plain, _run(drive, name))) for name in names}


FIGURES: dict[str, Callable[[Sequence[str]], dict[str, bytes]]] = {
    "disturbance": disturbance_figures,
    "adaptation": adaptation_figures,
}
"""Functions that draw the figures of a kind."""


def _run(drive: Recording, adaptation: str) -> Estimate:
    return api.estimate(drive, filter="baseline", adaptation=adaptation, engine="filterpy")


def _disturbance_figure(before: Recording, after: Recording) -> Figure:
    panels = changed(before, after)
    figure = Figure(figsize=(6.4, 1.0 + 1.6 * len(panels)))
    figure.subplots_adjust(left=0.14, right=0.98, top=0.98, bottom=0.45 / (1.0 + 1.6 * len(panels)))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for ax, panel in zip(axes, panels, strict=True):
        draw(ax, panel, before, after)
    axes[-1].set_xlabel("time [s]")
    return figure


def _adaptation_figure(drive: Recording, plain: Estimate, adapted: Estimate) -> Figure:
    figure = Figure(figsize=(6.4, 4.2))
    figure.subplots_adjust(left=0.14, right=0.98, top=0.98, bottom=0.11)
    errors, inflation = figure.subplots(2, 1, sharex=True)
    for estimate, colour, name in ((plain, GREY, "none"), (adapted, COLOUR, "adapted")):
        errors.semilogy(*_error(drive, estimate), color=colour, label=name)
    errors.set_ylabel("position error [m]")
    errors.legend(loc="upper left", fontsize="x-small")
    ratios = _sigma_ratios(plain, adapted)
    for column, name in zip(ratios.T, ("east", "north", "up"), strict=True):
        inflation.semilogy(adapted.updates.t_s, column, ".", markersize=3, label=name)
    inflation.set(ylabel="sigma used / reported", xlabel="time [s]")
    inflation.legend(loc="upper left", ncols=3, fontsize="x-small")
    return figure


def _error(drive: Recording, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    truth = drive.reference
    error = estimate.position_m - truth.enu_m[estimate.index]
    return truth.t_s[estimate.index], np.linalg.norm(error, axis=1)


def _sigma_ratios(plain: Estimate, adapted: Estimate) -> FloatArray:
    """Return (m, 3) the used divided by the reported standard deviation; NaN for rejected measurements."""
    used, reported = adapted.updates.R_diagonal[:, :3], plain.updates.R_diagonal[: len(adapted.updates.t_s), :3]
    return np.sqrt(np.where(np.isfinite(used), used, np.nan) / reported)


def _png(figure: Figure) -> bytes:
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=80)
    return drawn.getvalue()
