"""The measurements of an IMU on a true motion, and its errors in the units of data sheets."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_euler
from jerkbench.random_streams import stream
from jerkbench.recording import GRAVITY_MPS2
from jerkbench.simulation.truth import Truth


def perfect_imu(truth: Truth) -> tuple[FloatArray, FloatArray]:
    """Return specific force and angular rate (n, 3) in the body, over each of the n intervals of ``truth``.

    The gyro is the mean rate of the rotation from one end of the interval to the other, and the accelerometer is
    the specific force that carries the velocity from one to the other under the mean of the two attitudes::

        w_k = Log(Omega_{k-1}' Omega_k)/dt
        f_k = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    so that integrating it with the true attitude returns the true velocity exactly. It differs from the mean of
    the body's specific force only in the second order of dt, as sculling and coning do.
    """
    from scipy.spatial.transform import Rotation

    dcm = dcm_from_euler(truth.euler_rad)
    dt = np.diff(truth.t_s)[:, None]
    gyro = Rotation.from_matrix(dcm[:-1].transpose(0, 2, 1) @ dcm[1:]).as_rotvec() / dt
    accel = np.diff(truth.velocity_mps, axis=0) / dt + np.array([0.0, 0.0, GRAVITY_MPS2])
    force = np.linalg.solve(0.5 * (dcm[:-1] + dcm[1:]), accel[:, :, None])[:, :, 0]
    return np.asarray(force), np.asarray(gyro)


def saturate(force_mps2: FloatArray, false_mps2: FloatArray | None, range_g: float | None) -> FloatArray:
    """Return (n, 3): true and false specific force, cut off at +-``range_g`` and then averaged over the sample.

    Args:
        force_mps2: (n, 3) constant over a sample.
        false_mps2: (n, m, 3) within a sample; None: there is none.
        range_g: of each axis, in units of g; None: no limit.
    """
    inner = force_mps2[:, None, :] if false_mps2 is None else force_mps2[:, None, :] + false_mps2
    if range_g is not None:
        limit = range_g * GRAVITY_MPS2
        inner = np.clip(inner, -limit, limit)
    return np.asarray(inner.mean(axis=1))


# Errors of an IMU: white noise, biases, scale factors and misalignment, in the units of data
# sheets.

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
        noise = float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) / 60.0 * np.sqrt(rate_hz))
        wander = float(self.gyro_instability_deg_per_h * per_hour / ALLAN_FLOOR)
        axes = self.gyro_scale_ppm * 1e-6, self.misalignment_mrad * 1e-3
        return SensorErrors(noise, float(self.gyro_turn_on_deg_per_h * per_hour), wander, *axes)

    def accelerometer(self, rate_hz: float) -> SensorErrors:
        """Errors of the accelerometer [m/s2] when a sample is the mean over 1/``rate_hz``."""
        per_mg = 1e-3 * GRAVITY_MPS2
        noise = float(self.velocity_random_walk_mps_per_sqrt_h / 60.0 * np.sqrt(rate_hz))
        wander = self.accel_instability_mg * per_mg / ALLAN_FLOOR
        axes = self.accel_scale_ppm * 1e-6, self.misalignment_mrad * 1e-3
        return SensorErrors(noise, self.accel_turn_on_mg * per_mg, wander, *axes)


GRADES = {
    "consumer": Grade(0.4, 0.1, 20.0, 0.1, 1800.0, 20.0, 5000.0, 5000.0, 5.0),
    "industrial": Grade(0.3, 0.05, 8.0, 0.03, 200.0, 3.0, 1000.0, 1000.0, 1.0),
    "tactical": Grade(0.15, 0.06, 0.5, 0.05, 10.0, 0.75, 500.0, 300.0, 1.0),
}
"""Orders of magnitude: a phone's sensor, a factory-calibrated MEMS module, and the Safran STIM300's data sheet."""


def with_sensor_errors(true: FloatArray, errors: SensorErrors, interval_s: float, seed: int, sensor: str) -> FloatArray:
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
    sizes = np.where(np.eye(3), errors.scale, errors.misalignment_rad)
    return np.asarray(np.eye(3) + sizes * stream(seed, "dataset", sensor, "axes").standard_normal((3, 3)))


def _wandering(rows: int, sigma: float, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Return a stationary Gauss-Markov process (rows, 3); zeros when ``sigma`` is zero."""
    if sigma == 0:
        return np.zeros((rows, 3))
    keep = np.exp(-interval_s / BIAS_TIME_S)
    drive = stream(seed, "dataset", sensor, "wander").standard_normal((rows, 3)) * sigma
    drive[1:] *= np.sqrt(1.0 - keep**2)
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))


# Errors that last: a first-order Gauss-Markov process.


def gauss_markov(t_s: FloatArray, time_s: float, random: np.random.Generator, axes: int = 3) -> FloatArray:
    """Return a stationary process (m, axes) of unit variance at the times (m,); its axes are independent.

    b_k = c b_{k-1} + sqrt(1 - c^2) w_k,  c = exp(-(t_k - t_{k-1})/time),  w_k ~ N(0, I): exact at any spacing.
    """
    process = random.standard_normal((len(t_s), axes))
    keep = np.exp(-np.diff(t_s) / time_s)
    fresh = np.sqrt(1.0 - keep**2)
    for k in range(1, len(t_s)):
        process[k] = keep[k - 1] * process[k - 1] + fresh[k - 1] * process[k]
    return process


def coloured(
    t_s: FloatArray, white: FloatArray, share: float, time_s: float, random: np.random.Generator
) -> FloatArray:
    """Return noise (m, k) of unit variance, of which ``share`` is a Gauss-Markov process and the rest ``white`` (m, k).

    n = sqrt(1 - share) w + sqrt(share) b,  so that E[n(t) n(t + tau)] = share exp(-|tau|/time) for tau > 0.
    """
    if not share:
        return white
    slow = gauss_markov(t_s, time_s, random, white.shape[1])
    return np.asarray(np.sqrt(1.0 - share) * white + np.sqrt(share) * slow)
