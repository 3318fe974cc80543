"""Faults of the vehicle's own sensors: bias, vibration and missing samples of the IMU, wheels that slip."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, nearest_rows
from jerkbench.disturbances.common import (
    DEVIATION,
    FROM_0_TO_1,
    DrawnFault,
    RegularWindows,
    WindowTimes,
    displaced,
    in_any,
    own_stream,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Imu, Recording, Reference, Velocity
from jerkbench.simulation.motion import harmonics


@register("disturbance", "imu_bias")
@dataclass(frozen=True)
class ImuBias(DrawnFault):
    """A constant bias on each axis of accelerometer and gyro, drawn once a run.

    For each axis of the body::

        f' = f + b_a,  b_a ~ N(0, sigma_a^2)
        w' = w + b_g,  b_g ~ N(0, sigma_g^2)

    Source: the turn-on bias of the usual IMU error model (P. D. Groves, "Principles of GNSS, Inertial, and
    Multisensor Integrated Navigation Systems", 2nd ed., section 4.4).

    Attributes:
        accel_mps2: sigma_a, one sigma of an axis [m/s2].
        gyro_radps: sigma_g, one sigma of an axis [rad/s].
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    accel_mps2: Annotated[float, DEVIATION] = 0.08
    gyro_radps: Annotated[float, DEVIATION] = 0.002
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the biases of ``seed`` added to its IMU."""
        accel, gyro = own_stream(seed, "bias", self.stream).normal(size=(2, 3))
        imu = recording.inertial
        biased = Imu(imu.t_s, imu.accel_mps2 + self.accel_mps2 * accel, imu.gyro_radps + self.gyro_radps * gyro)
        return replace(recording, imu=biased)


_SINES = 64
"""Enough for noise that does not repeat within some minutes, in a band of some ten hertz."""


@register("disturbance", "imu_vibration")
@dataclass(frozen=True)
class ImuVibration(DrawnFault):
    """Band-limited noise on accelerometer and gyro: a vibration of the IMU's mounting that the vehicle does not make.

    On each axis of the body::

        n(t) = sum_i a_i sin(2 pi f_i t) + b_i cos(2 pi f_i t),  a_i, b_i ~ N(0, sigma^2/64),  i = 1 ... 64

    with one f_i at random in each 64th of the band: Gaussian noise whose spectrum is flat in the band. It is a
    function of time, so that samples that are missing do not move the others. Above half the IMU's rate it
    aliases, as in a sensor without a filter before its sampling. Vibration as true motion is a parameter of `field`.

    Attributes:
        accel_mps2: sigma of the accelerometer.
        gyro_radps: sigma of the gyro.
        lowest_hz: begin of the band.
        highest_hz: end of the band.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    accel_mps2: Annotated[float, DEVIATION] = 1.0
    gyro_radps: Annotated[float, DEVIATION] = 0.01
    lowest_hz: float = 8.0
    highest_hz: float = 35.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check sigmas and band."""
        super().__post_init__()
        if not 0 <= self.lowest_hz < self.highest_hz < np.inf:
            raise PluginError(f"{self.lowest_hz} to {self.highest_hz} Hz is no band; give 0 <= lowest < highest.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the vibration of ``seed`` on its IMU."""
        imu = recording.inertial
        random = own_stream(seed, "imu_vibration", self.stream)
        part = (self.highest_hz - self.lowest_hz) / _SINES
        frequency_hz = self.lowest_hz + part * (np.arange(_SINES) + random.uniform(size=_SINES))
        sine, cosine = random.standard_normal((2, 6, _SINES)) / np.sqrt(_SINES)
        noise = harmonics(imu.t_s, 2.0 * np.pi * frequency_hz, sine, cosine)[0]
        accel = imu.accel_mps2 + self.accel_mps2 * noise[:, :3]
        return replace(recording, imu=Imu(imu.t_s, accel, imu.gyro_radps + self.gyro_radps * noise[:, 3:]))


@register("disturbance", "dropout")
@dataclass(frozen=True)
class Dropout(DrawnFault):
    """IMU samples are missing, one or a few in a row.

    From each sample on, with the given probability, N ~ U{1 ... longest} samples are missing. The first and the last
    sample are always there. The next sample that is there then stands for the whole gap: its interval begins at the
    last one before the gap.

    Attributes:
        probability: that a gap begins at a sample, from 0 to 1.
        longest: most samples that one gap takes.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    probability: Annotated[float, FROM_0_TO_1] = 0.01
    longest: Annotated[int, Limit(lambda count: count >= 1, "a gap takes 1 sample or more.")] = 5
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without the samples that ``seed`` drops."""
        imu = recording.inertial
        keep = ~self._missing(len(imu.t_s), seed)
        keep[[0, -1]] = True
        return replace(recording, imu=Imu(imu.t_s[keep], imu.accel_mps2[keep], imu.gyro_radps[keep]))

    def _missing(self, n: int, seed: int) -> BoolArray:
        random = own_stream(seed, "dropout", self.stream)
        begins = np.flatnonzero(random.uniform(size=n) < self.probability)
        lengths = random.integers(1, self.longest + 1, size=n)[begins]
        depth = np.zeros(n + self.longest, dtype=np.int64)  # how many gaps open, less how many close, at each sample
        np.add.at(depth, begins, 1)
        np.add.at(depth, begins + lengths, -1)
        return np.asarray(np.cumsum(depth)[:n] > 0)


@register("disturbance", "wheel_slip")
@dataclass(frozen=True)
class WheelSlip(RegularWindows):
    """Velocity that is too large along the heading in the given windows; the reported covariance does not change.

    With the horizontal unit vector h of the heading, and the slip s::

        v' = v + o,  o = s (h'v) h;  R_true' = R_true + o o'

    A velocity in the body frame, and a wheel's speed, has h = (1, 0, 0). One in ENU takes the yaw of the reference at
    the stamp nearest to it; where the reference knows none, h is the velocity's own course, forwards. A row of a
    body's velocity or of one in ENU without both horizontal axes stays as it is.

    Attributes:
        slip: s; 0.3 is 30 % too fast, -1 is wheels that lock.
    """

    fault: ClassVar[str] = "wheel slip"

    windows_s: WindowTimes = ((20.0, 24.0), (60.0, 66.0), (115.0, 120.0))
    slip: Annotated[float, Limit(np.isfinite, "give a finite number, 0.3 for 30 % too fast.")] = 0.3

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with slip in the windows.

        Raises:
            RecordingError: it has no velocity, or none with east and north in one row.
        """
        velocity = recording.velocity
        if velocity is None:
            raise RecordingError(f"{recording.name} has no velocity, so no wheel can slip; leave wheel_slip out.")
        together = velocity.mps[:, :1] if velocity.frame == "speed" else velocity.mps[:, :2]
        if len(velocity.t_s) and not np.isfinite(together).all(axis=1).any():
            raise RecordingError(
                f"{recording.name} has no velocity with east and north at one time, so nothing along a heading can"
                " slip; leave wheel_slip out, or give both the same latency."
            )
        offset = self.slip * _along(velocity, recording.reference)
        offset[~in_any(velocity.t_s, self.windows)] = 0.0
        return replace(recording, velocity=displaced(velocity, offset))


def _along(velocity: Velocity, reference: Reference) -> FloatArray:
    """Return (h'v) h (m, 3), zero where it is not known."""
    if velocity.frame in ("body", "speed"):
        return np.asarray(np.nan_to_num(velocity.mps * [1.0, 0.0, 0.0]))
    level, yaw = velocity.mps[:, :2], np.full(len(velocity.t_s), np.nan)
    if reference.euler_rad is not None and len(reference.t_s):
        yaw = reference.euler_rad[nearest_rows(reference.t_s, velocity.t_s), 2]
    h = np.column_stack([np.cos(yaw), np.sin(yaw)])
    along = np.einsum("mi,mi->m", h, level)[:, None] * h
    offset = np.where(np.isfinite(h[:, :1]), along, level)  # with h = v/|v| it is v itself
    offset[~np.isfinite(level).all(axis=1)] = 0.0
    return np.column_stack([offset, np.zeros(len(offset))])
