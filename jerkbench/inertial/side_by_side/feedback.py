"""The estimated error, put into the nominal state; `jerkbench.inertial.state` and `.update` have the equations."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.views import RunView, View, lane, room, row
from jerkbench.inertial.side_by_side.strapdown import fill_turn, multiply, multiply_transposed
from jerkbench.recording import GRAVITY_MPS2

CHANGED = 6
"""Error states that have other numbers afterwards: attitude and accelerometer bias."""


def feed_back(run: RunView) -> None:
    """Put attitude and biases into the nominal state, whose position and velocity are corrected already."""
    for i in range(3):
        for j in range(3):
            run.before[i, j] = run.C[i, j]
    fill_turn(run, run.x[6], run.x[7], run.x[8])
    multiply(run.turn, run.before, run.next)
    multiply_transposed(run.next, run.next, run.turn)
    multiply(run.next, run.turn, run.C)
    for i in range(3):  # orthogonal again: C (3 I - C'C)/2
        for j in range(3):
            run.C[i, j] = 1.5 * run.next[i, j] - 0.5 * run.C[i, j]
    multiply_transposed(run.C, run.before, run.back)
    _add_biases(run)
    _carry(run)
    for s in range(6, run.s):
        run.x[s] = run.x[s] * 0.0


def _add_biases(run: RunView) -> None:
    """The accelerometer's bias keeps the force that holds the body up."""
    g, a, b, c = GRAVITY_MPS2, run.x[12], run.x[13], run.x[14]
    e = g * run.x[7] - (run.before[0, 0] * a + run.before[0, 1] * b + run.before[0, 2] * c)
    n = 0.0 - g * run.x[6] - (run.before[1, 0] * a + run.before[1, 1] * b + run.before[1, 2] * c)
    u = g - (run.before[2, 0] * a + run.before[2, 1] * b + run.before[2, 2] * c)
    for i in range(3):
        shown = run.C[0, i] * e + run.C[1, i] * n + run.C[2, i] * u
        run.gyro_bias[i] += run.x[9 + i]
        run.accel_bias[i] += g * run.before[2, i] - shown


def _carry(run: RunView) -> None:
    """P = G P G', first the columns, then the rows of the states that have other numbers."""
    c, half = room(run, "6"), room(run, "6 6")
    for t in range(6):
        _carry_column(run, t)
    for t in range(9, 12):
        _carry_column(run, t)
    for t in range(CHANGED):
        for k in range(CHANGED):
            c[k] = run.P[_state(k), _state(t)]
        _transform(c, run)
        for k in range(CHANGED):
            half[k, t] = c[k]
    for r in range(CHANGED):
        for k in range(CHANGED):
            c[k] = half[r, k]
        _transform(c, run)
        for k in range(r, CHANGED):
            run.P[_state(r), _state(k)] = c[k]


def _carry_column(run: RunView, t: int) -> None:
    """The column of a state that stays as it is."""
    c = room(run, "6")
    for k in range(CHANGED):
        c[k] = run.P[_state(k), t]
    _transform(c, run)
    for k in range(CHANGED):
        run.P[_state(k), t] = c[k]


def _state(k: int) -> int:
    """The attitude, then the accelerometer's bias."""
    return 6 + k if k < 3 else 9 + k


def _transform(c: View, run: RunView) -> None:
    """Apply G of `jerkbench.inertial.update.reset`."""
    g = GRAVITY_MPS2
    x, y, z = 0.5 * run.x[6], 0.5 * run.x[7], 0.5 * run.x[8]
    p, q, r = y * c[2] - z * c[1], z * c[0] - x * c[2], x * c[1] - y * c[0]
    c[0] += p
    c[1] += q
    c[2] += r
    a, b, d = c[3], c[4], c[5]
    for i in range(3):
        turned = run.back[i, 0] * a + run.back[i, 1] * b + run.back[i, 2] * d
        c[3 + i] = turned + (g * run.C[0, i]) * q - (g * run.C[1, i]) * p


# The update with a measured yaw; `jerkbench.inertial.measurement_models.heading` has the equations.


def take_heading(run: RunView, yaw: FloatArray, which: int) -> None:
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


def _innovate(alone: RunView, yaw: float) -> None:
    """Fill the innovation, between -pi and pi, and 1 in ``measured``; both are 0 where nothing is measured."""
    measured = np.isfinite(yaw)
    apart = yaw - math.atan2(alone.C[1, 0], alone.C[0, 0]) + math.pi
    wrapped = apart - 2.0 * math.pi * math.floor(apart / (2.0 * math.pi)) - math.pi if measured else 0.0
    alone.innovation = wrapped
    alone.measured = 1.0 if measured else 0.0
