"""Small symmetric matrices by closed loops, and an innovation in the coordinates in which it is simplest.

In this order: factors, roots and solutions; whitening and products; `diagonalise`, coordinates in which both
covariances of an innovation are diagonal, so that a pass over them needs no matrix; `Residuals`, rows in which R is the
identity, updated with weights again and again.

Everything here compiles with numba, where a call of LAPACK or a new array takes longer than the arithmetic of six rows.
What a function of the first two parts finds it puts into its last argument. Of a symmetric matrix the lower triangle is
read. A root U is the upper one of Cholesky, A = U' U, because its rows lie side by side; the factors of A = L D L' are
L below the diagonal (ones on it are not kept), and 1/D on it, because a division waits for the one before it as long as
for ten products.
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import above, anywhere, chosen
from jerkbench.kalman import INDEFINITE, ROUNDING

AXES = 1
"""Blocks of an update that have nothing to do with each other; row i is of block i % AXES, and so is state i.

It is 3 in a compilation for six rows of which R and P- have nothing between two axes: then each axis is gone over by
itself. So a weighting of rows may keep its matrices by blocks; a rule that puts anything between two axes must not.
"""


def factorise(A: FloatArray, M: FloatArray) -> None:
    """Fill M, another array, with the factors of A = L D L'; what stands above its diagonal means nothing.

    A pivot below `ROUNDING` of its diagonal element is taken for that much: after a gap of 100 s a covariance can be
    singular to rounding, and an engine goes on with it as long as it is no more than `INDEFINITE` (`jerkbench.kalman`).

    Raises:
        LinAlgError: A is not positive definite.
    """
    for r in range(len(A)):
        pivot = A[r, r]
        for c in range(r):  # D L' stands above the diagonal
            entry = A[r, c]
            for k in range(c):
                entry -= M[c, k] * M[k, r]
            M[c, r], M[r, c] = entry, entry * M[c, c]
            pivot -= M[r, c] * entry
        M[r, r] = 1.0 / _checked(pivot, A[r, r])


def root_of(A: FloatArray, p: int) -> FloatArray:
    """Return the first p rows of U (p, n), zero below its diagonal.

    Raises:
        LinAlgError: the first p rows and columns are not positive definite.
    """
    U = np.zeros((p, len(A)), A.dtype)
    fill_root(A, U)
    return U


def fill_root(A: FloatArray, U: FloatArray) -> None:
    """Fill the same into U (p, n), which is zero below its diagonal."""
    p, n = U.shape
    for c in range(p):
        for r in range(c, n):
            U[c, r] = A[r, c]
    for c in range(p):
        U[c, c] = _checked(U[c, c], A[c, c])
        inverse = 1.0 / U[c, c]
        for r in range(c + 1, p):
            factor = U[c, r] * inverse
            for j in range(r, n):
                U[r, j] -= factor * U[c, j]
        scale = math.sqrt(inverse)
        for r in range(c, n):
            U[c, r] *= scale


def block_roots(A: FloatArray, p: int) -> FloatArray:
    """Return the roots of the blocks of A, of each the first p / AXES rows."""
    roots = np.zeros((AXES, p // AXES, len(A) // AXES), A.dtype)
    for a in range(AXES):
        fill_root(A[a::AXES, a::AXES], roots[a])
    return roots


def _checked(pivot: float, variance: float) -> float:
    """Return a pivot, not below what rounding may leave of its diagonal element."""
    return max(above(pivot, -INDEFINITE * variance), ROUNDING * variance)


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
        for k in range(n - 1, r, -1):  # the last one found is the last one waited for
            rest -= M[k, r] * x[k]
        x[r] = rest


def forward_rows(M: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = L^-1 B of any number of columns from the factors; both may be the same array."""
    for r in range(len(X)):
        for c in range(X.shape[1]):
            rest = B[r, c]
            for k in range(r):
                rest -= M[r, k] * X[k, c]
            X[r, c] = rest


