"""Strapdown mechanisation of a step; `jerkbench.inertial.mechanisation` has the equations."""

import math

from jerkbench.arrays import FloatArray
from jerkbench.inertial.compiled.arguments import Flow, Given
from jerkbench.inertial.compiled.layout import (
    ACCEL_BIAS,
    ACCEL_MATRIX,
    ATTITUDE,
    DEFORMED,
    FORCE,
    GYRO_BIAS,
    GYRO_MATRIX,
    LEVER,
    NEXT,
    POSITION,
    RATE,
    TURN,
    TWIST,
    VELOCITY,
)
from jerkbench.recording import GRAVITY_MPS2

SMALL = 0.01
"""Square of an angle below which a series to the tenth power gives sine and cosine to the last digit."""


TINY = 1e-12
"""A smaller angle counts as this one: to the last digit there is no difference."""


def mechanise(m: FloatArray, flow: Flow, given: Given, k: int) -> None:
    """Carry the nominal state over step ``k``."""
    dt = flow.dt_s[k]
    _calibrate(m, flow, flow.sample[k])
    fill_rotation(m, dt * m[RATE], dt * m[RATE + 1], dt * m[RATE + 2])
    multiply(m, ATTITUDE, TURN, NEXT)
    if given.rotates:
        e, n, u = given.rate_radps
        fill_rotation(m, -dt * e, -dt * n, -dt * u)
        for i in range(9):
            m[LEVER + i] = m[NEXT + i]
        multiply(m, TURN, LEVER, NEXT)
    for i in range(9):
        m[LEVER + i] = 0.5 * (m[ATTITUDE + i] + m[NEXT + i])
        m[ATTITUDE + i] = m[NEXT + i]
    for i in range(3):
        row = LEVER + 3 * i
        m[TWIST + i] = m[row] * m[FORCE] + m[row + 1] * m[FORCE + 1] + m[row + 2] * m[FORCE + 2]
    _move(m, given, dt)
    for i in range(9):
        m[LEVER + i] *= -dt
    for i in range(3):
        m[TWIST + i] *= -dt


def _calibrate(m: FloatArray, flow: Flow, sample: int) -> None:
    """Specific force and rate without what is known of the sensors' errors."""
    for i in range(3):
        m[FORCE + i] = flow.accel_mps2[sample, i] - m[ACCEL_BIAS + i]
        m[RATE + i] = flow.gyro_radps[sample, i] - m[GYRO_BIAS + i]
    if DEFORMED:
        _straighten(m, FORCE, ACCEL_MATRIX)
        _straighten(m, RATE, GYRO_MATRIX)


def _straighten(m: FloatArray, seen: int, matrix: int) -> None:
    """Subtract M y from y."""
    a, b, c = m[seen], m[seen + 1], m[seen + 2]
    for i in range(3):
        m[seen + i] -= m[matrix + i] * a + m[matrix + 3 + i] * b + m[matrix + 6 + i] * c


def _move(m: FloatArray, given: Given, dt: float) -> None:
    """Position and velocity; TWIST holds the specific force in ENU."""
    g, per = GRAVITY_MPS2, given.per_radius
    x, y, z = m[VELOCITY], m[VELOCITY + 1], m[VELOCITY + 2]
    e = m[TWIST] - g * m[POSITION] * per
    n = m[TWIST + 1] - g * m[POSITION + 1] * per
    u = m[TWIST + 2] - g * (1.0 - 2.0 * m[POSITION + 2] * per)
    if given.rotates:
        a, b, c = given.rate_radps
        e -= 2.0 * (b * z - c * y)
        n -= 2.0 * (c * x - a * z)
        u -= 2.0 * (a * y - b * x)
    m[VELOCITY], m[VELOCITY + 1], m[VELOCITY + 2] = x + e * dt, y + n * dt, z + u * dt
    m[POSITION] += (x + m[VELOCITY]) * (0.5 * dt)
    m[POSITION + 1] += (y + m[VELOCITY + 1]) * (0.5 * dt)
    m[POSITION + 2] += (z + m[VELOCITY + 2]) * (0.5 * dt)


def fill_rotation(m: FloatArray, x: float, y: float, z: float) -> None:
    """TURN = Exp of a rotation vector, as in `jerkbench.inertial.rotation.rotation_exp`."""
    square = x * x + y * y + z * z
    if square < SMALL:
        s = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
        c = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    else:
        a = math.sqrt(square)
        half = math.sin(0.5 * a) / (0.5 * a)
        s, c = math.sin(a) / a, 0.5 * half * half
    m[TURN], m[TURN + 4], m[TURN + 8] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    m[TURN + 1], m[TURN + 3] = c * x * y - s * z, c * x * y + s * z
    m[TURN + 2], m[TURN + 6] = c * x * z + s * y, c * x * z - s * y
    m[TURN + 5], m[TURN + 7] = c * y * z - s * x, c * y * z + s * x


def fill_left_jacobian(m: FloatArray, x: float, y: float, z: float) -> None:
    """TURN = J of a rotation vector, as in `jerkbench.inertial.rotation.left_jacobian`."""
    a = max(math.sqrt(x * x + y * y + z * z), TINY)
    half = math.sin(0.5 * a) / (0.5 * a)
    s, c = 0.5 * half * half, (a - math.sin(a)) / (a * a * a)
    m[TURN], m[TURN + 4], m[TURN + 8] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    m[TURN + 1], m[TURN + 3] = c * x * y - s * z, c * x * y + s * z
    m[TURN + 2], m[TURN + 6] = c * x * z + s * y, c * x * z - s * y
    m[TURN + 5], m[TURN + 7] = c * y * z - s * x, c * y * z + s * x


def multiply(m: FloatArray, left: int, right: int, into: int) -> None:
    """Product of two matrices (3, 3), into the place of neither."""
    for i in range(3):
        a, b, c = m[left + 3 * i], m[left + 3 * i + 1], m[left + 3 * i + 2]
        for j in range(3):
            m[into + 3 * i + j] = a * m[right + j] + b * m[right + 3 + j] + c * m[right + 6 + j]
