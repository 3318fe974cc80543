"""The measurement update of several runs, in Joseph form; six rows and the columns of K in local names.

With W = H P and S = H P H' + R: K' = S^-1 W,  x = x + K y,  V = W' - K S (zero but for rounding), and

    P - K W - V K' = (I - K H) P (I - K H)' + K R K'

so that an error of K enters the covariance only squared.
"""

import math

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.engines.compiled.lanes.places import DIAGONAL, ODD, V
from jerkbench.engines.compiled.sizes import KEPT, WHITE, K, M, P, R, S, W, X, Y


def mahalanobis(w: FloatArray) -> float:
    """Return y' (H P H' + R)^-1 y of the rows that are kept; raise ODD where that has no Cholesky factor."""
    _fill_innovation_covariance(w)
    _factorise(w)
    total: float = w[WHITE] * 0.0
    for r in range(6):
        rest = w[Y + r]
        for j in range(r):
            rest -= w[M + 6 * r + j] * w[WHITE + j]
        w[WHITE + r] = rest * w[M + 7 * r]
        total += w[WHITE + r] * w[WHITE + r]
    return total


def correct(w: FloatArray) -> float:
    """Update state and covariance with the rows that are kept; return y' S^-1 y."""
    nis = mahalanobis(w)
    for s in range(S):
        _solve_column(w, s)
        _weigh_column(w, s)
    for s in range(S):
        _update_row(w, s)
    return nis


def check_definite(w: FloatArray) -> None:
    """Raise ODD where the covariance has no Cholesky factor, or the state is no number; spoils K and V."""
    for s in range(S):
        for t in range(s, S):
            w[K + S * s + t] = w[P + S * s + t]
    for c in range(S):
        pivot = w[K + (S + 1) * c]
        w[ODD] += chosen(pivot, 0.0, w[X + c] * 0.0, 1.0)
        scale = 1.0 / pivot
        for r in range(c + 1, S):
            factor = w[K + S * c + r] * scale
            for j in range(r, S):
                w[K + S * r + j] -= factor * w[K + S * c + j]


def _fill_innovation_covariance(w: FloatArray) -> None:
    """M = H P H' + R; a row that is not kept becomes one of the identity."""
    for r in range(6):
        kept = w[KEPT + r]
        for c in range(r):
            w[M + 6 * r + c] = kept * w[KEPT + c] * (w[P + S * r + c] + w[R + 6 * r + c])
            apart, allowed = w[R + 6 * r + c] - w[R + 6 * c + r], 1e-9 * w[M + 6 * r + c]
            w[ODD] += chosen(apart * apart, allowed * allowed, 1.0, 0.0)
        w[DIAGONAL + r] = kept * (w[P + S * r + r] + w[R + 7 * r]) + (1.0 - kept)


def _factorise(w: FloatArray) -> None:
    """Put the Cholesky factor into the lower triangle of M, transposed, with the reciprocals of its diagonal.

    What M was stays above its diagonal, and in DIAGONAL.
    """
    for r in range(6):
        for c in range(r):
            w[M + 6 * c + r] = w[M + 6 * r + c]
    for c in range(6):
        pivot = w[DIAGONAL + c]
        for j in range(c):
            pivot -= w[M + 6 * c + j] * w[M + 6 * c + j]
        w[ODD] += chosen(pivot, 0.0, 0.0, 1.0)
        scale = 1.0 / math.sqrt(pivot)
        w[M + 7 * c] = scale
        for r in range(c + 1, 6):
            rest = w[M + 6 * r + c]
            for j in range(c):
                rest -= w[M + 6 * r + j] * w[M + 6 * c + j]
            w[M + 6 * r + c] = rest * scale


