"""The update with a measured yaw; `jerkbench.inertial.measurement_models.heading` has the equations."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.views import Run, lane, room, row


def take_heading(run: Run, yaw: FloatArray, which: int) -> None:
    """Estimate the error from row ``which`` of the yaws, in the runs that have one: K = P H'/S, P - K S K'.

    Args:
        run: the runs, whose error is zero; of position and velocity it is put into the nominal state.
        yaw: (rows, 2, WIDTH) measured yaw [rad], NaN where there is none, and its sigma.
        which: the row.
    """
    for k in range(run.width):
        _innovate(lane(run, k), yaw[which, 0, k])
    e, n, u = run.C[0, 0], run.C[1, 0], run.C[2, 0]
    level = e * e + n * n
    of_east, of_north = 0.0 - u * e / level, 0.0 - u * n / level
    sigma, column = row(yaw, which, run, "2")[1], room(run, "s")
    for s in range(run.s):  # P H'
        column[s] = of_east * run.P[s, 6] + of_north * run.P[s, 7] + run.P[s, 8]
    share = run.measured / (of_east * column[6] + of_north * column[7] + column[8] + sigma * sigma)
    for s in range(run.s):
        gain = share * column[s]
        run.x[s] += gain * run.innovation
        for t in range(s + 1):
            run.P[s, t] = run.P[s, t] - gain * column[t]


def _innovate(alone: Run, yaw: float) -> None:
    """Fill the innovation, between -pi and pi, and 1 in ``measured``; both are 0 where nothing is measured."""
    measured = np.isfinite(yaw)
    apart = yaw - math.atan2(alone.C[1, 0], alone.C[0, 0]) + math.pi
    wrapped = apart - 2.0 * math.pi * math.floor(apart / (2.0 * math.pi)) - math.pi if measured else 0.0
    alone.innovation = wrapped
    alone.measured = 1.0 if measured else 0.0
