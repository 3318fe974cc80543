"""Position, velocity and heading measurements of a true motion, with noise; the slow errors of a receiver."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, require_axes, require_positive
from jerkbench.errors import PluginError
from jerkbench.geometry import dcm_from_euler, wrap_angle
from jerkbench.random_streams import stream
from jerkbench.recording import Heading, Position, Velocity
from jerkbench.simulation.imu import coloured


def measure_position(t_s: FloatArray, enu_m: FloatArray, sigma_m: tuple[float, ...], noise: FloatArray) -> Position:
    """Return fixes; ``noise`` (m, 3) has unit variance, or is zero."""
    return Position(t_s, enu_m + noise * np.asarray(sigma_m), _covariances(sigma_m, len(t_s)))


def antenna_m(enu_m: FloatArray, euler_rad: FloatArray, arm_m: tuple[float, ...]) -> FloatArray:
    """Return where an antenna is (m, 3): p + Omega l, with the arm l forward, left, up of the body."""
    return np.asarray(enu_m + dcm_from_euler(euler_rad) @ np.asarray(arm_m)) if any(arm_m) else enu_m


def measure_velocity(t_s: FloatArray, mps: FloatArray, sigma_mps: tuple[float, ...], noise: FloatArray) -> Velocity:
    """Return velocities in ENU; ``noise`` (m, 3) has unit variance, or is zero."""
    return Velocity(t_s, mps + noise * np.asarray(sigma_mps), _covariances(sigma_mps, len(t_s)))


def measure_heading(t_s: FloatArray, yaw_rad: FloatArray, sigma_rad: float, noise: FloatArray) -> Heading:
    """Return headings, wrapped to (-pi, pi]; ``noise`` (m,) has unit variance, or is zero."""
    return Heading(t_s, wrap_angle(yaw_rad + sigma_rad * noise), np.full(len(t_s), sigma_rad))


def white(seed: int, sensor: str, shape: tuple[int, ...], on: bool) -> FloatArray:
    """Return noise of unit variance from the sensor's own stream; zeros when it is not ``on``."""
    return stream(seed, "dataset", sensor).standard_normal(shape) if on else np.zeros(shape)


def _covariances(sigma: tuple[float, ...], rows: int) -> FloatArray:
    return np.tile(np.diag(np.square(sigma)), (rows, 1, 1))


# The slow errors of a simulated receiver, besides white noise: they last, are late, and are of an
# antenna.

MEASURED = ("position", "velocity", "heading")


@dataclass(frozen=True)
class SlowErrors:
    """Errors of position, velocity and heading that are not new each time; all off by default.

    The noise of a stream keeps its sigma, and has for lags tau > 0 the autocorrelation s exp(-tau/T). A fix with the
    stamp t is the place of the antenna at t - d: p + Omega l, with l what is left of the lever arm when the arm as
    measured has been taken off. The covariance is that of one measurement alone: s, d and l are not reported.

    Attributes:
        position_coloured_share: s of position, from 0 (white) to 1.
        position_coloured_time_s: T of position.
        velocity_coloured_share: s of velocity.
        velocity_coloured_time_s: T of velocity.
        heading_coloured_share: s of heading.
        heading_coloured_time_s: T of heading.
        position_latency_s: d, a multiple of the IMU's interval; no fix is of a time before the start.
        lever_arm_error_m: l, forward, left, up.
    """

    position_coloured_share: float = 0.0
    position_coloured_time_s: float = 5.0
    velocity_coloured_share: float = 0.0
    velocity_coloured_time_s: float = 2.0
    heading_coloured_share: float = 0.0
    heading_coloured_time_s: float = 30.0
    position_latency_s: float = 0.0
    lever_arm_error_m: tuple[float, ...] = (0.0, 0.0, 0.0)

    def check_slow_errors(self, subject: str, imu_rate_hz: float) -> None:
        """Raise a PluginError, about ``subject``, unless shares, times, latency and lever arm make sense."""
        require_axes(subject, self, ("lever_arm_error_m",), positive=False)
        require_positive(subject, self, tuple(f"{sensor}_coloured_time_s" for sensor in MEASURED))
        for name in (f"{sensor}_coloured_share" for sensor in MEASURED):
            if not 0 <= getattr(self, name) <= 1:
                raise PluginError(f"{subject}: {name} is {getattr(self, name)}; a share is from 0 to 1.")
        samples = self.position_latency_s * imu_rate_hz
        if not (0 <= samples < np.inf and abs(samples - round(samples)) < 1e-6):
            raise PluginError(
                f"{subject}: position_latency_s is {self.position_latency_s}; it must be 0 or a multiple of the IMU's"
                f" interval, {1 / imu_rate_hz:g} s."
            )

    def with_slow(self, sensor: str, t_s: FloatArray, white: FloatArray, seed: int) -> FloatArray:
        """Return noise (m, k) of unit variance, the white one (m, k) with the sensor's own share that lasts."""
        share, time_s = getattr(self, f"{sensor}_coloured_share"), getattr(self, f"{sensor}_coloured_time_s")
        return coloured(t_s, white, share, time_s, stream(seed, "dataset", sensor, "coloured"))
