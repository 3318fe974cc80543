"""Disturbances of the IMU (bias, vibration, missing samples) and of a wheel (slip)."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, nearest_rows
from jerkbench.disturbances.common import (
    FROM_0_TO_1,
    DrawnFault,
    RegularWindows,
    WindowTimes,
    displaced,
    fault_stream,
    in_any,
    velocity_of,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import NOT_NEGATIVE, Limit
from jerkbench.plugins import register
from jerkbench.recording import Imu, Recording, Reference, Velocity
from jerkbench.simulation.motion import harmonics


@register("disturbance", "imu_bias")
@dataclass(frozen=True)
class ImuBias(DrawnFault):
    """Adds a random constant bias to each axis of accelerometer and gyro.

    Each axis of the body frame has a constant accelerometer bias b_a and a constant gyro bias b_g, which are random for
    each run::

        f' = f + b_a,  b_a ~ N(0, sigma_a^2)
        w' = w + b_g,  b_g ~ N(0, sigma_g^2)

    Source: the turn-on bias of the common IMU error model (P. D. Groves, "Principles of GNSS, Inertial, and
    Multisensor Integrated Navigation Systems", 2nd ed., section 4.4).

    Attributes:
        accel_mps2: sigma_a, standard deviation of the accelerometer bias on each axis [m/s2].
        gyro_radps: sigma_g, standard deviation of the gyro bias on each axis [rad/s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    accel_mps2: Annotated[float, NOT_NEGATIVE] = 0.08
    gyro_radps: Annotated[float, NOT_NEGATIVE] = 0.002
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random IMU biases, generated with ``seed``."""
        accel, gyro = fault_stream(seed, "bias", self.stream).normal(size=(2, 3))
        imu = recording.inertial
        biased = Imu(imu.t_s, imu.accel_mps2 + self.accel_mps2 * accel, imu.gyro_radps + self.gyro_radps * gyro)
        return replace(recording, imu=biased)


_SINES = 64
"""Number of sines. With a bandwidth of some ten hertz, the noise does not repeat within minutes."""


@register("disturbance", "imu_vibration")
@dataclass(frozen=True)
class ImuVibration(DrawnFault):
    """Adds band-limited noise to accelerometer and gyro, as caused by a vibration of the IMU mounting.

    The noise n on each axis of the body frame is a sum of 64 sines with random phases::

        n(t) = sum_i a_i sin(2 pi f_i t) + b_i cos(2 pi f_i t),  a_i, b_i ~ N(0, sigma^2/64),  i = 1 ... 64

    Each frequency f_i is random within one of 64 equal parts of the band. The sum of the sines is Gaussian noise with a
    flat spectrum in the band. The noise depends only on the time, so missing samples do not change the noise of other
    samples. Frequencies above half the rate of the IMU are aliased, as in a sensor without an anti-aliasing filter. The
    true motion of the vehicle does not contain this vibration. The data set `field` has parameters for a vibration of
    the true motion.

    Attributes:
        accel_mps2: sigma, standard deviation of the noise of the accelerometer [m/s2].
        gyro_radps: sigma, standard deviation of the noise of the gyro [rad/s].
        lowest_hz: lower end of the frequency band [Hz].
        highest_hz: upper end of the frequency band [Hz].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    accel_mps2: Annotated[float, NOT_NEGATIVE] = 1.0
    gyro_radps: Annotated[float, NOT_NEGATIVE] = 0.01
    lowest_hz: float = 8.0
    highest_hz: float = 35.0
    stream: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.lowest_hz < self.highest_hz < np.inf:
            raise PluginError(
                f"Invalid band {self.lowest_hz} to {self.highest_hz} Hz; lowest_hz and highest_hz must satisfy"
                " 0 <= lowest_hz < highest_hz."
            )

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random vibration noise of the IMU, generated with ``seed``."""
        imu = recording.inertial
        random = fault_stream(seed, "imu_vibration", self.stream)
        part = (self.highest_hz - self.lowest_hz) / _SINES
        frequency_hz = self.lowest_hz + part * (np.arange(_SINES) + random.uniform(size=_SINES))
        sine, cosine = random.standard_normal((2, 6, _SINES)) / np.sqrt(_SINES)
        noise = harmonics(imu.t_s, 2.0 * np.pi * frequency_hz, sine, cosine)[0]
        accel = imu.accel_mps2 + self.accel_mps2 * noise[:, :3]
        return replace(recording, imu=Imu(imu.t_s, accel, imu.gyro_radps + self.gyro_radps * noise[:, 3:]))


@register("disturbance", "dropout")
@dataclass(frozen=True)
class Dropout(DrawnFault):
    """Removes single IMU samples or a few consecutive IMU samples.

    At each sample, a gap starts with the probability ``probability``. The length of a gap is uniformly distributed from
    1 to ``longest`` samples. The first and the last sample of a recording are never removed. The first sample after a
    gap represents the time since the last sample before the gap.

    Attributes:
        probability: probability that a gap starts at a sample, from 0 to 1 [-].
        longest: maximum length of a gap [samples].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    probability: Annotated[float, FROM_0_TO_1] = 0.01
    longest: Annotated[int, Limit(lambda count: count >= 1, "it must be at least 1 sample.")] = 5
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without randomly selected IMU samples; ``seed`` determines the selection."""
        imu, random = recording.inertial, fault_stream(seed, "dropout", self.stream)
        n = len(imu.t_s)
        starts = np.flatnonzero(random.uniform(size=n) < self.probability)
        lengths = random.integers(1, self.longest + 1, size=n)[starts]
        depth = np.zeros(n + self.longest, dtype=np.int64)  # number of gaps that start minus number of gaps that end
        np.add.at(depth, starts, 1)
        np.add.at(depth, starts + lengths, -1)
        present = np.cumsum(depth)[:n] <= 0
        present[[0, -1]] = True
        return replace(recording, imu=Imu(imu.t_s[present], imu.accel_mps2[present], imu.gyro_radps[present]))


@register("disturbance", "wheel_slip")
@dataclass(frozen=True)
class WheelSlip(RegularWindows):
    """Increases the velocity along the heading in the given windows, without a change of the reported covariance.

    The velocity error o is the slip s times the velocity along the heading, whose horizontal unit vector is h::

        v' = v + o,  o = s (h'v) h;  R_true' = R_true + o o'

    For a velocity in the body frame and for a wheel speed, h is (1, 0, 0). For a velocity in ENU, h is computed from
    the yaw of the reference at the nearest stamp. If the reference has no yaw, h is the course of the velocity. A
    velocity in ENU does not change if one of its horizontal components is missing. A velocity in the body frame does
    not change if its forward component is missing.

    Attributes:
        slip: s, relative error of the speed; 0.3 means 30 % too fast, and -1 means a locked wheel [-].
    """

    fault: ClassVar[str] = "wheel slip"

    windows_s: WindowTimes = ((20.0, 24.0), (60.0, 66.0), (115.0, 120.0))
    slip: Annotated[float, Limit(np.isfinite, "give a finite number, 0.3 for 30 % too fast.")] = 0.3

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with wheel slip in the windows.

        Raises:
            RecordingError: the recording has no velocity, or no velocity row with both horizontal components.
        """
        velocity = velocity_of(recording, "wheel_slip")
        together = velocity.mps[:, :1] if velocity.frame == "speed" else velocity.mps[:, :2]
        if len(velocity.t_s) and not np.isfinite(together).all(axis=1).any():
            raise RecordingError(
                f"{recording.name} has no velocity with both east and north at the same time, so wheel_slip cannot be"
                " applied; remove wheel_slip, or use the same latency for east and north."
            )
        offset = self.slip * _along(velocity, recording.reference)
        offset[~in_any(velocity.t_s, self.windows)] = 0.0
        return replace(recording, velocity=displaced(velocity, offset))


def _along(velocity: Velocity, reference: Reference) -> FloatArray:
    """Return the velocity along the heading, (h'v) h (m, 3). A row without the needed components is zero."""
    if velocity.frame in ("body", "speed"):
        return np.asarray(np.nan_to_num(velocity.mps * [1.0, 0.0, 0.0]))
    level, yaw = velocity.mps[:, :2], np.full(len(velocity.t_s), np.nan)
    if reference.euler_rad is not None and len(reference.t_s):
        yaw = reference.euler_rad[nearest_rows(reference.t_s, velocity.t_s), 2]
    h = np.column_stack([np.cos(yaw), np.sin(yaw)])
    along = np.einsum("mi,mi->m", h, level)[:, None] * h
    offset = np.where(np.isfinite(h[:, :1]), along, level)  # without a yaw, h is v/|v| and (h'v) h is v
    offset[~np.isfinite(level).all(axis=1)] = 0.0
    return np.column_stack([offset, np.zeros(len(offset))])
