"""Vibration that the IMU feels."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import Once, own_stream
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Imu, Recording
from jerkbench.simulation.motion import harmonics

SINES = 64
"""Enough for noise that does not repeat within some minutes, in a band of some ten hertz."""


@register("disturbance", "imu_vibration")
@dataclass(frozen=True)
class ImuVibration(Once):
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

    seeded: ClassVar[bool] = True

    accel_mps2: float = 1.0
    gyro_radps: float = 0.01
    lowest_hz: float = 8.0
    highest_hz: float = 35.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check sigmas and band."""
        for name in ("accel_mps2", "gyro_radps"):
            if not 0 <= getattr(self, name) < np.inf:
                raise PluginError(f"{name} is {getattr(self, name)}; a standard deviation must be 0 or more.")
        if not 0 <= self.lowest_hz < self.highest_hz < np.inf:
            raise PluginError(f"{self.lowest_hz} to {self.highest_hz} Hz is no band; give 0 <= lowest < highest.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the vibration of ``seed`` on its IMU."""
        imu = recording.inertial
        noise = self._noise(imu.t_s, seed)
        accel = imu.accel_mps2 + self.accel_mps2 * noise[:, :3]
        return replace(recording, imu=Imu(imu.t_s, accel, imu.gyro_radps + self.gyro_radps * noise[:, 3:]))

    def _noise(self, t_s: FloatArray, seed: int) -> FloatArray:
        """Return noise (n, 6) of unit variance, accelerometer and gyro."""
        random = own_stream(seed, "imu_vibration", self.stream)
        part = (self.highest_hz - self.lowest_hz) / SINES
        frequency_hz = self.lowest_hz + part * (np.arange(SINES) + random.uniform(size=SINES))
        sine, cosine = random.standard_normal((2, 6, SINES)) / np.sqrt(SINES)
        return harmonics(t_s, 2.0 * np.pi * frequency_hz, sine, cosine)[0]
