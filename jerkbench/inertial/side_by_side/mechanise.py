"""Strapdown mechanisation of a step; `jerkbench.inertial.mechanisation` has the equations."""

from jerkbench.arrays import FloatArray
from jerkbench.inertial.compiled.mechanise import multiply
from jerkbench.inertial.side_by_side.layout import (
    ACCEL_BIAS,
    ATTITUDE,
    FORCE,
    GYRO_BIAS,
    LEVER,
    NEXT,
    RATE,
    TURN,
    TWIST,
)
from jerkbench.inertial.side_by_side.rotate import fill_turn
from jerkbench.kinematic.layout import X
from jerkbench.recording import GRAVITY_MPS2


def mechanise(
    w: FloatArray, m: FloatArray, numbers: FloatArray, accel: FloatArray, gyro: FloatArray, sample: int, dt: float
) -> None:
    """Carry the nominal states over a step of ``dt``, with row ``sample`` of the IMU.

    Args:
        w: the runs, with position and velocity.
        m: the rest of the nominal states.
        numbers: the same, number by number.
        accel: (samples, 3) vectors.
        gyro: likewise.
        sample: the row.
        dt: length of the step.
    """
    for i in range(3):
        m[FORCE + i] = accel[3 * sample + i] - m[ACCEL_BIAS + i]
        m[RATE + i] = gyro[3 * sample + i] - m[GYRO_BIAS + i]
    fill_turn(m, numbers, dt * m[RATE], dt * m[RATE + 1], dt * m[RATE + 2])
    multiply(m, ATTITUDE, TURN, NEXT)
    for i in range(9):
        m[LEVER + i] = 0.5 * (m[ATTITUDE + i] + m[NEXT + i])
        m[ATTITUDE + i] = m[NEXT + i]
    for i in range(3):
        row = LEVER + 3 * i
        m[TWIST + i] = m[row] * m[FORCE] + m[row + 1] * m[FORCE + 1] + m[row + 2] * m[FORCE + 2]
    for i in range(3):
        before = w[X + 3 + i]
        pull = GRAVITY_MPS2 if i == 2 else 0.0
        w[X + 3 + i] = before + (m[TWIST + i] - pull) * dt
        w[X + i] += (before + w[X + 3 + i]) * (0.5 * dt)
    for i in range(9):
        m[LEVER + i] *= 0.0 - dt
    for i in range(3):
        m[TWIST + i] *= 0.0 - dt
