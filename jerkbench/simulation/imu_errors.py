"""Errors of an IMU: white noise, biases, scale factors and misalignment, in the units of data sheets."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.random_streams import stream
from jerkbench.recording import GRAVITY_MPS2

BIAS_TIME_S = 100.0
"""Correlation time of a bias that wanders."""

ALLAN_FLOOR = 0.664
"""The floor of an Allan deviation, sqrt(2 ln 2/pi), in parts of the flicker noise's coefficient (IEEE Std 952)."""


@dataclass(frozen=True)
class SensorErrors:
    """Errors of three like axes, in SI units.

    A measurement is (I + M) y + b_0 + b(t) + noise: M holds scale factors on its diagonal and misalignments off it,
    b_0 is the turn-on bias, b(t) a Gauss-Markov process of 100 s. All are drawn once for each axis and seed.

    Attributes:
        noise: one sigma of the white noise of a sample.
        turn_on: one sigma of b_0.
        wander: one sigma of b(t).
        scale: one sigma of a scale factor's error.
        misalignment_rad: one sigma of an axis's tilt towards another one.
    """

    noise: float
    turn_on: float = 0.0
    wander: float = 0.0
    scale: float = 0.0
    misalignment_rad: float = 0.0


@dataclass(frozen=True)
class Grade:
    """One data sheet.

    Attributes:
        angle_random_walk_deg_per_sqrt_h: white noise of the gyro.
        velocity_random_walk_mps_per_sqrt_h: white noise of the accelerometer.
        gyro_instability_deg_per_h: floor of its Allan deviation.
        accel_instability_mg: floor of its Allan deviation.
        gyro_turn_on_deg_per_h: one sigma.
        accel_turn_on_mg: one sigma.
        gyro_scale_ppm: one sigma.
        accel_scale_ppm: one sigma.
        misalignment_mrad: one sigma.
    """

    angle_random_walk_deg_per_sqrt_h: float
    velocity_random_walk_mps_per_sqrt_h: float
    gyro_instability_deg_per_h: float
    accel_instability_mg: float
    gyro_turn_on_deg_per_h: float
    accel_turn_on_mg: float
    gyro_scale_ppm: float
    accel_scale_ppm: float
    misalignment_mrad: float

    def gyro(self, rate_hz: float) -> SensorErrors:
        """Errors of the gyro [rad/s] when a sample is the mean over 1/``rate_hz``."""
        per_hour = np.deg2rad(1.0) / 3600.0
        return SensorErrors(
            noise=float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) / 60.0 * np.sqrt(rate_hz)),
            turn_on=float(self.gyro_turn_on_deg_per_h * per_hour),
            wander=float(self.gyro_instability_deg_per_h * per_hour / ALLAN_FLOOR),
            scale=self.gyro_scale_ppm * 1e-6,
            misalignment_rad=self.misalignment_mrad * 1e-3,
        )

    def accelerometer(self, rate_hz: float) -> SensorErrors:
        """Errors of the accelerometer [m/s2] when a sample is the mean over 1/``rate_hz``."""
        per_mg = 1e-3 * GRAVITY_MPS2
        return SensorErrors(
            noise=float(self.velocity_random_walk_mps_per_sqrt_h / 60.0 * np.sqrt(rate_hz)),
            turn_on=self.accel_turn_on_mg * per_mg,
            wander=self.accel_instability_mg * per_mg / ALLAN_FLOOR,
            scale=self.accel_scale_ppm * 1e-6,
            misalignment_rad=self.misalignment_mrad * 1e-3,
        )


GRADES = {
    "consumer": Grade(0.4, 0.1, 20.0, 0.1, 1800.0, 20.0, 5000.0, 5000.0, 5.0),
    "industrial": Grade(0.3, 0.05, 8.0, 0.03, 200.0, 3.0, 1000.0, 1000.0, 1.0),
    "tactical": Grade(0.15, 0.06, 0.5, 0.05, 10.0, 0.75, 500.0, 300.0, 1.0),
}
"""Orders of magnitude: a phone's sensor, a factory-calibrated MEMS module, and the Safran STIM300's data sheet."""


def disturb(true: FloatArray, errors: SensorErrors, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Return (n, 3) with the errors added; every error has a random stream of its own.

    Args:
        true: (n, 3) what a perfect sensor measures.
        errors: how large the errors are, in the same unit.
        interval_s: time between samples.
        seed: of the run.
        sensor: name of the streams.
    """
    noise = stream(seed, "dataset", sensor).standard_normal(true.shape) * errors.noise
    turn_on = stream(seed, "dataset", sensor, "turn_on").standard_normal(3) * errors.turn_on
    disturbed = true @ _deformation(errors, seed, sensor).T + turn_on + noise
    return disturbed + _wandering(len(true), errors.wander, interval_s, seed, sensor)


def _deformation(errors: SensorErrors, seed: int, sensor: str) -> FloatArray:
    """I + M (3, 3)."""
    draw = stream(seed, "dataset", sensor, "axes").standard_normal((3, 3))
    sizes = np.full((3, 3), errors.misalignment_rad)
    np.fill_diagonal(sizes, errors.scale)
    return np.eye(3) + sizes * draw


def _wandering(rows: int, sigma: float, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Return a stationary Gauss-Markov process (rows, 3); zeros when ``sigma`` is zero."""
    if sigma == 0:
        return np.zeros((rows, 3))
    keep = np.exp(-interval_s / BIAS_TIME_S)
    drive = stream(seed, "dataset", sensor, "wander").standard_normal((rows, 3)) * sigma
    drive[1:] *= np.sqrt(1.0 - keep**2)
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))
