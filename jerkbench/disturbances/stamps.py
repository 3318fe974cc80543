"""Errors of the stamps: later than the time at which the values were true, or off at random."""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import DEVIATION, AnyStream, DrawnFault, Once, own_stream, rows_of
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Recording

_MEASURED = ("position", "velocity", "heading")
LATE = Limit(lambda late: 0 <= late < np.inf, "a latency must be 0 s or more.")


@register("disturbance", "latency")
@dataclass(frozen=True)
class Latency(Once):
    """Stamps that are later than the time at which the values were true; nobody is told.

    t' = t + d. A measurement whose stamp comes after the end of the recording is left out. The error that it makes is
    the motion within d (at 1.5 m/s and .1 s 15 cm): no covariance knows of it, the true one neither.

    Attributes:
        position_s: d of the fixes.
        velocity_s: d of the velocity.
        heading_s: d of the heading.
    """

    position_s: Annotated[float, LATE] = 0.1
    velocity_s: Annotated[float, LATE] = 0.0
    heading_s: Annotated[float, LATE] = 0.0

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with later stamps."""
        late_s, end_s = {name: getattr(self, f"{name}_s") for name in _MEASURED}, recording.duration_s
        later: dict[str, Any] = {name: _later(getattr(recording, name), late_s[name], end_s) for name in _MEASURED}
        return replace(recording, **later)


def _later(measured: AnyStream | None, late_s: float, end_s: float) -> AnyStream | None:
    if measured is None or not late_s:
        return measured
    kept = rows_of(measured, measured.t_s + late_s <= end_s)
    return replace(kept, t_s=kept.t_s + late_s)


MAX_SHIFT = 0.45
"""The largest shift of a stamp towards its neighbour, in parts of the interval between them."""


@register("disturbance", "jitter")
@dataclass(frozen=True)
class Jitter(DrawnFault):
    """Stamps of the IMU and of the measurements are off at random; the values and the reference stay.

    t_k' = t_k + e_k,  e_k ~ N(0, sigma^2), cut off at .45 of the interval to the neighbour, so that stamps go on
    increasing. The IMU's first and last stamp stay. Position, velocity and heading each have errors of their own. The
    error that a wrong stamp makes depends on the motion: no covariance knows of it, the true one neither.

    Attributes:
        imu_s: sigma of the IMU's stamps.
        measurement_s: sigma of the stamps of position, velocity and heading.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    imu_s: Annotated[float, DEVIATION] = 0.001
    measurement_s: Annotated[float, DEVIATION] = 0.01
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the stamps of ``seed``."""
        imu = recording.imu
        if imu is not None:
            t_s = jittered(imu.t_s, self.imu_s, own_stream(seed, "jitter", self.stream, "imu"))
            t_s[[0, -1]] = imu.t_s[[0, -1]]
            imu = replace(imu, t_s=t_s)
        restamped: dict[str, Any] = {"imu": imu}
        for name in (name for name in _MEASURED if getattr(recording, name) is not None):
            measured, random = getattr(recording, name), own_stream(seed, "jitter", self.stream, name)
            restamped[name] = replace(measured, t_s=jittered(measured.t_s, self.measurement_s, random))
        return replace(recording, **restamped)


def jittered(t_s: FloatArray, sigma_s: float, random: np.random.Generator) -> FloatArray:
    """Return increasing stamps (n,) as new values: each with an error, cut off where it comes near a neighbour."""
    gaps = np.concatenate([[np.inf], np.diff(t_s), [np.inf]])
    errors = sigma_s * random.standard_normal(len(t_s))
    return np.asarray(t_s + np.clip(errors, -MAX_SHIFT * gaps[:-1], MAX_SHIFT * gaps[1:]))
