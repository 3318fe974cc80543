"""Measurements of a simulated IMU, and IMU errors in the units of data sheets."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_euler
from jerkbench.random_streams import stream
from jerkbench.recording import GRAVITY_MPS2
from jerkbench.simulation.truth import Truth


def perfect_imu(truth: Truth) -> tuple[FloatArray, FloatArray]:
    """Return the error-free specific force and angular rate (n, 3) in the body frame for the n intervals of ``truth``.

    The angular rate w is the mean rate of the rotation from the start to the end of the interval. The specific force f,
    rotated with the mean of the attitudes at both ends, gives the change of the velocity::

        w_k = Log(Omega_{k-1}' Omega_k)/dt
        f_k = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    Therefore, integrating f with the true attitude gives exactly the true velocity. The difference between f and the
    mean specific force in the body frame is of second order in dt, like sculling and coning.
    """
    from scipy.spatial.transform import Rotation

    dcm = dcm_from_euler(truth.euler_rad)
    dt = np.diff(truth.t_s)[:, None]
    gyro = Rotation.from_matrix(dcm[:-1].transpose(0, 2, 1) @ dcm[1:]).as_rotvec() / dt
    accel = np.diff(truth.velocity_mps, axis=0) / dt + np.array([0.0, 0.0, GRAVITY_MPS2])
    force = np.linalg.solve(0.5 * (dcm[:-1] + dcm[1:]), accel[:, :, None])[:, :, 0]
    return np.asarray(force), np.asarray(gyro)


def saturate(force_mps2: FloatArray, false_mps2: FloatArray | None, range_g: float | None) -> FloatArray:
    """Add the false to the true specific force, limit the sum to +-``range_g``, and return its mean (n, 3) per sample.

    Args:
        force_mps2: (n, 3) true specific force, assumed to be constant during each sample [m/s2].
        false_mps2: (n, m, 3) false specific force at m times within each sample [m/s2]; None if the false force is
            zero.
        range_g: measurement range of each axis in units of g; None for an unlimited range.
    """
    inner = force_mps2[:, None, :] if false_mps2 is None else force_mps2[:, None, :] + false_mps2
    if range_g is not None:
        limit = range_g * GRAVITY_MPS2
        inner = np.clip(inner, -limit, limit)
    return np.asarray(inner.mean(axis=1))


# Errors of an IMU in the units of data sheets: white noise, biases, scale factors and misalignment.

BIAS_TIME_S = 100.0
"""Correlation time of the variable part of a bias [s]."""

ALLAN_FLOOR = 0.664
"""Ratio sqrt(2 ln 2/pi) of the minimum of an Allan deviation to the coefficient of flicker noise (IEEE Std 952)."""


@dataclass(frozen=True)
class SensorErrors:
    """Standard deviations, in SI units, of the errors of a sensor with three axes of the same quality.

    A measurement is (I + M) y + b_0 + b(t) + noise, where y is the true value. The matrix M contains the scale factor
    errors on its diagonal, and the misalignments in its other elements. The turn-on bias is b_0. The variable bias b(t)
    is a Gauss-Markov process with a correlation time of 100 s. For each seed, M and b_0 are random constants.

    Attributes:
        noise: standard deviation of the white noise of each sample.
        turn_on: standard deviation of the turn-on bias b_0.
        wander: standard deviation of the variable bias b(t).
        scale: standard deviation of the error of a scale factor [-].
        misalignment_rad: standard deviation of the tilt of an axis towards another axis [rad].
    """

    noise: float
    turn_on: float = 0.0
    wander: float = 0.0
    scale: float = 0.0
    misalignment_rad: float = 0.0


@dataclass(frozen=True)
class Grade:
    """Error parameters of an IMU in the units of a data sheet.

    Attributes:
        angle_random_walk_deg_per_sqrt_h: angle random walk caused by the white noise of the gyro [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: velocity random walk caused by the white noise of the accelerometer
            [m/s/sqrt(h)].
        gyro_instability_deg_per_h: minimum of the Allan deviation of the gyro [deg/h].
        accel_instability_mg: minimum of the Allan deviation of the accelerometer [mg].
        gyro_turn_on_deg_per_h: standard deviation of the turn-on bias of the gyro [deg/h].
        accel_turn_on_mg: standard deviation of the turn-on bias of the accelerometer [mg].
        gyro_scale_ppm: standard deviation of the scale factor errors of the gyro [ppm].
        accel_scale_ppm: standard deviation of the scale factor errors of the accelerometer [ppm].
        misalignment_mrad: standard deviation of the misalignments of both sensors [mrad].
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
        """Return the errors [rad/s] of gyro samples that are means over the interval 1/``rate_hz``."""
        per_hour = np.deg2rad(1.0) / 3600.0
        noise = float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) / 60.0 * np.sqrt(rate_hz))
        wander = float(self.gyro_instability_deg_per_h * per_hour / ALLAN_FLOOR)
        axes = self.gyro_scale_ppm * 1e-6, self.misalignment_mrad * 1e-3
        return SensorErrors(noise, float(self.gyro_turn_on_deg_per_h * per_hour), wander, *axes)

    def accelerometer(self, rate_hz: float) -> SensorErrors:
        """Return the errors [m/s2] of accelerometer samples that are means over the interval 1/``rate_hz``."""
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
"""Typical IMUs: the sensor of a phone, a factory-calibrated MEMS module, and the data sheet of a Safran STIM300."""


