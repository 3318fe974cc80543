"""Linear algebra for small symmetric matrices, with loops that numba compiles.

The module contains the following groups of functions and classes, in this order::

    factors, roots and solutions of linear systems
    whitening and products
    `diagonalise`, which transforms an innovation into coordinates in which H P- H' and R are diagonal
    `Residuals`, an update that is repeated with different weights, in coordinates in which R is the identity

For six rows, a call of LAPACK or the allocation of an array takes longer than the arithmetic, so most functions write
their result into the last argument. The functions read only the lower triangle of a symmetric matrix. The root U of a
matrix A is upper triangular (Cholesky, A = U' U), because the loops read its rows, which are contiguous in memory. The
factors of A = L D L' are stored in one matrix, with L below the diagonal and 1/D on the diagonal. The diagonal contains
1/D and not D, because a division takes as long as ten products.
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.lanes import above, anywhere, select
from jerkbench.kalman import INDEFINITE, ROUNDING


def factorise(A: FloatArray, M: FloatArray) -> None:
    """Compute the factors M of A = L D L', where M and A must be different arrays.

    The elements of M above the diagonal have no meaning. Each pivot is raised to at least `ROUNDING` times its diagonal
    element, because rounding errors can make a covariance singular after a gap of 100 s without measurements. A pivot
    may be negative down to -`INDEFINITE` times its diagonal element, the tolerance of the engines (`jerkbench.kalman`).

    Raises:
        LinAlgError: the matrix A is not positive definite.
    """
    for r in range(len(A)):
        pivot = A[r, r]
        for c in range(r):  # store D L' above the diagonal
            entry = A[r, c]
            for k in range(c):
                entry -= M[c, k] * M[k, r]
            M[c, r], M[r, c] = entry, entry * M[c, c]
            pivot -= M[r, c] * entry
        M[r, r] = 1.0 / _limited_pivot(pivot, A[r, r])


def root_of(A: FloatArray, p: int) -> FloatArray:
    """Return the first p rows (p, n) of the upper triangular root U of A = U' U.

    Raises:
        LinAlgError: the block of the first p rows and columns of A is not positive definite.
    """
    n = len(A)
    U = np.zeros((p, n), A.dtype)
    for c in range(p):
        for r in range(c, n):
            U[c, r] = A[r, c]
    for c in range(p):
        U[c, c] = _limited_pivot(U[c, c], A[c, c])
        inverse = 1.0 / U[c, c]
        for r in range(c + 1, p):
            factor = U[c, r] * inverse
            for j in range(r, n):
                U[r, j] -= factor * U[c, j]
        scale = math.sqrt(inverse)
        for r in range(c, n):
            U[c, r] *= scale
    return U


def _limited_pivot(pivot: float, variance: float) -> float:
    return max(above(pivot, -INDEFINITE * variance), ROUNDING * variance)


def solve(M: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Compute x = (L D L')^-1 b from the factors M, where b and x may be the same array."""
    n = len(x)
    for r in range(n):
        rest = b[r]
        for k in range(r):
            rest -= M[r, k] * x[k]
        x[r] = rest
    for r in range(n - 1, -1, -1):
        rest = x[r] * M[r, r]
        for k in range(n - 1, r, -1):  # in this order, only the last product waits for the previous result
            rest -= M[k, r] * x[k]
        x[r] = rest


