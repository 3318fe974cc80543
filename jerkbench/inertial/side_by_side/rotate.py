"""Rotations, one of each run."""

import math

from jerkbench.compilation.views import Run, View, lane

SMALL = 0.01
"""Square of an angle below which a series to the tenth power gives sine and cosine to the last digit."""


def fill_turn(run: Run, x: float, y: float, z: float) -> None:
    """Make ``turn`` = Exp of the rotation vector (x, y, z), as in `jerkbench.inertial.rotation.rotation_exp`."""
    square = x * x + y * y + z * z
    run.square_of_angle = square
    run.sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    run.cosine = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    for k in range(run.width):
        if lane(run, k).square_of_angle >= SMALL:
            _fill_large(lane(run, k))
    s, c, turn = run.sine, run.cosine, run.turn
    turn[0, 0], turn[1, 1], turn[2, 2] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    turn[0, 1], turn[1, 0] = c * x * y - s * z, c * x * y + s * z
    turn[0, 2], turn[2, 0] = c * x * z + s * y, c * x * z - s * y
    turn[1, 2], turn[2, 1] = c * y * z - s * x, c * y * z + s * x


def _fill_large(alone: Run) -> None:
    a = math.sqrt(alone.square_of_angle)
    half = math.sin(0.5 * a) / (0.5 * a)
    alone.sine = math.sin(a) / a
    alone.cosine = 0.5 * half * half


def multiply(left: View, right: View, into: View) -> None:
    """Put the product of two matrices into a third."""
    for i in range(3):
        for j in range(3):
            into[i, j] = left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]


def multiply_transposed(left: View, right: View, into: View) -> None:
    """Put the product of the transposed left and the right matrix into a third."""
    for i in range(3):
        for j in range(3):
            into[i, j] = left[0, i] * right[0, j] + left[1, i] * right[1, j] + left[2, i] * right[2, j]