def with_sensor_errors(true: FloatArray, errors: SensorErrors, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Add errors to the measurements (n, 3) of a sensor. Each kind of error has an independent random stream.

    Args:
        true: (n, 3) measurements without errors.
        errors: standard deviations of the errors, in the unit of ``true``.
        interval_s: time between samples [s].
        seed: seed of the random streams.
        sensor: name of the sensor, which selects the random streams.
    """
    noise = stream(seed, "dataset", sensor).standard_normal(true.shape) * errors.noise
    turn_on = stream(seed, "dataset", sensor, "turn_on").standard_normal(3) * errors.turn_on
    disturbed = true @ _deformation(errors, seed, sensor).T + turn_on + noise
    return disturbed + _wandering(len(true), errors.wander, interval_s, seed, sensor)


def _deformation(errors: SensorErrors, seed: int, sensor: str) -> FloatArray:
    """Return the matrix I + M (3, 3), where M contains random scale factor errors and misalignments."""
    sizes = np.where(np.eye(3), errors.scale, errors.misalignment_rad)
    return np.asarray(np.eye(3) + sizes * stream(seed, "dataset", sensor, "axes").standard_normal((3, 3)))


def _wandering(rows: int, sigma: float, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Return a stationary Gauss-Markov process (rows, 3) with the standard deviation ``sigma``."""
    if sigma == 0:
        return np.zeros((rows, 3))
    decay = np.exp(-interval_s / BIAS_TIME_S)
    drive = stream(seed, "dataset", sensor, "wander").standard_normal((rows, 3)) * sigma
    drive[1:] *= np.sqrt(1.0 - decay**2)
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -decay], drive, axis=0))


# Time-correlated errors are modelled by a first-order Gauss-Markov process.


def gauss_markov(t_s: FloatArray, time_s: float, random: np.random.Generator, axes: int = 3) -> FloatArray:
    """Return a stationary Gauss-Markov process (m, axes) at the times ``t_s`` (m,).

    The axes are independent and have unit variance. The recursion b_k = c b_{k-1} + sqrt(1 - c^2) w_k with c =
    exp(-(t_k - t_{k-1})/time) and w_k ~ N(0, I) is exact for any increasing times t_k.
    """
    process = random.standard_normal((len(t_s), axes))
    decay = np.exp(-np.diff(t_s) / time_s)
    fresh = np.sqrt(1.0 - decay**2)
    for k in range(1, len(t_s)):
        process[k] = decay[k - 1] * process[k - 1] + fresh[k - 1] * process[k]
    return process


def coloured(
    t_s: FloatArray, white: FloatArray, share: float, time_s: float, random: np.random.Generator
) -> FloatArray:
    """Return noise (m, k) of unit variance, of which the fraction ``share`` of the variance is correlated in time.

    The noise is n = sqrt(1 - share) w + sqrt(share) b, with the white noise w and the Gauss-Markov process b. The
    autocorrelation of the noise is E[n(t) n(t + tau)] = share exp(-|tau|/time) for a lag tau that is not 0.
    """
    if not share:
        return white
    slow = gauss_markov(t_s, time_s, random, white.shape[1])
    return np.asarray(np.sqrt(1.0 - share) * white + np.sqrt(share) * slow)