def _solve_column(w: FloatArray, s: int) -> None:
    """Column ``s`` of K' = S^-1 W, and what it adds to the state."""
    a, b, c = w[P + s] * w[KEPT], w[P + S + s] * w[KEPT + 1], w[P + 2 * S + s] * w[KEPT + 2]
    d, e, f = w[P + 3 * S + s] * w[KEPT + 3], w[P + 4 * S + s] * w[KEPT + 4], w[P + 5 * S + s] * w[KEPT + 5]
    w[W + s], w[W + S + s], w[W + 2 * S + s] = a, b, c
    w[W + 3 * S + s], w[W + 4 * S + s], w[W + 5 * S + s] = d, e, f
    a = a * w[M]
    b = (b - w[M + 6] * a) * w[M + 7]
    c = (c - w[M + 12] * a - w[M + 13] * b) * w[M + 14]
    d = (d - w[M + 18] * a - w[M + 19] * b - w[M + 20] * c) * w[M + 21]
    e = (e - w[M + 24] * a - w[M + 25] * b - w[M + 26] * c - w[M + 27] * d) * w[M + 28]
    f = (f - w[M + 30] * a - w[M + 31] * b - w[M + 32] * c - w[M + 33] * d - w[M + 34] * e) * w[M + 35]
    f = f * w[M + 35]
    e = (e - w[M + 34] * f) * w[M + 28]
    d = (d - w[M + 33] * f - w[M + 27] * e) * w[M + 21]
    c = (c - w[M + 32] * f - w[M + 26] * e - w[M + 20] * d) * w[M + 14]
    b = (b - w[M + 31] * f - w[M + 25] * e - w[M + 19] * d - w[M + 13] * c) * w[M + 7]
    a = (a - w[M + 30] * f - w[M + 24] * e - w[M + 18] * d - w[M + 12] * c - w[M + 6] * b) * w[M]
    w[K + s], w[K + S + s], w[K + 2 * S + s] = a, b, c
    w[K + 3 * S + s], w[K + 4 * S + s], w[K + 5 * S + s] = d, e, f
    w[X + s] += a * w[Y] + b * w[Y + 1] + c * w[Y + 2] + d * w[Y + 3] + e * w[Y + 4] + f * w[Y + 5]


def _weigh_column(w: FloatArray, s: int) -> None:
    """Row ``s`` of V = W' - K S; above the diagonal M still holds S."""
    a, b, c = w[K + s], w[K + S + s], w[K + 2 * S + s]
    d, e, f = w[K + 3 * S + s], w[K + 4 * S + s], w[K + 5 * S + s]
    w[V + s] = w[W + s] - (a * w[DIAGONAL] + b * w[M + 1] + c * w[M + 2] + d * w[M + 3] + e * w[M + 4] + f * w[M + 5])
    w[V + S + s] = w[W + S + s] - (
        a * w[M + 1] + b * w[DIAGONAL + 1] + c * w[M + 8] + d * w[M + 9] + e * w[M + 10] + f * w[M + 11]
    )
    w[V + 2 * S + s] = w[W + 2 * S + s] - (
        a * w[M + 2] + b * w[M + 8] + c * w[DIAGONAL + 2] + d * w[M + 15] + e * w[M + 16] + f * w[M + 17]
    )
    w[V + 3 * S + s] = w[W + 3 * S + s] - (
        a * w[M + 3] + b * w[M + 9] + c * w[M + 15] + d * w[DIAGONAL + 3] + e * w[M + 22] + f * w[M + 23]
    )
    w[V + 4 * S + s] = w[W + 4 * S + s] - (
        a * w[M + 4] + b * w[M + 10] + c * w[M + 16] + d * w[M + 22] + e * w[DIAGONAL + 4] + f * w[M + 29]
    )
    w[V + 5 * S + s] = w[W + 5 * S + s] - (
        a * w[M + 5] + b * w[M + 11] + c * w[M + 17] + d * w[M + 23] + e * w[M + 29] + f * w[DIAGONAL + 5]
    )


def _update_row(w: FloatArray, s: int) -> None:
    """Row ``s`` of P = P - K W - V K', from the diagonal on, and its mirror."""
    a, b, c = w[K + s], w[K + S + s], w[K + 2 * S + s]
    d, e, f = w[K + 3 * S + s], w[K + 4 * S + s], w[K + 5 * S + s]
    u, v, x = w[V + s], w[V + S + s], w[V + 2 * S + s]
    y, z, q = w[V + 3 * S + s], w[V + 4 * S + s], w[V + 5 * S + s]
    for t in range(s, S):
        first = a * w[W + t] + b * w[W + S + t] + c * w[W + 2 * S + t]
        second = d * w[W + 3 * S + t] + e * w[W + 4 * S + t] + f * w[W + 5 * S + t]
        third = u * w[K + t] + v * w[K + S + t] + x * w[K + 2 * S + t]
        fourth = y * w[K + 3 * S + t] + z * w[K + 4 * S + t] + q * w[K + 5 * S + t]
        value = w[P + S * s + t] - (first + second) - (third + fourth)
        w[P + S * s + t] = value
        w[P + S * t + s] = value
