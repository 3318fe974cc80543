"""The update with a measured yaw; `jerkbench.inertial.measurement_models.heading` has the equations."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import vectors
from jerkbench.inertial.side_by_side.layout import ATTITUDE, INNOVATION, MEASURED
from jerkbench.kinematic.layout import AT, WIDTH, S, X


def take_heading(w: FloatArray, m: FloatArray, numbers: FloatArray, yaw: FloatArray, row: int) -> None:
    """Estimate the error from row ``row`` of the yaws, in the runs that have one: K = P H'/S, P - K S K'.

    Args:
        w: the runs, whose error is zero; of position and velocity it is put into the nominal state.
        m: the rest of the nominal states.
        numbers: the same, number by number.
        yaw: (rows, 2, WIDTH) measured yaw [rad], NaN where there is none, and its sigma.
        row: which.
    """
    _innovate(numbers, yaw, row)
    e, n, u = m[ATTITUDE], m[ATTITUDE + 3], m[ATTITUDE + 6]
    level = e * e + n * n
    of_east, of_north = 0.0 - u * e / level, 0.0 - u * n / level
    sigma = vectors(yaw, WIDTH)[2 * row + 1]
    column = scratch(S, WIDTH)  # P H'
    for s in range(S):
        column[s] = of_east * w[AT[6, s]] + of_north * w[AT[7, s]] + w[AT[8, s]]
    share = m[MEASURED] / (of_east * column[6] + of_north * column[7] + column[8] + sigma * sigma)
    for s in range(S):
        gain = share * column[s]
        w[X + s] += gain * m[INNOVATION]
        for t in range(s + 1):
            w[AT[s, t]] = w[AT[s, t]] - gain * column[t]


def _innovate(numbers: FloatArray, yaw: FloatArray, row: int) -> None:
    """Fill the innovation, between -pi and pi, and 1 in MEASURED; both are 0 where nothing is measured."""
    for run in range(WIDTH):
        measured = np.isfinite(yaw[row, 0, run])
        expected = math.atan2(numbers[WIDTH * (ATTITUDE + 3) + run], numbers[WIDTH * ATTITUDE + run])
        apart = yaw[row, 0, run] - expected + math.pi
        wrapped = apart - 2.0 * math.pi * math.floor(apart / (2.0 * math.pi)) - math.pi if measured else 0.0
        numbers[WIDTH * INNOVATION + run] = wrapped
        numbers[WIDTH * MEASURED + run] = 1.0 if measured else 0.0
