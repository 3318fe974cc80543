"""A picture of a recording: its path, its speed, the IMU's measurements, the receiver's sigmas."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.inspection.noise import longest_rest, rest_noise
from jerkbench.recording import Recording, Velocity
from jerkbench.report.plots.style import DOTS_PER_INCH, MEASURED, OKABE_ITO, OUTAGE, REFERENCE, literal, quiet, say

MOST_POINTS = 4000
"""More points of a line do not show at this size."""


def overview_figure(recording: Recording) -> Figure:
    """Draw six panels: track, speed, specific force, angular rate, stated sigmas, Allan deviation at rest."""
    figure = Figure(figsize=(10.0, 9.0), dpi=DOTS_PER_INCH, layout="constrained")
    track, speed, force, rate, sigma, allan = figure.subplots(3, 2).ravel()
    _draw_track(track, recording)
    _draw_speed(speed, recording)
    for axes, label in ((force, "Specific force [m/s²]"), (rate, "Angular rate [deg/s]")):
        axes.set_ylabel(label)
        if recording.imu is None:
            say(axes, "The recording has no IMU.")
    if recording.imu is not None:
        _draw_imu(force, recording.imu.t_s, recording.imu.accel_mps2)
        _draw_imu(rate, recording.imu.t_s, np.degrees(recording.imu.gyro_radps))
    _draw_sigma(sigma, recording)
    _draw_allan(allan, recording)
    for axes in (speed, force, rate, sigma):
        axes.set_xlabel("Time [s]")
        for begin, end in recording.outages_s:
            axes.axvspan(begin, end, color=OUTAGE, alpha=0.28, linewidth=0)
    for axes in figure.axes:
        quiet(axes)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(frameon=False, fontsize="small")
    figure.suptitle(literal(recording.name))
    return figure


def _thin(t_s: FloatArray, *values: FloatArray) -> tuple[FloatArray, ...]:
    every = max(1, len(t_s) // MOST_POINTS)
    return t_s[::every], *(value[::every] for value in values)


def _draw_track(axes: Axes, recording: Recording) -> None:
    axes.set(xlabel="East [m]", ylabel="North [m]")
    if recording.position is None and recording.reference.enu_m is None:
        say(axes, "The recording has no position.")
        return
    if recording.position is not None:
        axes.plot(*recording.position.enu_m[:, :2].T, ".", color=MEASURED, markersize=4.0, label="measured")
    if recording.reference.enu_m is not None:
        axes.plot(*recording.reference.enu_m[:, :2].T, color=REFERENCE, linewidth=0.8, label="reference")
    axes.set_aspect("equal", adjustable="datalim")


def _draw_speed(axes: Axes, recording: Recording) -> None:
    axes.set_ylabel("Speed [m/s]")
    truth = recording.reference.velocity_mps
    if recording.velocity is None and truth is None:
        say(axes, "The recording has no velocity.")
        return
    if recording.velocity is not None:
        axes.plot(*_thin(*_speed(recording.velocity)), color=OKABE_ITO[0], linewidth=0.9, label="measured")
    if truth is not None:
        shown = _thin(recording.reference.t_s, np.linalg.norm(truth[:, :2], axis=1))
        axes.plot(*shown, color=REFERENCE, linewidth=0.7, linestyle="--", label="reference")
    axes.set_ylim(bottom=0.0)


def _speed(velocity: Velocity) -> tuple[FloatArray, FloatArray]:
    """Time and speed: over ground in ENU, along the first axis of a body or a wheel."""
    axes = (0, 1) if velocity.frame == "enu" else (0,)
    rows = np.isfinite(velocity.mps[:, axes]).all(axis=1)
    return velocity.t_s[rows], np.linalg.norm(velocity.mps[rows][:, axes], axis=1)


def _draw_imu(axes: Axes, stamps_s: FloatArray, values: FloatArray) -> None:
    t_s, shown = _thin(stamps_s, values)
    for axis, name in enumerate(("forward", "left", "up")):
        axes.plot(t_s, shown[:, axis], color=OKABE_ITO[axis], linewidth=0.5, label=name)


def _draw_sigma(axes: Axes, recording: Recording) -> None:
    axes.set_ylabel("Stated sigma of position [m]")
    if recording.position is None:
        say(axes, "The recording has no position.")
        return
    variances = np.diagonal(recording.position.covariance_m2, axis1=1, axis2=2)
    variances = np.where(np.isfinite(recording.position.enu_m), variances, np.nan)
    t_s, shown = _thin(recording.position.t_s, np.sqrt(variances))
    for axis, name in enumerate(("east", "north", "up")):
        axes.plot(t_s, shown[:, axis], color=OKABE_ITO[axis], linewidth=0.9, label=name)
    axes.set_ylim(bottom=0.0)


def _draw_allan(axes: Axes, recording: Recording) -> None:
    axes.set(xlabel="Averaging time [s]", ylabel="Allan deviation at rest")
    noise = rest_noise(recording, longest_rest(recording))
    if noise is None:
        say(axes, "No rest of 5 s is known or found.")
        return
    names = {"gyro [rad/s]": noise.gyro_radps, "accelerometer [m/s²]": noise.accel_mps2}
    for (name, values), colour in zip(names.items(), OKABE_ITO, strict=False):
        axes.loglog(noise.tau_s, values.max(axis=1), color=colour, label=name)
