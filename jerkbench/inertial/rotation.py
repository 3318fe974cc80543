"""Rotation vectors and skew matrices, single ones or many at once, without the overhead of general libraries."""

import math

import numpy as np

from jerkbench.arrays import FloatArray

TINY_RAD = 1e-12
"""Below it sin(a)/a is 1 to the last digit, and a division by zero is near."""

_I3 = np.eye(3)


def skew(a: FloatArray) -> FloatArray:
    """Return [a] (..., 3, 3) of vectors (..., 3), with [a] b = a x b."""
    S = np.zeros((*a.shape, 3))
    S[..., 2, 1], S[..., 0, 2], S[..., 1, 0] = a[..., 0], a[..., 1], a[..., 2]
    S[..., 1, 2], S[..., 2, 0], S[..., 0, 1] = -a[..., 0], -a[..., 1], -a[..., 2]
    return S


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b of two vectors (3,)."""
    a1, a2, a3 = a.tolist()
    b1, b2, b3 = b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def rotation_exp(phi: FloatArray) -> FloatArray:
    """Return Exp(phi) (..., 3, 3), the rotations by the vectors phi (..., 3) [rad].

    With a = |phi|: I + sin(a)/a [phi] + (1 - cos a)/a^2 [phi]^2; the second factor is (sin(a/2)/(a/2))^2/2, which loses
    no digits where a is small.
    """
    a = np.maximum(np.sqrt((phi * phi).sum(axis=-1)), TINY_RAD)[..., None, None]
    half = 0.5 * a
    S = skew(phi)
    return np.asarray(_I3 + (np.sin(a) / a) * S + (0.5 * (np.sin(half) / half) ** 2) * (S @ S))


def left_jacobian(phi: FloatArray) -> FloatArray:
    """Return J (3, 3) of a rotation vector phi (3,) [rad]: the mean of Exp(s phi) over s from 0 to 1.

    With a = |phi|: I + (1 - cos a)/a^2 [phi] + (a - sin a)/a^3 [phi]^2. The digits that the last difference loses
    where a is small, its factor [phi]^2 takes away.
    """
    a = max(math.sqrt(float(phi @ phi)), TINY_RAD)
    half = 0.5 * a
    S = skew(phi)
    return np.asarray(_I3 + (0.5 * (math.sin(half) / half) ** 2) * S + ((a - math.sin(a)) / a**3) * (S @ S))


def orthonormal(C: FloatArray) -> FloatArray:
    """Return the rotation next to a matrix that is almost one: a Newton step, 1.5 C - .5 C C' C."""
    return np.asarray(1.5 * C - 0.5 * C @ (C.T @ C))
