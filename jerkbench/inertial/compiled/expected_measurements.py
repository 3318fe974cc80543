"""The compiled measurement models; `jerkbench.inertial.measurement_models` has the equations.

EXPECTED gets h, and row r of H is numbers STRIDE r and on of its place.
"""

import math

from jerkbench.arrays import FloatArray
from jerkbench.inertial.compiled.layout import (
    ATTITUDE,
    DEFORMED,
    EXPECTED,
    H_AT,
    POSITION,
    RATE,
    ROW,
    STATES,
    STRIDE,
    VELOCITY,
    WHEEL,
    WHEELED,
    ZERO,
    H,
)

BIAS, MATRIX = 16, 22
"""Where errors of the gyro stand in a row: its bias, its deformation."""


def clear(w: FloatArray, first: int) -> None:
    """Let nothing be expected of the rows from ``first`` on."""
    for e in range(first * ROW, 6 * ROW):
        w[H + e] = w[ZERO]


def expect_point(m: FloatArray, arm: FloatArray) -> None:
    """Position and velocity in ENU of a point of the body, rows 0 to 5."""
    for i in range(6):
        m[H_AT + STRIDE * i + i] = 1.0
        m[EXPECTED + i] = m[POSITION + i]
    a, b, c = arm
    if a == 0.0 and b == 0.0 and c == 0.0:
        return
    x, y, z = m[RATE], m[RATE + 1], m[RATE + 2]
    _shift(m, 0, a, b, c)
    _shift(m, 3, y * c - z * b, z * a - x * c, x * b - y * a)
    for i in range(3):
        e, n, u = m[ATTITUDE + 3 * i], m[ATTITUDE + 3 * i + 1], m[ATTITUDE + 3 * i + 2]
        _gyro(m, 3 + i, n * c - u * b, u * a - e * c, e * b - n * a)


def _shift(m: FloatArray, row: int, a: float, b: float, c: float) -> None:
    """Add C l to three rows, and -[C l] for the attitude, l = (a, b, c)."""
    x, y, z = (
        m[ATTITUDE] * a + m[ATTITUDE + 1] * b + m[ATTITUDE + 2] * c,
        m[ATTITUDE + 3] * a + m[ATTITUDE + 4] * b + m[ATTITUDE + 5] * c,
        m[ATTITUDE + 6] * a + m[ATTITUDE + 7] * b + m[ATTITUDE + 8] * c,
    )
    m[EXPECTED + row] += x
    m[EXPECTED + row + 1] += y
    m[EXPECTED + row + 2] += z
    at = H_AT + STRIDE * row + 6
    m[at + 1], m[at + 2] = z, -y
    m[at + STRIDE], m[at + STRIDE + 2] = -z, x
    m[at + 2 * STRIDE], m[at + 2 * STRIDE + 1] = y, -x


def _gyro(m: FloatArray, row: int, a: float, b: float, c: float) -> None:
    """What an error of the gyro does to a row: (a, b, c) times that of the bias, and so for its deformation."""
    at = H_AT + STRIDE * row
    m[at + BIAS], m[at + BIAS + 1], m[at + BIAS + 2] = a, b, c
    if DEFORMED:
        for j in range(3):
            rate = m[RATE + j]
            m[at + MATRIX + 3 * j] = a * rate
            m[at + MATRIX + 3 * j + 1] = b * rate
            m[at + MATRIX + 3 * j + 2] = c * rate


def expect_body_velocity(m: FloatArray, row: int, arm: FloatArray) -> None:
    """Velocity of a point of the body, in the body, three rows from ``row`` on, of which nothing was said before."""
    a, b, c = arm
    x, y, z = m[RATE], m[RATE + 1], m[RATE + 2]
    e, n, u = m[VELOCITY], m[VELOCITY + 1], m[VELOCITY + 2]
    m[EXPECTED + row], m[EXPECTED + row + 1] = y * c - z * b, z * a - x * c
    m[EXPECTED + row + 2] = x * b - y * a
    for i in range(3):
        at = H_AT + STRIDE * (row + i)
        f, g, h = m[ATTITUDE + i], m[ATTITUDE + 3 + i], m[ATTITUDE + 6 + i]
        m[EXPECTED + row + i] += f * e + g * n + h * u
        m[at + 3], m[at + 4], m[at + 5] = f, g, h
        m[at + 6], m[at + 7], m[at + 8] = g * u - h * n, h * e - f * u, f * n - g * e
    _gyro(m, row, 0.0, -c, b)
    _gyro(m, row + 1, c, 0.0, -a)
    _gyro(m, row + 2, -b, a, 0.0)


def expect_wheel(m: FloatArray, row: int, arm: FloatArray) -> None:
    """Likewise what a wheel shows of it."""
    expect_body_velocity(m, row, arm)
    if WHEELED:
        at = H_AT + STRIDE * row
        for s in range(STRIDE):
            m[at + s] *= 1.0 + m[WHEEL]
        m[at + STATES + 6] = m[EXPECTED + row]
        m[EXPECTED + row] *= 1.0 + m[WHEEL]


def expect_heading(m: FloatArray) -> None:
    """Yaw, row 0."""
    e, n, u = m[ATTITUDE], m[ATTITUDE + 3], m[ATTITUDE + 6]
    level = e * e + n * n
    m[H_AT + 6], m[H_AT + 7], m[H_AT + 8] = -u * e / level, -u * n / level, 1.0
    m[EXPECTED] = math.atan2(n, e)
