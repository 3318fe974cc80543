"""Small symmetric matrices by closed loops.

Everything here compiles with numba, where a call of LAPACK or a new array takes longer than the arithmetic of six rows.
What a function finds it puts into its last argument. Of a symmetric matrix the lower triangle is read. A root U is the
upper one of Cholesky, A = U' U, because its rows lie side by side; the factors of A = L D L' are L below the diagonal
(ones on it are not kept), and 1/D on it, because a division waits for the one before it as long as for ten products.
"""

import math

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.kalman import INDEFINITE, ROUNDING


def factorise(A: FloatArray, M: FloatArray) -> None:
    """Fill M, another array, with the factors of A = L D L'; what stands above its diagonal means nothing.

    A pivot below `ROUNDING` of its diagonal element is taken for that much: after a gap of 100 s a covariance can be
    singular to rounding, and an engine goes on with it as long as it is no more than `INDEFINITE` (`jerkbench.kalman`).

    Raises:
        LinAlgError: A is not positive definite.
    """
    n = len(A)
    for c in range(n):
        for r in range(c, n):
            M[c, r] = A[r, c]
    for c in range(n):
        inverse = 1.0 / _checked(M[c, c], A[c, c])
        M[c, c] = inverse
        for r in range(c + 1, n):
            factor = M[c, r] * inverse
            for j in range(r, n):
                M[r, j] -= factor * M[c, j]
            M[r, c] = factor


def root_of(A: FloatArray, p: int) -> FloatArray:
    """Return the first p rows of U (p, n), zero below its diagonal.

    Raises:
        LinAlgError: the first p rows and columns are not positive definite.
    """
    n = len(A)
    U = np.zeros((p, n))
    for c in range(p):
        for r in range(c, n):
            U[c, r] = A[r, c]
    for c in range(p):
        inverse = 1.0 / _checked(U[c, c], A[c, c])
        for r in range(c + 1, p):
            factor = U[c, r] * inverse
            for j in range(r, n):
                U[r, j] -= factor * U[c, j]
        U[c, c] = 1.0 / inverse
    for c in range(p):
        scale = 1.0 / math.sqrt(U[c, c])
        for r in range(c, n):
            U[c, r] *= scale
    return U


def _checked(pivot: float, variance: float) -> float:
    """Return a pivot, not below what rounding may leave of its diagonal element."""
    if not pivot > -INDEFINITE * variance:
        raise np.linalg.LinAlgError("Matrix is not positive definite")
    return max(pivot, ROUNDING * variance)


def solve(M: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Fill x = (L D L')^-1 b from the factors; both may be the same array."""
    n = len(x)
    for r in range(n):
        rest = b[r]
        for k in range(r):
            rest -= M[r, k] * x[k]
        x[r] = rest
    for r in range(n - 1, -1, -1):
        rest = x[r] * M[r, r]
        for k in range(r + 1, n):
            rest -= M[k, r] * x[k]
        x[r] = rest


def forward_rows(M: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = L^-1 B of any number of columns from the factors; both may be the same array."""
    for r in range(len(X)):
        for c in range(X.shape[1]):
            X[r, c] = B[r, c]
        for k in range(r):
            factor = M[r, k]
            for c in range(X.shape[1]):
                X[r, c] -= factor * X[k, c]


def solve_rows(M: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = (L D L')^-1 B likewise."""
    forward_rows(M, B, X)
    for r in range(len(X) - 1, -1, -1):
        for c in range(X.shape[1]):
            X[r, c] *= M[r, r]
        for k in range(r + 1, len(X)):
            factor = M[k, r]
            for c in range(X.shape[1]):
                X[r, c] -= factor * X[k, c]


def whiten(U: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Fill x = U^-T b; both may be the same array."""
    for r in range(len(x)):
        rest = b[r]
        for k in range(r):
            rest -= U[k, r] * x[k]
        x[r] = rest / U[r, r]


def whiten_rows(U: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = U^-T B of any number of columns; both may be the same array."""
    for r in range(len(X)):
        for c in range(X.shape[1]):
            X[r, c] = B[r, c]
        for k in range(r):
            factor = U[k, r]
            for c in range(X.shape[1]):
                X[r, c] -= factor * X[k, c]
        scale = 1.0 / U[r, r]
        for c in range(X.shape[1]):
            X[r, c] *= scale


def whitened(U: FloatArray, A: FloatArray) -> FloatArray:
    """Return U^-T A U^-1, symmetric to the bit; A is symmetric."""
    m = len(A)
    X = np.empty((m, m))
    whiten_rows(U, A, X)
    for r in range(m):  # the other side: rows of X' , of which those above the diagonal are known already
        for i in range(r, m):
            rest = X[i, r]
            for k in range(r):
                rest -= U[k, r] * X[i, k]
            X[i, r] = rest / U[r, r]
    for r in range(m):
        for c in range(r):
            X[c, r] = X[r, c]
    return X


def add_weighed(U: FloatArray, weights: FloatArray, S: FloatArray) -> None:
    """Add U' diag(1/weights) U to the lower triangle of S."""
    m = len(S)
    for c in range(len(U)):
        inverse = 1.0 / weights[c]
        for i in range(c, m):
            share = U[c, i] * inverse
            for j in range(c, i + 1):
                S[i, j] += share * U[c, j]


def weighed(U: FloatArray, weights: FloatArray) -> FloatArray:
    """Return U' diag(1/weights) U, symmetric to the bit."""
    m = len(U)
    covariance = np.zeros((m, m))
    add_weighed(U, weights, covariance)
    for i in range(m):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
    return covariance


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
