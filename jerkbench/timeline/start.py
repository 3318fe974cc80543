"""Position and velocity at the start of a run, and their covariance."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.estimate import Attitude
from jerkbench.timeline.measurements import Measurements

INITIAL_SPEED_SIGMA_MPS = 10.0
"""One sigma of a velocity axis that nothing measures in the last second before the start, or at it."""

INITIAL_SPEED_AGE_S = 1.0
"""The largest age of a velocity to start from."""

INPUT_SIGMA_MPS2 = 0.5
"""One sigma of what is wrong with u on each axis, alike over the second: above all gravity that leaks by the tilt."""

UNSEEN_SIGMA_MPS2 = 2.0
"""One sigma of the acceleration of a vehicle while no IMU sees it."""


def start_motion(
    measurements: Measurements, first: int, attitude: Attitude | None, dt0_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return x0 (6,) and P0 (6, 6): position of the fix ``first``, velocity as it was last measured, moved up to it.

    Each velocity axis comes from its latest measurement of the last second up to the fix; axes of the same measurement
    keep their covariances. With tau its age, and the input u of the part tau_u of it that the IMU saw (nothing where
    ``attitude`` is None: there is no IMU)::

        v = z + int u dt;  P = R + (tau_u .5 m/s2)^2 I + ((tau - tau_u) 2 m/s2)^2 I

    An axis that was not measured by then is 0 +- 10 m/s: what comes later is an update, and must not be used twice. A
    measurement that is no surer than that in some direction (a speed, across) is not taken there.
    """
    x0, P0 = np.zeros(6), np.diag([1.0] * 3 + [INITIAL_SPEED_SIGMA_MPS**2] * 3)
    x0[:3], P0[:3, :3] = measurements.z[first, :3], measurements.R[first, :3, :3]
    start_s = measurements.t_ns[first] * 1e-9
    rows = latest_rows(measurements, first)
    for row in np.unique(rows[rows >= 0]):
        axes = 3 + np.flatnonzero(rows == row)
        block = np.ix_(axes, axes)
        z, R = measurements.z[row, axes], measurements.R[row][block]
        age_s = (measurements.t_ns[first] - measurements.t_ns[row]) * 1e-9
        if age_s > 0:
            gained, seen_s = _gained(attitude, dt0_s, start_s - age_s, start_s)
            grown = (seen_s * INPUT_SIGMA_MPS2) ** 2 + ((age_s - seen_s) * UNSEEN_SIGMA_MPS2) ** 2
            z, R = z + gained[axes - 3], R + grown * np.eye(len(axes))
        x0[axes], P0[block] = _bounded(z, R)
    return x0, P0


def latest_rows(measurements: Measurements, first: int) -> IntArray:
    """Row of the latest measurement of each velocity axis (3,) in the last second up to the fix; -1: there is none."""
    age_ns = measurements.t_ns[first] - measurements.t_ns
    recent = (age_ns >= 0) & (age_ns <= round(INITIAL_SPEED_AGE_S * 1e9))
    measured = recent[:, None] & np.isfinite(measurements.z[:, 3:])
    last = len(measured) - 1 - np.argmax(measured[::-1], axis=0)
    return np.where(measured.any(axis=0), last, -1)


def _bounded(z: FloatArray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A velocity and its covariance, 0 +- 10 m/s along the principal axes where it is no surer."""
    variances, axes = np.linalg.eigh(R)
    sure = variances < INITIAL_SPEED_SIGMA_MPS**2
    if sure.all():
        return z, R
    kept = axes[:, sure]
    P = axes * np.where(sure, variances, INITIAL_SPEED_SIGMA_MPS**2) @ axes.T
    return kept @ (kept.T @ z), 0.5 * (P + P.T)


def _gained(attitude: Attitude | None, dt0_s: float, begin_s: float, end_s: float) -> tuple[FloatArray, float]:
    """The integral (3,) of the input u between two times, and how much of that time an IMU saw."""
    if attitude is None:
        return np.zeros(3), 0.0
    nodes_s = np.concatenate(([attitude.t_s[0] - dt0_s], attitude.t_s))
    ends_s = np.clip(nodes_s, begin_s, end_s)
    parts_s = np.diff(ends_s)
    return parts_s @ attitude.accel_enu_mps2, float(parts_s.sum())