def forward_rows(M: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Compute X = L^-1 B from the factors M, where B and X may be the same array."""
    for r in range(len(X)):
        for c in range(X.shape[1]):
            rest = B[r, c]
            for k in range(r):
                rest -= M[r, k] * X[k, c]
            X[r, c] = rest


def solve_rows(M: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Compute X = (L D L')^-1 B from the factors M, where B and X may be the same array."""
    forward_rows(M, B, X)
    for r in range(len(X) - 1, -1, -1):
        for c in range(X.shape[1]):
            rest = X[r, c] * M[r, r]
            for k in range(r + 1, len(X)):
                rest -= M[k, r] * X[k, c]
            X[r, c] = rest


def whiten(U: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Compute x = U^-T b for the upper triangular root U, where b and x may be the same array."""
    for r in range(len(x)):
        rest = b[r]
        for k in range(r):
            rest -= U[k, r] * x[k]
        x[r] = rest / U[r, r]


def whiten_rows(U: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Compute X = U^-T B for the upper triangular root U, where B and X may be the same array."""
    for r in range(len(X)):
        scale = 1.0 / U[r, r]
        for c in range(X.shape[1]):
            rest = B[r, c]
            for k in range(r):
                rest -= U[k, r] * X[k, c]
            X[r, c] = rest * scale


def whiten_both(U: FloatArray, A: FloatArray, X: FloatArray) -> None:
    """Compute the exactly symmetric matrix X = U^-T A U^-1 for the upper triangular root U.

    The function reads both triangles of A. The arrays A and X may be the same array.
    """
    m = len(A)
    whiten_rows(U, A, X)
    for r in range(m):  # X U^-1, only for the lower triangle
        scale = 1.0 / U[r, r]
        for i in range(r, m):
            rest = X[i, r]
            for k in range(r):
                rest -= U[k, r] * X[i, k]
            X[i, r] = rest * scale
    for r in range(m):
        for c in range(r):
            X[c, r] = X[r, c]


def weighted(U: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the exactly symmetric matrix U' diag(weights) U."""
    product = np.empty(U.shape, U.dtype)
    for i in range(len(U)):
        for j in range(i + 1):
            total = 0.0
            for c in range(j + 1):
                total += U[c, i] * weights[c] * U[c, j]
            product[i, j] = product[j, i] = total
    return product


def dot(a: FloatArray, b: FloatArray) -> float:
    """Return the scalar product a' b of two vectors."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


def quadratic(A: FloatArray, b: FloatArray) -> float:
    """Return the quadratic form b' A b."""
    total = 0.0
    for i in range(len(b)):
        total += b[i] * dot(A[i], b)
    return total


def trace(A: FloatArray) -> float:
    """Return the sum of the diagonal elements of the matrix A."""
    total = 0.0
    for i in range(len(A)):
        total += A[i, i]
    return total


def scaled(A: FloatArray, factor: float) -> FloatArray:
    """Return the matrix A, multiplied by ``factor``."""
    product = np.empty(A.shape, A.dtype)
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            product[i, j] = A[i, j] * factor
    return product


def fill_inverse_diagonal(M: FloatArray, X: FloatArray, d: FloatArray) -> None:
    """Compute the diagonal d of the inverse (L D L')^-1 from the factors M, where X (m, m) is a buffer for L^-1."""
    for c in range(len(d)):
        X[c, c] = 1.0
        d[c] = M[c, c]
        for r in range(c + 1, len(d)):
            rest = -M[r, c]
            for k in range(c + 1, r):
                rest -= M[r, k] * X[k, c]
            X[r, c] = rest
            d[c] += rest * rest * M[r, r]


MAX_SWEEPS = 30
"""Maximum number of sweeps over all pairs of rows; seven are sufficient for six rows."""

NEGLIGIBLE = 1e-15
"""A pair of rows is not rotated if a_pq^2 < NEGLIGIBLE^2 a_pp a_qq."""


def diagonalise(A: FloatArray, R: FloatArray, X: FloatArray) -> FloatArray:
    """Return d (m,), the eigenvalues of the whitened H P- H', and replace X (m, columns) by V' L^-1 X.

    The argument A is H P- H'. The arrays A and R are overwritten. The whitening uses R = L L' (Cholesky), and the
    diagonalisation L^-1 H P- H' L^-T = V diag(d) V' consists of Jacobi rotations. In the new coordinates, the
    innovation is a = V' L^-1 y, R is the identity and H P- H' is diag(d). The rotations stop if each off-diagonal
    element is smaller than the rounding error of its two diagonal elements, so small values of d are as accurate as
    large values. After a gap without measurements, the values of d can differ by twelve orders of magnitude. The rows
    are first sorted by the ratio of H P- H' to R, because the whitening adds multiples of the previous rows to a row,
    which would make small values inaccurate.

    Raises:
        LinAlgError: the matrix R is not positive definite.
    """
    m = len(A)
    _sort_rows(A, R, X)
    U, d = root_of(R, m), np.empty(m, A.dtype)
    whiten_rows(U, X, X)
    whiten_both(U, A, A)
    for _ in range(MAX_SWEEPS):
        if not _sweep(A, X):
            break
    for i in range(m):
        d[i] = max(A[i, i], 0.0)
    return d


def _sort_rows(A: FloatArray, R: FloatArray, X: FloatArray) -> None:
    """Sort the rows of A, R and X, and the columns of A and R, by A_ii / R_ii (bubble sort)."""
    for end in range(len(A) - 1, 0, -1):
        for k in range(end):
            wrong = select(A[k, k] * R[k + 1, k + 1], A[k + 1, k + 1] * R[k, k], 1.0, 0.0)
            if anywhere(wrong):
                for matrix in (A, R):
                    _swap_rows(matrix, k, wrong)
                    _swap_rows(matrix.T, k, wrong)
                _swap_rows(X, k, wrong)


def _swap_rows(M: FloatArray, k: int, swapped: float) -> None:
    """Swap the rows k and k + 1 of M in each run in which ``swapped`` is 1."""
    for c in range(M.shape[1]):
        first, second = M[k, c], M[k + 1, c]
        M[k, c], M[k + 1, c] = select(swapped, 0.0, second, first), select(swapped, 0.0, first, second)


def _sweep(A: FloatArray, X: FloatArray) -> bool:
    """Rotate each pair of rows at most once, and return whether any pair was rotated."""
    rotated = False
    for p in range(len(A)):
        for q in range(p + 1, len(A)):
            due = select(A[p, q] * A[p, q], NEGLIGIBLE * NEGLIGIBLE * abs(A[p, p] * A[q, q]), 1.0, 0.0)
            if anywhere(due):
                _rotate(A, X, p, q, due)
                rotated = True
    return rotated


def _rotate(A: FloatArray, X: FloatArray, p: int, q: int, due: float) -> None:
    """Rotate the rows p and q such that A_pq becomes zero, in each run in which ``due`` is 1."""
    a_pq, difference = A[p, q], A[q, q] - A[p, p]
    root = math.sqrt(difference * difference + 4.0 * a_pq * a_pq)
    total = abs(difference) + root
    inverse = select(due, 0.0, 0.5 / (root * total), 0.0)
    tangent = 4.0 * a_pq * root * inverse
    tangent = select(0.0, difference, -tangent, tangent)
    cosine = select(due, 0.0, total * math.sqrt(inverse), 1.0)
    sine = tangent * cosine
    a_pp, a_qq = A[p, p] - tangent * a_pq, A[q, q] + tangent * a_pq
    for k in range(len(A)):
        a, b = A[p, k], A[q, k]
        A[p, k], A[q, k] = cosine * a - sine * b, sine * a + cosine * b
        A[k, p], A[k, q] = A[p, k], A[q, k]
    A[p, p], A[q, q] = a_pp, a_qq
    A[p, q] = A[q, p] = select(due, 0.0, 0.0, a_pq)
    for k in range(X.shape[1]):
        a, b = X[p, k], X[q, k]
        X[p, k], X[q, k] = cosine * a - sine * b, sine * a + cosine * b


def explained_sums(d: FloatArray, a: FloatArray, r: float, w: FloatArray) -> tuple[float, float, float]:
    """Compute w_i = a_i / (d_i + r), and return the sums over i of d_i / (d_i + r), d_i w_i^2 and w_i^2.

    With P~ = P- / xi, R~ = R / lambda and r = xi / lambda, the vector L^-T V w is equal to S^-1 y / xi. The sums are
    needed for the traces after an update of n states, with D_x and D_z of
    `jerkbench.adaptation.common.MeasuredUpdate`::

        tr(D_x (P-)^-1) = (n - sum d_i / (d_i + r) + xi sum d_i w_i^2) / xi
        tr(D_z R^-1)    = (sum d_i / (d_i + r) + xi r sum w_i^2) / lambda
    """
    explained = prior = measured = 0.0
    for i in range(len(d)):
        part = 1.0 / (d[i] + r)
        w[i] = a[i] * part
        square = w[i] * w[i]
        explained += d[i] * part
        prior += d[i] * square
        measured += square
    return explained, prior, measured


MIN_RESIDUAL_WEIGHT = 1e-9
"""Smallest weight of a row. The largest factor on R is the inverse of this weight, so R remains finite."""


class Residuals(NamedTuple):
    """The residuals of an update with m weighted rows, in coordinates in which R is the identity.

    With R = L L' (Cholesky), the innovation in these coordinates is L^-1 y, and the prior covariance is L^-1 H P- H'
    L^-T. The adapted covariance is L D L' with D = diag(1/weights), which the function ``weighted(U, D)`` computes. The
    residual after an update with the adapted covariance is D (L^-1 H P- H' L^-T + D)^-1 L^-1 y. The formula adds D, and
    not L D L', to the prior covariance, because a row with a very small weight would make all rows of L D L'
    inaccurate.

    Attributes:
        U: (m, m) transposed Cholesky factor L' of R.
        prior: (m, m) whitened prior covariance L^-1 H P- H' L^-T.
        y: (m,) whitened innovation L^-1 y.
        D: (m,) diagonal of D, whose elements are at most 1 / `MIN_RESIDUAL_WEIGHT`.
        e: (m,) residual after the update with D.
        S: (m, m) innovation covariance, the sum of ``prior`` and diag(D).
        M: (m, m) factors L and D of S = L D L'.
    """

    U: FloatArray
    prior: FloatArray
    y: FloatArray
    D: FloatArray
    e: FloatArray
    S: FloatArray
    M: FloatArray


def residuals_of(innovation: FloatArray, HPHt: FloatArray, R: FloatArray) -> Residuals:
    """Return the arrays of the update before the first pass, with all weights equal to 1."""
    m = len(R)
    U, vectors, matrices = root_of(R, m), np.empty((3, m), R.dtype), np.empty((2, m, m), R.dtype)
    y, D, prior = vectors[0], vectors[1], matrices[0]
    whiten(U, innovation, y)
    whiten_both(U, HPHt, prior)
    for i in range(m):
        D[i] = 1.0
    return Residuals(U, prior, y, D, vectors[2], prior.copy(), matrices[1])


def update_residuals(update: Residuals) -> None:
    """Compute the residual e after an update with the current weights in D."""
    for i in range(len(update.D)):
        update.S[i, i] = update.prior[i, i] + update.D[i]
    factorise(update.S, update.M)
    solve(update.M, update.y, update.e)
    for i in range(len(update.D)):
        update.e[i] *= update.D[i]
