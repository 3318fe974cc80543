"""Streams whose axes were true at different times before their common stamp."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Velocity


def velocity_when_true(
    t_s: FloatArray, enu_mps: FloatArray, covariance_m2ps2: FloatArray, latency_s: tuple[float, ...]
) -> Velocity:
    """Put each axis of an ENU velocity at the time when it was true, its stamp less its latency.

    Axes that were true at the same time share a row and keep their cross-covariance; the others are NaN there.

    Args:
        t_s: (m,) stamps.
        enu_mps: (m, 3).
        covariance_m2ps2: (m, 3, 3).
        latency_s: of east, north, up.

    Returns:
        Up to 3 m rows in the order of time.
    """
    valid_ns = np.round((t_s[:, None] - np.array(latency_s)) * 1e9).astype(np.int64)
    grid_ns, inverse = np.unique(valid_ns, return_inverse=True)
    rows = inverse.reshape(valid_ns.shape)
    mps, covariance = np.full((len(grid_ns), 3), np.nan), np.tile(np.eye(3), (len(grid_ns), 1, 1))
    for i in range(3):
        mps[rows[:, i], i] = enu_mps[:, i]
        for j in range(3):
            same = rows[:, i] == rows[:, j]
            covariance[rows[same, i], i, j] = covariance_m2ps2[same, i, j]
    return Velocity(grid_ns * 1e-9, mps, covariance)
