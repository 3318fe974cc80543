"""Small symmetric matrices by closed loops.

Everything here compiles with numba, where a call of LAPACK or a new array takes longer than the arithmetic of six rows.
What a function finds it puts into its last argument. Of a symmetric matrix the lower triangle is read; a factor L is
the lower one of Cholesky, and what stands above its diagonal means nothing.
"""

import math

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.kalman import ROUNDING


def factorise(A: FloatArray, L: FloatArray) -> None:
    """Fill L: A = L L'; both may be the same array.

    A pivot within `ROUNDING` of its diagonal element is taken for that much: after a gap of 100 s a covariance can be
    singular to rounding, and an engine goes on with it (`jerkbench.kalman`).

    Raises:
        LinAlgError: A is not positive definite.
    """
    for c in range(len(A)):
        least = ROUNDING * A[c, c]
        pivot = A[c, c] - squares(L[c, :c])
        if not pivot > -least:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        pivot = max(pivot, least)
        L[c, c] = math.sqrt(pivot)
        scale = 1.0 / L[c, c]
        for r in range(c + 1, len(A)):
            rest = A[r, c]
            for k in range(c):
                rest -= L[r, k] * L[c, k]
            L[r, c] = rest * scale


def root_of(A: FloatArray) -> FloatArray:
    """Return L, zero above its diagonal."""
    L = np.zeros(A.shape)
    factorise(A, L)
    return L


def solve_lower(L: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Fill x = L^-1 b; both may be the same array."""
    for r in range(len(x)):
        rest = b[r]
        for k in range(r):
            rest -= L[r, k] * x[k]
        x[r] = rest / L[r, r]


def solve(L: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Fill x = (L L')^-1 b; both may be the same array."""
    solve_lower(L, b, x)
    for r in range(len(x) - 1, -1, -1):
        rest = x[r]
        for k in range(r + 1, len(x)):
            rest -= L[k, r] * x[k]
        x[r] = rest / L[r, r]


def whiten_rows(L: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = L^-1 B of any number of columns."""
    for r in range(len(X)):
        X[r] = B[r]
        for k in range(r):
            for c in range(X.shape[1]):
                X[r, c] -= L[r, k] * X[k, c]
        for c in range(X.shape[1]):
            X[r, c] /= L[r, r]


def solve_rows(L: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = (L L')^-1 B of any number of columns."""
    whiten_rows(L, B, X)
    for r in range(len(X) - 1, -1, -1):
        for k in range(r + 1, len(X)):
            for c in range(X.shape[1]):
                X[r, c] -= L[k, r] * X[k, c]
        for c in range(X.shape[1]):
            X[r, c] /= L[r, r]


def squares(vector: FloatArray) -> float:
    """Return the sum of the squares."""
    total = 0.0
    for number in vector:
        total += number * number
    return total


def dot(a: FloatArray, b: FloatArray) -> float:
    """Return a' b."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


def quadratic(A: FloatArray, b: FloatArray) -> float:
    """Return b' A b."""
    total = 0.0
    for i in range(len(b)):
        total += b[i] * dot(A[i], b)
    return total


def part_of(A: FloatArray, rows: IntArray) -> FloatArray:
    """Return H A H', H x being x[rows]."""
    part = np.empty((len(rows), len(rows)))
    for i in range(len(rows)):
        for j in range(len(rows)):
            part[i, j] = A[rows[i], rows[j]]
    return part
