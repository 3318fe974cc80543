"""The estimated error, put into the nominal state, and the covariance of what is left."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.compiled.layout import (
    ACCEL_BIAS,
    ACCEL_MATRIX,
    ATTITUDE,
    BACK,
    BEFORE,
    DEFORMED,
    DX_AT,
    GYRO_BIAS,
    GYRO_MATRIX,
    INVARIANT,
    NEXT,
    P_AT,
    POSITION,
    PUSH,
    ROW,
    SHIFT,
    SPARE,
    SPARE_AT,
    STATES,
    STRIDE,
    TURN,
    VELOCITY,
    WHEEL,
    WHEELED,
    P,
)
from jerkbench.inertial.compiled.mechanise import fill_left_jacobian, fill_rotation, multiply
from jerkbench.inertial.compiled.update import exchange, symmetrise
from jerkbench.recording import GRAVITY_MPS2

SENSED = 16
"""Where what is known of the sensors begins in DX: gyro bias, accelerometer bias, deformations, wheel."""


def feed_back(w: FloatArray, m: FloatArray) -> None:
    """Put DX into the state, and carry P over, as `jerkbench.inertial.state` and `jerkbench.inertial.update` do.

    Invariant: as `jerkbench.inertial.invariant` does.
    """
    for i in range(9):
        m[BEFORE + i] = m[ATTITUDE + i]
    _turn(m)
    if INVARIANT:
        _shift(m)
        _add_sensed(m)
    else:
        _add_errors(m)
        _look_back(m)
    for piece in range(ROW):
        _carry_piece(w, m, piece)
    exchange(m)
    for piece in range(ROW):
        _carry_piece(w, m, piece)
    symmetrise(m)


def _carry_piece(w: FloatArray, m: FloatArray, piece: int) -> None:
    if INVARIANT:
        _carry_on_group(w, m, piece)
    else:
        _carry(w, m, piece)


def _look_back(m: FloatArray) -> None:
    """BACK = C+' C."""
    for i in range(3):
        for j in range(3):
            m[BACK + 3 * i + j] = (
                m[ATTITUDE + i] * m[BEFORE + j]
                + m[ATTITUDE + 3 + i] * m[BEFORE + 3 + j]
                + m[ATTITUDE + 6 + i] * m[BEFORE + 6 + j]
            )


def _shift(m: FloatArray) -> None:
    """Move position and velocity by J dp and J dv."""
    fill_left_jacobian(m, m[DX_AT + 6], m[DX_AT + 7], m[DX_AT + 8])
    for part in range(0, 6, 3):
        for i in range(3):
            m[SHIFT + part + i] = (
                m[TURN + 3 * i] * m[DX_AT + part]
                + m[TURN + 3 * i + 1] * m[DX_AT + part + 1]
                + m[TURN + 3 * i + 2] * m[DX_AT + part + 2]
            )
    for i in range(3):
        m[POSITION + i] += m[SHIFT + i]
        m[VELOCITY + i] += m[SHIFT + 3 + i]


def _add_sensed(m: FloatArray) -> None:
    """Add what is known of the sensors."""
    for i in range(3):
        m[GYRO_BIAS + i] += m[DX_AT + SENSED + i]
        m[ACCEL_BIAS + i] += m[DX_AT + SENSED + 3 + i]
    if DEFORMED:
        for i in range(9):
            m[GYRO_MATRIX + i] += m[DX_AT + SENSED + 6 + i]
            m[ACCEL_MATRIX + i] += m[DX_AT + SENSED + 15 + i]
    if WHEELED:
        m[WHEEL] += m[DX_AT + STATES + 6]


def _turn(m: FloatArray) -> None:
    """C+ = Exp(phi) C, orthonormal."""
    fill_rotation(m, m[DX_AT + 6], m[DX_AT + 7], m[DX_AT + 8])
    multiply(m, TURN, BEFORE, NEXT)
    for i in range(3):
        for j in range(3):  # C' C
            m[TURN + 3 * i + j] = (
                m[NEXT + i] * m[NEXT + j] + m[NEXT + 3 + i] * m[NEXT + 3 + j] + m[NEXT + 6 + i] * m[NEXT + 6 + j]
            )
    multiply(m, NEXT, TURN, ATTITUDE)
    for i in range(9):
        m[ATTITUDE + i] = 1.5 * m[NEXT + i] - 0.5 * m[ATTITUDE + i]


