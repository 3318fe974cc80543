"""A constant bias of the IMU."""

from dataclasses import dataclass, replace
from typing import ClassVar

from jerkbench.disturbances.common import Once, own_stream
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Imu, Recording


@register("disturbance", "imu_bias")
@dataclass(frozen=True)
class ImuBias(Once):
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

    seeded: ClassVar[bool] = True

    accel_mps2: float = 0.08
    gyro_radps: float = 0.002
    stream: str = ""

    def __post_init__(self) -> None:
        """Check that no sigma is negative."""
        for name in ("accel_mps2", "gyro_radps"):
            if not getattr(self, name) >= 0:
                raise PluginError(f"{name} is {getattr(self, name)}; a standard deviation must be 0 or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the biases of ``seed`` added to its IMU."""
        accel, gyro = own_stream(seed, "bias", self.stream).normal(size=(2, 3))
        imu = recording.inertial
        biased = Imu(imu.t_s, imu.accel_mps2 + self.accel_mps2 * accel, imu.gyro_radps + self.gyro_radps * gyro)
        return replace(recording, imu=biased)
