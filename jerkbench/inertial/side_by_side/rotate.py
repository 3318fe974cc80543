"""Rotations, one of each run."""

import math

from jerkbench.arrays import FloatArray
from jerkbench.inertial.side_by_side.layout import COSINE, SINE, SQUARE_OF_ANGLE, TURN
from jerkbench.kinematic.layout import WIDTH

SMALL = 0.01
"""Square of an angle below which a series to the tenth power gives sine and cosine to the last digit."""


def fill_turn(m: FloatArray, numbers: FloatArray, x: float, y: float, z: float) -> None:
    """TURN = Exp of a rotation vector, as in `jerkbench.inertial.rotation.rotation_exp`.

    Args:
        m: the nominal states.
        numbers: the same, number by number.
        x: the vector, with the next two.
        y: likewise.
        z: likewise.
    """
    square = x * x + y * y + z * z
    m[SQUARE_OF_ANGLE] = square
    m[SINE] = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    m[COSINE] = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    for run in range(WIDTH):
        if numbers[WIDTH * SQUARE_OF_ANGLE + run] >= SMALL:
            _fill_large(numbers, run)
    s, c = m[SINE], m[COSINE]
    m[TURN], m[TURN + 4], m[TURN + 8] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    m[TURN + 1], m[TURN + 3] = c * x * y - s * z, c * x * y + s * z
    m[TURN + 2], m[TURN + 6] = c * x * z + s * y, c * x * z - s * y
    m[TURN + 5], m[TURN + 7] = c * y * z - s * x, c * y * z + s * x


def _fill_large(numbers: FloatArray, run: int) -> None:
    a = math.sqrt(numbers[WIDTH * SQUARE_OF_ANGLE + run])
    half = math.sin(0.5 * a) / (0.5 * a)
    numbers[WIDTH * SINE + run] = math.sin(a) / a
    numbers[WIDTH * COSINE + run] = 0.5 * half * half
