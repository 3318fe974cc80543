"""The errors of eskf15 at the end of simulated drives with IMU biases, compared with its covariance."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.disturbances.imu import ImuBias
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.inertial.run import InertialSolution
from jerkbench.recording import Imu, Recording
from jerkbench.simulation.imu import ALLAN_FLOOR, BIAS_TIME_S, GRADES, with_sensor_errors


@dataclass(frozen=True)
class Outcome:
    """What one seed gives, at the end of the drive.

    Attributes:
        nees: (15,) e' P^-1 e of the whole error state.
        nees_navigation: the same of position and velocity (6).
        bias_ratio: (6,) error of each bias over its own sigma, gyro first.
    """

    nees: float
    nees_navigation: float
    bias_ratio: FloatArray


def check(seed: int, imu: str = "per_sample", duration_s: float = 150.0) -> Outcome:
    """Run eskf15, with the noise of the simulation, on one drive of the simulated field with IMU biases.

    Args:
        seed: of the drive and the biases.
        imu: per_sample (white noise, and the biases of the disturbance ``bias``), or a grade.
        duration_s: length of the drive.
    """
    dataset = FieldWhite(imu=imu, duration_s=duration_s, reference_rate_hz=1.0)
    clean = dataset.load(seed)
    recording = ImuBias().apply(clean, seed) if imu == "per_sample" else clean
    solution = tuned(imu).solve(recording, Tilt().estimate(recording), NoAdaptation())
    error = _error(recording, solution, _true_bias(dataset, clean.imu, recording.imu, seed))
    covariance = solution.covariance
    sigma = np.sqrt(np.diag(covariance))
    return Outcome(
        nees=_squared(error, covariance),
        nees_navigation=_squared(error[:6], covariance[:6, :6]),
        bias_ratio=np.abs(error[9:]) / sigma[9:],
    )


def tuned(imu: str) -> Eskf15:
    """The filter with the noise and the biases of the sensor's data sheet."""
    if imu == "per_sample":  # .0017 rad/s and .02 m/s2 a sample at 100 Hz
        arw, vrw = float(np.rad2deg(0.0017) / 10.0 * 60.0), 0.02 / 10.0 * 60.0
        gyro = float(np.rad2deg(0.002) * 3600.0)
        return Eskf15(arw, vrw, gyro_instability_deg_per_h=0.0, gyro_turn_on_deg_per_h=gyro, accel_turn_on_mg=8.2)
    grade = GRADES[imu]
    return Eskf15(
        grade.angle_random_walk_deg_per_sqrt_h,
        grade.velocity_random_walk_mps_per_sqrt_h,
        gyro_instability_deg_per_h=grade.gyro_instability_deg_per_h / ALLAN_FLOOR,
        gyro_correlation_s=BIAS_TIME_S,
        accel_instability_mg=grade.accel_instability_mg / ALLAN_FLOOR,
        accel_correlation_s=BIAS_TIME_S,
        gyro_turn_on_deg_per_h=grade.gyro_turn_on_deg_per_h,
        accel_turn_on_mg=grade.accel_turn_on_mg,
    )


def _true_bias(dataset: FieldWhite, clean: Imu, recorded: Imu, seed: int) -> FloatArray:
    """(6,) gyro and accelerometer bias at the end: turn-on and wander."""
    if dataset.imu == "per_sample":
        gyro, accel = recorded.gyro_radps - clean.gyro_radps, recorded.accel_mps2 - clean.accel_mps2
    else:  # what a sensor shows that does not move, without its noise
        grade, rate, nothing = GRADES[dataset.imu], dataset.imu_rate_hz, np.zeros_like(clean.gyro_radps)
        sensors = (grade.gyro(rate), "gyro"), (grade.accelerometer(rate), "accelerometer")
        gyro, accel = (
            with_sensor_errors(nothing, replace(e, noise=0.0), 1.0 / rate, seed, name) for e, name in sensors
        )
    return np.concatenate([gyro[-1], accel[-1]])


def _error(recording: Recording, solution: InertialSolution, bias: FloatArray) -> FloatArray:
    """(15,) truth less estimate at the last stamp of the reference, which is the last sample."""
    reference, state = recording.reference, solution.state
    if reference.euler_rad is None or reference.enu_m is None or reference.velocity_mps is None:
        raise ValueError("the simulation's reference knows position, velocity and attitude")
    true = Rotation.from_euler("ZYX", reference.euler_rad[-1, ::-1])
    phi = (true * Rotation.from_matrix(state.dcm).inv()).as_rotvec()
    return np.concatenate(
        [
            reference.enu_m[-1] - state.position_m,
            reference.velocity_mps[-1] - state.velocity_mps,
            phi,
            bias - np.concatenate([state.gyro_bias_radps, state.accel_bias_mps2]),
        ]
    )


def _squared(error: FloatArray, covariance: FloatArray) -> float:
    return float(error @ np.linalg.solve(covariance, error))


def band(states: int, runs: int) -> tuple[float, float]:
    """95 % band of the mean NEES of ``runs`` independent runs."""
    low, high = chi2.ppf([0.025, 0.975], states * runs) / runs
    return float(low), float(high)
