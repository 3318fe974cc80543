"""Coordinates of the rows in which both covariances of an innovation are diagonal: a pass over them needs no matrix.

Everything here compiles with numba. With R = L L' (Cholesky) and L^-1 H P- H' L^-T = V diag(d) V' the innovation is
a = V' L^-1 y there, R is the identity and H P- H' is diag(d). With P~ = P- / xi, R~ = R / lambda, r = xi / lambda and
w_i = a_i / (d_i + r), so that L^-T V w is S^-1 y / xi, it holds for n states and m rows after the update that

    tr(D_x (P-)^-1) = (n - sum d_i / (d_i + r) + xi sum d_i w_i^2) / xi
    tr(D_z R^-1)    = (sum d_i / (d_i + r) + xi r sum w_i^2) / lambda

with D_x and D_z as in `jerkbench.adaptation._measured`. V comes from rotations (Jacobi) that stop where an element is
less than rounding leaves of the two on the diagonal: so small a d is as exact as a large one, and after a gap they are
twelve orders apart. For the same reason the rows are ordered by H P- H' / R before: L mixes those before into a row.
"""

import math

import numpy as np

from jerkbench.adaptation._small import part_of, root_of, whiten_rows, whitened
from jerkbench.arrays import FloatArray, IntArray

SWEEPS = 30
"""At most so many times over all pairs; seven are enough for six rows."""

DIAGONAL = 1e-15
"""A pair is left where the square of its element is less than this, squared, of the product of its diagonal ones."""


def diagonalise(HPHt: FloatArray, R: FloatArray, d: FloatArray, X: FloatArray) -> FloatArray:
    """Fill d (m,); return V' L^-1 X of X (m, any number of columns).

    Raises:
        LinAlgError: R is not positive definite.
    """
    m, columns = X.shape
    order = _ordered(HPHt, R)
    U, turned = root_of(part_of(R, order), m), np.empty((m, columns))
    for i in range(m):
        for c in range(columns):
            turned[i, c] = X[order[i], c]
    whiten_rows(U, turned, turned)
    A = whitened(U, part_of(HPHt, order))
    for _ in range(SWEEPS):
        if not _sweep(A, turned):
            break
    for i in range(m):
        d[i] = max(A[i, i], 0.0)
    return turned


def _ordered(HPHt: FloatArray, R: FloatArray) -> IntArray:
    """Return the rows, those with the smallest H P- H' / R first."""
    order = np.arange(len(R))
    for i in range(1, len(R)):
        row, k = order[i], i
        while k > 0 and HPHt[row, row] * R[order[k - 1], order[k - 1]] < HPHt[order[k - 1], order[k - 1]] * R[row, row]:
            order[k] = order[k - 1]
            k -= 1
        order[k] = row
    return order


def _sweep(A: FloatArray, X: FloatArray) -> bool:
    """Rotate all pairs once; return whether there was one to rotate."""
    rotated = False
    for p in range(len(A)):
        for q in range(p + 1, len(A)):
            if A[p, q] * A[p, q] > DIAGONAL * DIAGONAL * abs(A[p, p] * A[q, q]):
                _rotate(A, X, p, q)
                rotated = True
    return rotated


def _rotate(A: FloatArray, X: FloatArray, p: int, q: int) -> None:
    """Turn rows ``p`` and ``q`` so that their element becomes zero."""
    between = A[p, q]
    apart = A[q, q] - A[p, p]
    tangent = 2.0 * between / (abs(apart) + math.sqrt(apart * apart + 4.0 * between * between))
    if apart < 0.0:
        tangent = -tangent
    cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    first, second = A[p, p] - tangent * between, A[q, q] + tangent * between
    for k in range(len(A)):
        a, b = A[p, k], A[q, k]
        A[p, k], A[q, k] = cosine * a - sine * b, sine * a + cosine * b
        A[k, p], A[k, q] = A[p, k], A[q, k]
    A[p, p], A[q, q], A[p, q], A[q, p] = first, second, 0.0, 0.0
    for k in range(X.shape[1]):
        a, b = X[p, k], X[q, k]
        X[p, k], X[q, k] = cosine * a - sine * b, sine * a + cosine * b


def shares(d: FloatArray, a: FloatArray, r: float, w: FloatArray) -> tuple[float, float, float]:
    """Fill w; return the sums of d / (d + r), of d w^2 and of w^2."""
    explained = prior = measured = 0.0
    for i in range(len(d)):
        part = 1.0 / (d[i] + r)
        w[i] = a[i] * part
        square = w[i] * w[i]
        explained += d[i] * part
        prior += d[i] * square
        measured += square
    return explained, prior, measured
