"""Disturbances of the time stamps: latency and jitter."""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import AnyStream, DrawnFault, Unphased, fault_stream, rows_of
from jerkbench.parameters import NOT_NEGATIVE
from jerkbench.plugins import register
from jerkbench.recording import Recording

_MEASURED = ("position", "velocity", "heading")


@register("disturbance", "latency")
@dataclass(frozen=True)
class Latency(Unphased):
    """Delays the stamps of the measurements by an unknown latency d.

    A stamp t becomes t' = t + d. Measurements whose new stamp is after the end of the recording are removed. The
    resulting position error is the distance that the vehicle moves during d, for example 15 cm for 1.5 m/s and 0.1 s.
    Neither the reported nor the true covariance includes the error that the latency causes.

    Attributes:
        position_s: latency d of the position fixes [s].
        velocity_s: latency d of the velocities [s].
        heading_s: latency d of the headings [s].
    """

    position_s: Annotated[float, NOT_NEGATIVE] = 0.1
    velocity_s: Annotated[float, NOT_NEGATIVE] = 0.0
    heading_s: Annotated[float, NOT_NEGATIVE] = 0.0

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with delayed stamps of the measurements."""
        late_s, end_s = {name: getattr(self, f"{name}_s") for name in _MEASURED}, recording.duration_s
        delayed: dict[str, Any] = {name: _delayed(getattr(recording, name), late_s[name], end_s) for name in _MEASURED}
        return replace(recording, **delayed)


def _delayed(measured: AnyStream | None, late_s: float, end_s: float) -> AnyStream | None:
    if measured is None or not late_s:
        return measured
    within = rows_of(measured, measured.t_s + late_s <= end_s)
    return replace(within, t_s=within.t_s + late_s)


MAX_SHIFT = 0.45
"""Maximum shift of a stamp towards its neighbour, as a fraction of the interval between them."""


@register("disturbance", "jitter")
@dataclass(frozen=True)
class Jitter(DrawnFault):
    """Adds random errors to the stamps of the IMU and of the measurements; values and reference do not change.

    A stamp t_k becomes t_k' = t_k + e_k with e_k ~ N(0, sigma^2). The error e_k is limited to 0.45 times the interval
    to the neighbouring stamp, so that the stamps remain increasing. The first and the last stamp of the IMU do not
    change. The stamp errors of position, velocity and heading are independent. The error of a measurement that results
    from its stamp error depends on the motion of the vehicle. Neither the reported nor the true covariance includes the
    error that results from a stamp error.

    Attributes:
        imu_s: standard deviation of the stamp errors of the IMU [s].
        measurement_s: standard deviation of the stamp errors of position, velocity and heading [s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    imu_s: Annotated[float, NOT_NEGATIVE] = 0.001
    measurement_s: Annotated[float, NOT_NEGATIVE] = 0.01
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random stamp errors, generated with ``seed``."""
        imu = recording.imu
        if imu is not None:
            t_s = jittered(imu.t_s, self.imu_s, fault_stream(seed, "jitter", self.stream, "imu"))
            t_s[[0, -1]] = imu.t_s[[0, -1]]
            imu = replace(imu, t_s=t_s)
        restamped: dict[str, Any] = {"imu": imu}
        for name in (name for name in _MEASURED if getattr(recording, name) is not None):
            measured, random = getattr(recording, name), fault_stream(seed, "jitter", self.stream, name)
            restamped[name] = replace(measured, t_s=jittered(measured.t_s, self.measurement_s, random))
        return replace(recording, **restamped)


def jittered(t_s: FloatArray, sigma_s: float, random: np.random.Generator) -> FloatArray:
    """Return the stamps (n,) with random errors, which are limited so that the stamps remain increasing."""
    gaps = np.concatenate([[np.inf], np.diff(t_s), [np.inf]])
    errors = sigma_s * random.standard_normal(len(t_s))
    return np.asarray(t_s + np.clip(errors, -MAX_SHIFT * gaps[:-1], MAX_SHIFT * gaps[1:]))