def solve_rows(M: FloatArray, B: FloatArray, X: FloatArray) -> None:
    """Fill X = (L D L')^-1 B likewise."""
    forward_rows(M, B, X)
    for r in range(len(X) - 1, -1, -1):
        for c in range(X.shape[1]):
            rest = X[r, c] * M[r, r]
            for k in range(r + 1, len(X)):
                rest -= M[k, r] * X[k, c]
            X[r, c] = rest


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
        scale = 1.0 / U[r, r]
        for c in range(X.shape[1]):
            rest = B[r, c]
            for k in range(r):
                rest -= U[k, r] * X[k, c]
            X[r, c] = rest * scale


def whiten_both(U: FloatArray, A: FloatArray, X: FloatArray) -> None:
    """Fill X = U^-T A U^-1, symmetric to the bit; A is symmetric."""
    m = len(A)
    whiten_rows(U, A, X)
    for r in range(m):  # the other side: rows of X' , of which those above the diagonal are known already
        scale = 1.0 / U[r, r]
        for i in range(r, m):
            rest = X[i, r]
            for k in range(r):
                rest -= U[k, r] * X[i, k]
            X[i, r] = rest * scale
    for r in range(m):
        for c in range(r):
            X[c, r] = X[r, c]


def weighted(roots: FloatArray, weights: FloatArray) -> FloatArray:
    """Return U' diag(weights) U of the roots of blocks, (m, m), symmetric to the bit; ``weights`` (m,) by row."""
    m = len(weights)
    covariance = np.zeros((m, m), roots.dtype)
    for i in range(m):
        U = roots[i % AXES]
        for j in range(i % AXES, i + 1, AXES):
            total = 0.0
            for c in range(i % AXES, j + 1, AXES):
                total += U[c // AXES, i // AXES] * weights[c] * U[c // AXES, j // AXES]
            covariance[i, j] = covariance[j, i] = total
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


def trace(A: FloatArray) -> float:
    """Return the sum of the diagonal."""
    total = 0.0
    for i in range(len(A)):
        total += A[i, i]
    return total


def scaled(A: FloatArray, factor: float) -> FloatArray:
    """Return factor A."""
    product = np.empty(A.shape, A.dtype)
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            product[i, j] = A[i, j] * factor
    return product


def submatrix(A: FloatArray, rows: IntArray) -> FloatArray:
    """Return H A H', H x being x[rows]."""
    part = np.empty((len(rows), len(rows)), A.dtype)
    for i in range(len(rows)):
        for j in range(len(rows)):
            part[i, j] = A[rows[i], rows[j]]
    return part


def fill_inverse_diagonal(M: FloatArray, X: FloatArray, d: FloatArray) -> None:
    """Fill d (m,) with the diagonal of (L D L')^-1 = L^-1' D^-1 L^-1 from the factors; X (m, m) is room for L^-1."""
    for c in range(len(d)):
        X[c, c] = 1.0
        d[c] = M[c, c]
        for r in range(c + 1, len(d)):
            rest = -M[r, c]
            for k in range(c + 1, r):
                rest -= M[r, k] * X[k, c]
            X[r, c] = rest
            d[c] += rest * rest * M[r, r]


def diagonal(d: FloatArray) -> FloatArray:
    """Return diag(d)."""
    D = np.zeros((len(d), len(d)), d.dtype)
    for i in range(len(d)):
        D[i, i] = d[i]
    return D


SWEEPS = 30
"""At most so many times over all pairs; seven are enough for six rows."""

DIAGONAL = 1e-15
"""A pair is left where the square of its element is less than this, squared, of the product of its diagonal ones."""


def diagonalise(A: FloatArray, R: FloatArray, d: FloatArray, X: FloatArray) -> None:
    """Fill d (m,), and V' L^-1 X into X (m, any number of columns), of A = H P- H'; A and R are spoilt.

    With R = L L' (Cholesky) and L^-1 H P- H' L^-T = V diag(d) V' the innovation is a = V' L^-1 y in these coordinates,
    R is the identity and H P- H' is diag(d). V comes from rotations (Jacobi) that stop where an element is less than
    rounding leaves of the two on the diagonal: so small a d is as exact as a large one, and after a gap they are twelve
    orders apart. For the same reason the rows are ordered by H P- H' / R before: L mixes those before into a row.

    Raises:
        LinAlgError: R is not positive definite.
    """
    _order(A, R, X)
    U = root_of(R, len(d))
    whiten_rows(U, X, X)
    W = np.empty(A.shape, A.dtype)
    whiten_both(U, A, W)
    for _ in range(SWEEPS):
        if not _sweep(W, X):
            break
    for i in range(len(d)):
        d[i] = max(W[i, i], 0.0)


def _blocks_of(A: FloatArray) -> FloatArray:
    """Return the blocks of A (n, n) on its diagonal, (AXES, n / AXES, n / AXES)."""
    n = len(A) // AXES
    blocks = np.empty((AXES, n, n), A.dtype)
    for a in range(AXES):
        for i in range(n):
            for j in range(n):
                blocks[a, i, j] = A[a + AXES * i, a + AXES * j]
    return blocks


def diagonal_blocks(HPHt: FloatArray, R: FloatArray, B: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return d (m,) and V' L^-1 B of B (m, any number of columns) by blocks: those of the first block come first."""
    m, n = len(R), len(R) // AXES
    A, ordered = _blocks_of(HPHt), _blocks_of(R)
    d, X = np.empty(m, R.dtype), np.empty(B.shape, R.dtype)
    for i in range(m):
        for c in range(B.shape[1]):
            X[i, c] = B[i % n * AXES + i // n, c]
    for a in range(AXES):
        diagonalise(A[a], ordered[a], d[a * n : a * n + n], X[a * n : a * n + n])
    return d, X


def _order(A: FloatArray, R: FloatArray, X: FloatArray) -> None:
    """Put those rows first, and columns of A and R, in which A / R is smallest: neighbours are exchanged."""
    for end in range(len(A) - 1, 0, -1):
        for k in range(end):
            wrong = chosen(A[k, k] * R[k + 1, k + 1], A[k + 1, k + 1] * R[k, k], 1.0, 0.0)
            if anywhere(wrong):
                for matrix in (A, R):
                    _exchange(matrix, k, wrong)
                    _exchange(matrix.T, k, wrong)
                _exchange(X, k, wrong)


def _exchange(M: FloatArray, k: int, wrong: float) -> None:
    """Exchange row ``k`` and the next, in the runs where they stand ``wrong``."""
    for c in range(M.shape[1]):
        first, second = M[k, c], M[k + 1, c]
        M[k, c], M[k + 1, c] = chosen(wrong, 0.0, second, first), chosen(wrong, 0.0, first, second)


def _sweep(A: FloatArray, X: FloatArray) -> bool:
    """Rotate all pairs once; return whether there was one to rotate."""
    rotated = False
    for p in range(len(A)):
        for q in range(p + 1, len(A)):
            due = chosen(A[p, q] * A[p, q], DIAGONAL * DIAGONAL * abs(A[p, p] * A[q, q]), 1.0, 0.0)
            if anywhere(due):
                _rotate(A, X, p, q, due)
                rotated = True
    return rotated


def _rotate(A: FloatArray, X: FloatArray, p: int, q: int, due: float) -> None:
    """Turn rows ``p`` and ``q`` so that their element becomes zero, in the runs where that is ``due``."""
    between = A[p, q]
    apart = A[q, q] - A[p, p]
    length = math.sqrt(apart * apart + 4.0 * between * between)
    longer = abs(apart) + length
    inverse = chosen(due, 0.0, 0.5 / (length * longer), 0.0)  # tangent = 2 between/longer, cosine^2 = longer/(2 length)
    tangent = 4.0 * between * length * inverse
    tangent = chosen(0.0, apart, -tangent, tangent)
    cosine = chosen(due, 0.0, longer * math.sqrt(inverse), 1.0)
    sine = tangent * cosine
    first, second = A[p, p] - tangent * between, A[q, q] + tangent * between
    for k in range(len(A)):
        a, b = A[p, k], A[q, k]
        A[p, k], A[q, k] = cosine * a - sine * b, sine * a + cosine * b
        A[k, p], A[k, q] = A[p, k], A[q, k]
    A[p, p], A[q, q] = first, second
    A[p, q] = A[q, p] = chosen(due, 0.0, 0.0, between)
    for k in range(X.shape[1]):
        a, b = X[p, k], X[q, k]
        X[p, k], X[q, k] = cosine * a - sine * b, sine * a + cosine * b


def explained_sums(d: FloatArray, a: FloatArray, r: float, w: FloatArray) -> tuple[float, float, float]:
    """Fill w, w_i = a_i / (d_i + r); return the sums of d / (d + r), of d w^2 and of w^2.

    With P~ = P- / xi, R~ = R / lambda and r = xi / lambda, L^-T V w is S^-1 y / xi. After the update it holds for n
    states and m rows, with D_x and D_z as in `jerkbench.adaptation.common.Measured`, that::

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
"""No weight is taken below it, so that R stays finite; R may grow by its inverse."""


class Residuals(NamedTuple):
    """An update of m weighed rows, in standard deviations of the measurement.

    With R = L L' (Cholesky) the innovation and the prior are L^-1 y and L^-1 HPH' L^-T in standardised rows, in which R
    is the identity. What is left of y after an update with L D L' is D (L^-1 HPH' L^-T + D)^-1 L^-1 y, with
    D = diag(1/weights). D stands beside the prior, not L D L': in that a row without weight leaves no digits to its
    neighbours. The adapted covariance L D L' is `weighted` (U, D).

    Attributes:
        U: (AXES, m / AXES, m / AXES) L', like all matrices by blocks.
        prior: L^-1 HPH' L^-T.
        y: (AXES, m / AXES) L^-1 y.
        D: (m,) its diagonal, not above 1 / `MIN_RESIDUAL_WEIGHT`, by row.
        e: (m,) the residual after the update with them, by row.
        S: prior + D.
        M: factors of S.
        v: (m / AXES,) S^-1 L^-1 y of a block.
    """

    U: FloatArray
    prior: FloatArray
    y: FloatArray
    D: FloatArray
    e: FloatArray
    S: FloatArray
    M: FloatArray
    v: FloatArray


def residuals_of(innovation: FloatArray, HPHt: FloatArray, R: FloatArray) -> Residuals:
    """Return the update before the first pass, with weights of 1."""
    m, n, U = len(innovation), len(innovation) // AXES, block_roots(R, len(innovation))
    y, vectors, matrices = np.empty((AXES, n), R.dtype), np.empty((2, m), R.dtype), np.empty((2, AXES, n, n), R.dtype)
    for a in range(AXES):
        whiten_both(U[a], HPHt[a::AXES, a::AXES], matrices[0, a])
        for i in range(n):
            y[a, i], vectors[0, a + AXES * i] = innovation[a + AXES * i], 1.0
        whiten(U[a], y[a], y[a])
    prior = matrices[0]
    return Residuals(U, prior, y, vectors[0], vectors[1], prior.copy(), matrices[1], np.empty(n, R.dtype))


def update_residuals(of: Residuals) -> None:
    """Fill e with the weights as they are."""
    n = len(of.v)
    for a in range(AXES):
        for i in range(n):
            of.S[a, i, i] = of.prior[a, i, i] + of.D[a + AXES * i]
        factorise(of.S[a], of.M[a])
        solve(of.M[a], of.y[a], of.v)
        for i in range(n):
            of.e[a + AXES * i] = of.v[i] * of.D[a + AXES * i]
