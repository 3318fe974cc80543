"""The noise of an IMU at rest, and the grade of sensor that it suggests."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import GRAVITY_MPS2, Recording
from jerkbench.simulation.imu import ALLAN_FLOOR, GRADES

SHORTEST_REST_S = 5.0
POINTS = 40
LONGEST_PART = 0.25
"""Averages over more than this part of the rest are too few to say anything."""

WHITE_S = (0.05, 1.0)
"""The averaging times for the white noise: below the drift, above a resonance of the mounting."""

FLOOR_NEEDS_S = 60.0
"""A rest that is shorter does not reach the floor of the Allan deviation."""


@dataclass(frozen=True, eq=False)
class RestNoise:
    """The noise of an IMU, measured at rest.

    Attributes:
        duration_s: of the rest.
        tau_s: (k,) averaging times.
        gyro_radps: (k, 3) Allan deviation.
        accel_mps2: (k, 3) Allan deviation.
        angle_random_walk_deg_per_sqrt_h: the largest of the axes.
        velocity_random_walk_mps_per_sqrt_h: the largest of the axes.
        gyro_instability_deg_per_h: lowest Allan deviation over `ALLAN_FLOOR`, the largest of the axes; NaN: too short.
        accel_instability_mg: likewise.
        grade: the preset of the simulator's IMU (``dataset.imu``) whose white noise is nearest.
    """

    duration_s: float
    tau_s: FloatArray
    gyro_radps: FloatArray
    accel_mps2: FloatArray
    angle_random_walk_deg_per_sqrt_h: float
    velocity_random_walk_mps_per_sqrt_h: float
    gyro_instability_deg_per_h: float
    accel_instability_mg: float
    grade: str


def rest_noise(recording: Recording) -> RestNoise | None:
    """Return what the rest at the recording's start tells; None where the one that is known is shorter than 5 s.

    White noise N is the mean of adev(tau) sqrt(tau) over tau from 0.05 to 1 s. An engine that idles counts as noise.
    """
    imu = recording.imu
    if imu is None or recording.static_start_s < SHORTEST_REST_S:
        return None
    rows = imu.t_s < imu.t_s[0] + recording.static_start_s
    interval_s = imu.nominal_interval_s
    tau_s, gyro = allan_deviation(imu.gyro_radps[rows], interval_s)
    _, accel = allan_deviation(imu.accel_mps2[rows], interval_s)
    angle = np.degrees(_white(tau_s, gyro)) * 60.0
    velocity = _white(tau_s, accel) * 60.0
    long = recording.static_start_s >= FLOOR_NEEDS_S
    return RestNoise(
        duration_s=recording.static_start_s,
        tau_s=tau_s,
        gyro_radps=gyro,
        accel_mps2=accel,
        angle_random_walk_deg_per_sqrt_h=angle,
        velocity_random_walk_mps_per_sqrt_h=velocity,
        gyro_instability_deg_per_h=np.degrees(_floor(gyro)) * 3600.0 if long else float("nan"),
        accel_instability_mg=_floor(accel) / GRAVITY_MPS2 * 1e3 if long else float("nan"),
        grade=nearest_grade(angle, velocity),
    )


def allan_deviation(samples: FloatArray, interval_s: float) -> tuple[FloatArray, FloatArray]:
    """Return averaging times (k,) and the overlapping Allan deviation (k, m) of samples (n, m).

    With theta the running integral and tau = j dt::

        adev(tau)^2 = mean over i of (theta_{i+2j} - 2 theta_{i+j} + theta_i)^2 / (2 tau^2)

    Source: IEEE Std 952, annex C.
    """
    theta = np.vstack([np.zeros(samples.shape[1]), np.cumsum(samples * interval_s, axis=0)])
    longest = max(1, int(LONGEST_PART * len(samples)))
    steps = np.unique(np.round(np.geomspace(1, longest, POINTS)).astype(np.int64))
    rows = [np.sqrt(((theta[2 * j :] - 2 * theta[j:-j] + theta[: -2 * j]) ** 2).mean(axis=0) / 2) for j in steps]
    tau_s = np.asarray(steps * interval_s, dtype=np.float64)
    return tau_s, np.array(rows) / tau_s[:, None]


def nearest_grade(angle_random_walk_deg_per_sqrt_h: float, velocity_random_walk_mps_per_sqrt_h: float) -> str:
    """Return the grade whose two random walks are nearest, as ratios."""

    def distance(name: str) -> float:
        """Return how far the two ratios to the grade ``name`` are from 1, as logarithms."""
        grade = GRADES[name]
        ratios = (
            angle_random_walk_deg_per_sqrt_h / grade.angle_random_walk_deg_per_sqrt_h,
            velocity_random_walk_mps_per_sqrt_h / grade.velocity_random_walk_mps_per_sqrt_h,
        )
        with np.errstate(divide="ignore"):
            return float(np.hypot(*np.log(ratios)))

    return min(GRADES, key=distance)


def _white(tau_s: FloatArray, deviation: FloatArray) -> float:
    """N, the largest of the axes."""
    rows = (tau_s >= WHITE_S[0]) & (tau_s <= WHITE_S[1])
    rows = rows if rows.any() else np.ones(len(tau_s), dtype=bool)
    return float((deviation[rows] * np.sqrt(tau_s[rows])[:, None]).mean(axis=0).max())


def _floor(deviation: FloatArray) -> float:
    return float(deviation.min(axis=0).max()) / ALLAN_FLOOR
