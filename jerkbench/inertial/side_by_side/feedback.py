"""The estimated error, put into the nominal state; `jerkbench.inertial.state` and `.update` have the equations."""

from jerkbench.compilation.views import Run, View, room
from jerkbench.inertial.side_by_side.rotate import fill_turn, multiply, multiply_transposed
from jerkbench.recording import GRAVITY_MPS2

CHANGED = 6
"""Error states that have other numbers afterwards: attitude and accelerometer bias."""


def feed_back(run: Run) -> None:
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


def _add_biases(run: Run) -> None:
    """The accelerometer's bias keeps the force that holds the body up."""
    g, a, b, c = GRAVITY_MPS2, run.x[12], run.x[13], run.x[14]
    e = g * run.x[7] - (run.before[0, 0] * a + run.before[0, 1] * b + run.before[0, 2] * c)
    n = 0.0 - g * run.x[6] - (run.before[1, 0] * a + run.before[1, 1] * b + run.before[1, 2] * c)
    u = g - (run.before[2, 0] * a + run.before[2, 1] * b + run.before[2, 2] * c)
    for i in range(3):
        shown = run.C[0, i] * e + run.C[1, i] * n + run.C[2, i] * u
        run.gyro_bias[i] += run.x[9 + i]
        run.accel_bias[i] += g * run.before[2, i] - shown


def _carry(run: Run) -> None:
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


def _carry_column(run: Run, t: int) -> None:
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


def _transform(c: View, run: Run) -> None:
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
