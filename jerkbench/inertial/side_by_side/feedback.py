"""The estimated error, put into the nominal state; `jerkbench.inertial.state` and `.update` have the equations."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.inertial.compiled.mechanise import multiply
from jerkbench.inertial.side_by_side.layout import ACCEL_BIAS, ATTITUDE, BACK, BEFORE, GYRO_BIAS, NEXT, TURN
from jerkbench.inertial.side_by_side.rotate import fill_turn
from jerkbench.kinematic.layout import AT, WIDTH, X
from jerkbench.recording import GRAVITY_MPS2

CHANGED, SQUARE_OF_CHANGED, ALL = 6, 36, 15
"""Error states that have other numbers afterwards, the length of their block, and all of them."""


def feed_back(w: FloatArray, m: FloatArray, numbers: FloatArray) -> None:
    """Put attitude and biases into the nominal state, whose position and velocity are corrected already.

    Args:
        w: the runs.
        m: the rest of the nominal states.
        numbers: the same, number by number.
    """
    for i in range(9):
        m[BEFORE + i] = m[ATTITUDE + i]
    fill_turn(m, numbers, w[X + 6], w[X + 7], w[X + 8])
    multiply(m, TURN, BEFORE, NEXT)
    _product(m, NEXT, NEXT, TURN)
    multiply(m, NEXT, TURN, ATTITUDE)
    for i in range(9):
        m[ATTITUDE + i] = 1.5 * m[NEXT + i] - 0.5 * m[ATTITUDE + i]
    _product(m, ATTITUDE, BEFORE, BACK)
    _add_biases(w, m)
    _carry(w, m)
    for s in range(CHANGED, ALL):
        w[X + s] = w[X + s] * 0.0


def _product(m: FloatArray, left: int, right: int, into: int) -> None:
    """Product of the transposed left and the right matrix."""
    for i in range(3):
        for j in range(3):
            m[into + 3 * i + j] = (
                m[left + i] * m[right + j] + m[left + 3 + i] * m[right + 3 + j] + m[left + 6 + i] * m[right + 6 + j]
            )


def _add_biases(w: FloatArray, m: FloatArray) -> None:
    """The accelerometer's bias keeps the force that holds the body up."""
    g, a, b, c = GRAVITY_MPS2, w[X + 12], w[X + 13], w[X + 14]
    e = g * w[X + 7] - (m[BEFORE] * a + m[BEFORE + 1] * b + m[BEFORE + 2] * c)
    n = 0.0 - g * w[X + 6] - (m[BEFORE + 3] * a + m[BEFORE + 4] * b + m[BEFORE + 5] * c)
    u = g - (m[BEFORE + 6] * a + m[BEFORE + 7] * b + m[BEFORE + 8] * c)
    for i in range(3):
        shown = m[ATTITUDE + i] * e + m[ATTITUDE + 3 + i] * n + m[ATTITUDE + 6 + i] * u
        m[GYRO_BIAS + i] += w[X + 9 + i]
        m[ACCEL_BIAS + i] += g * m[BEFORE + 6 + i] - shown


def _carry(w: FloatArray, m: FloatArray) -> None:
    """P = G P G', first the columns, then the rows of the states that have other numbers."""
    c, half = scratch(CHANGED, WIDTH), scratch(SQUARE_OF_CHANGED, WIDTH)
    for t in range(6):
        _carry_column(w, m, t)
    for t in range(9, 12):
        _carry_column(w, m, t)
    for t in range(CHANGED):
        for k in range(CHANGED):
            c[k] = w[AT[_state(k), _state(t)]]
        _transform(c, w, m)
        for k in range(CHANGED):
            half[CHANGED * k + t] = c[k]
    _carry_rows(w, m, half)


def _carry_column(w: FloatArray, m: FloatArray, t: int) -> None:
    """The column of a state that stays as it is."""
    c = scratch(CHANGED, WIDTH)
    for k in range(CHANGED):
        c[k] = w[AT[_state(k), t]]
    _transform(c, w, m)
    for k in range(CHANGED):
        w[AT[_state(k), t]] = c[k]


def _carry_rows(w: FloatArray, m: FloatArray, half: FloatArray) -> None:
    c = scratch(CHANGED, WIDTH)
    for r in range(CHANGED):
        for k in range(CHANGED):
            c[k] = half[CHANGED * r + k]
        _transform(c, w, m)
        for k in range(r, CHANGED):
            w[AT[_state(r), _state(k)]] = c[k]


def _state(k: int) -> int:
    """The attitude, then the accelerometer's bias."""
    return 6 + k if k < 3 else 9 + k


def _transform(c: FloatArray, w: FloatArray, m: FloatArray) -> None:
    """Apply G of `jerkbench.inertial.update.reset`."""
    g = GRAVITY_MPS2
    x, y, z = 0.5 * w[X + 6], 0.5 * w[X + 7], 0.5 * w[X + 8]
    p, q, r = y * c[2] - z * c[1], z * c[0] - x * c[2], x * c[1] - y * c[0]
    c[0] += p
    c[1] += q
    c[2] += r
    a, b, d = c[3], c[4], c[5]
    for i in range(3):
        turned = m[BACK + 3 * i] * a + m[BACK + 3 * i + 1] * b + m[BACK + 3 * i + 2] * d
        c[3 + i] = turned + (g * m[ATTITUDE + i]) * q - (g * m[ATTITUDE + 3 + i]) * p