def _add_errors(m: FloatArray) -> None:
    """Add the rest; the accelerometer's bias keeps the force that holds the body up."""
    g = GRAVITY_MPS2
    for i in range(3):
        m[POSITION + i] += m[DX_AT + i]
        m[VELOCITY + i] += m[DX_AT + 3 + i]
        m[GYRO_BIAS + i] += m[DX_AT + SENSED + i]
        m[PUSH + i] = m[DX_AT + SENSED + 3 + i]
    if DEFORMED:
        for i in range(9):
            m[GYRO_MATRIX + i] += m[DX_AT + SENSED + 6 + i]
            m[ACCEL_MATRIX + i] += m[DX_AT + SENSED + 15 + i]
        _deform(m, g * m[BEFORE + 6], g * m[BEFORE + 7], g * m[BEFORE + 8], 1.0)
    a, b, c = m[PUSH], m[PUSH + 1], m[PUSH + 2]
    e = g * m[DX_AT + 7] - (m[BEFORE] * a + m[BEFORE + 1] * b + m[BEFORE + 2] * c)
    n = -g * m[DX_AT + 6] - (m[BEFORE + 3] * a + m[BEFORE + 4] * b + m[BEFORE + 5] * c)
    u = g - (m[BEFORE + 6] * a + m[BEFORE + 7] * b + m[BEFORE + 8] * c)
    x, y, z = (
        m[ATTITUDE] * e + m[ATTITUDE + 3] * n + m[ATTITUDE + 6] * u,
        m[ATTITUDE + 1] * e + m[ATTITUDE + 4] * n + m[ATTITUDE + 7] * u,
        m[ATTITUDE + 2] * e + m[ATTITUDE + 5] * n + m[ATTITUDE + 8] * u,
    )
    m[PUSH], m[PUSH + 1], m[PUSH + 2] = g * m[BEFORE + 6] - x, g * m[BEFORE + 7] - y, g * m[BEFORE + 8] - z
    if DEFORMED:
        _deform(m, x, y, z, -1.0)
    for i in range(3):
        m[ACCEL_BIAS + i] += m[PUSH + i]
    if WHEELED:
        m[WHEEL] += m[DX_AT + STATES + 6]


def _deform(m: FloatArray, a: float, b: float, c: float, sign: float) -> None:
    """Add the estimated deformation of the accelerometer, times (a, b, c), to PUSH."""
    at = DX_AT + SENSED + 15
    for i in range(3):
        m[PUSH + i] += sign * (m[at + i] * a + m[at + 3 + i] * b + m[at + 6 + i] * c)


def _carry(w: FloatArray, m: FloatArray, piece: int) -> None:
    """Apply G of `jerkbench.inertial.update.reset` to a vector of columns."""
    g, at = GRAVITY_MPS2, P + piece
    x, y, z = 0.5 * m[DX_AT + 6], 0.5 * m[DX_AT + 7], 0.5 * m[DX_AT + 8]
    a, b, c = w[at + 6 * ROW], w[at + 7 * ROW], w[at + 8 * ROW]
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    w[at + 6 * ROW], w[at + 7 * ROW], w[at + 8 * ROW] = a + p, b + q, c + r
    a, b, c = w[at + 12 * ROW], w[at + 13 * ROW], w[at + 14 * ROW]
    if DEFORMED:
        for j in range(3):
            up = g * m[BEFORE + 6 + j]
            a += up * w[at + (24 + 3 * j) * ROW]
            b += up * w[at + (25 + 3 * j) * ROW]
            c += up * w[at + (26 + 3 * j) * ROW]
    for i in range(3):
        turned = m[BACK + 3 * i] * a + m[BACK + 3 * i + 1] * b + m[BACK + 3 * i + 2] * c
        turned += (g * m[ATTITUDE + i]) * q - (g * m[ATTITUDE + 3 + i]) * p
        if DEFORMED:
            for j in range(3):
                turned -= (g * m[ATTITUDE + 6 + j]) * w[at + (24 + 3 * j + i) * ROW]
        w[at + (12 + i) * ROW] = turned


def _carry_on_group(w: FloatArray, m: FloatArray, piece: int) -> None:
    """Apply G of `jerkbench.inertial.invariant.reset_on_group` to a vector of columns."""
    at = P + piece
    a, b, c = w[at + 6 * ROW], w[at + 7 * ROW], w[at + 8 * ROW]
    for part in range(0, 6, 3):
        x, y, z = m[SHIFT + part], m[SHIFT + part + 1], m[SHIFT + part + 2]
        w[at + part * ROW] -= y * c - z * b
        w[at + (part + 1) * ROW] -= z * a - x * c
        w[at + (part + 2) * ROW] -= x * b - y * a


def is_healthy(w: FloatArray, m: FloatArray) -> bool:
    """Whether the state is finite and the covariance positive definite."""
    total = 0.0
    for i in range(21):  # position, velocity, attitude, biases
        total += m[POSITION + i] * 0.0
    return total == 0.0 and is_definite(w, m)


def is_definite(w: FloatArray, m: FloatArray) -> bool:
    """Whether the covariance is positive definite, by elimination."""
    for e in range(ROW * STATES):
        w[SPARE + e] = w[P + e]
    for c in range(STATES):
        place = c if c < 9 else c + 7
        pivot = m[SPARE_AT + STRIDE * c + place]
        if not 0.0 < pivot < np.inf:
            return False
        scale = 1.0 / pivot
        for r in range(c + 1, STATES):
            factor = m[SPARE_AT + STRIDE * r + place] * scale
            for piece in range(place // 8, ROW):
                w[SPARE + ROW * r + piece] -= factor * w[SPARE + ROW * c + piece]
    return True


def keep_covariance(m: FloatArray, into: FloatArray, place: int) -> None:
    """Copy the covariance of position and velocity."""
    for r in range(6):
        for c in range(6):
            into[place, 6 * r + c] = m[P_AT + STRIDE * r + c]
