"""Rotation vectors and skew matrices of single vectors, without the overhead of general libraries."""

import math

import numpy as np

from jerkbench.arrays import FloatArray

SMALL_RAD = 1e-4
"""Below it the series of sin(a)/a and (1 - cos(a))/a^2 are exact in double precision."""


def skew(a: FloatArray) -> FloatArray:
    """Return [a] (3, 3) with [a] b = a x b."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b of two vectors (3,)."""
    a1, a2, a3 = a.tolist()
    b1, b2, b3 = b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def rotation_exp(phi: FloatArray) -> FloatArray:
    """Return Exp(phi) (3, 3), the rotation by the vector phi (3,) [rad].

    With a = |phi|: I + sin(a)/a [phi] + (1 - cos a)/a^2 [phi]^2, written out.
    """
    x, y, z = phi.tolist()
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < SMALL_RAD:
        s, c = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    return np.array(
        [
            [1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y],
            [c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x],
            [c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)],
        ]
    )


def orthonormal(C: FloatArray) -> FloatArray:
    """Return the rotation next to a matrix that is almost one: a Newton step, 1.5 C - .5 C C' C."""
    return np.asarray(1.5 * C - 0.5 * C @ (C.T @ C))
