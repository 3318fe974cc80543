"""The gain of the measurement update in Joseph form; six rows and the columns of K in local names.

With W = H P and S = H P H' + R: K' = S^-1 W,  x = x + K y,  V = W' - K S (zero but for rounding), and

    P - K W - V K' = (I - K H) P (I - K H)' + K R K'

so that an error of K enters the covariance only squared.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.engines.compiled.places import (
    DIAGONAL,
    HP_AT,
    KEPT,
    ODD,
    PRIOR_AT,
    ROW,
    WHITE,
    K,
    M,
    R,
    V,
    W,
    Y,
)


def mahalanobis(m: FloatArray) -> float:
    """Return y' (H P H' + R)^-1 y of the rows that are kept; raise ODD where that is not positive definite."""
    _fill_innovation_covariance(m)
    _factorise(m)
    total: float = m[WHITE] * 0.0
    for r in range(6):
        rest = m[Y + r]
        for j in range(r):
            rest -= m[M + 6 * r + j] * m[WHITE + j]
        m[WHITE + r] = rest
        total += rest * rest * m[M + 7 * r]
    return total


def _fill_innovation_covariance(m: FloatArray) -> None:
    """M = H P H' + R; a row that is not kept becomes one of the identity."""
    for r in range(6):
        kept = m[KEPT + r]
        for c in range(r):
            m[M + 6 * r + c] = kept * m[KEPT + c] * (m[PRIOR_AT[r, c]] + m[R + 6 * r + c])
            apart, allowed = m[R + 6 * r + c] - m[R + 6 * c + r], 1e-9 * m[M + 6 * r + c]
            m[ODD] += chosen(apart * apart, allowed * allowed, 1.0, 0.0)
        m[DIAGONAL + r] = kept * (m[PRIOR_AT[r, r]] + m[R + 7 * r]) + (1.0 - kept)


def _factorise(m: FloatArray) -> None:
    """S = L D L': put L (ones on its diagonal) below the diagonal of M, and the reciprocals of D onto it.

    What M was stays above its diagonal, and in DIAGONAL. No root is drawn: one division follows the other six times
    here, and each step waits for them.
    """
    for r in range(6):
        m[M + 7 * r] = m[DIAGONAL + r]
        for c in range(r):
            m[M + 6 * c + r] = m[M + 6 * r + c]
    for c in range(6):
        m[ODD] += chosen(m[M + 7 * c], 0.0, 0.0, 1.0)
        m[M + 7 * c] = 1.0 / m[M + 7 * c]
        for r in range(5, c, -1):  # a row needs those above it before they are scaled
            factor = m[M + 6 * r + c] * m[M + 7 * c]
            for j in range(c + 1, r + 1):
                m[M + 6 * r + j] -= factor * m[M + 6 * j + c]
            m[M + 6 * r + c] = factor


def solve_column(w: FloatArray, m: FloatArray, s: int) -> None:
    """Column ``s`` of W = H P and of K' = S^-1 W."""
    a, b, c = w[HP_AT[0, s]] * m[KEPT], w[HP_AT[1, s]] * m[KEPT + 1], w[HP_AT[2, s]] * m[KEPT + 2]
    d, e, f = w[HP_AT[3, s]] * m[KEPT + 3], w[HP_AT[4, s]] * m[KEPT + 4], w[HP_AT[5, s]] * m[KEPT + 5]
    w[W + s], w[W + ROW + s], w[W + 2 * ROW + s] = a, b, c
    w[W + 3 * ROW + s], w[W + 4 * ROW + s], w[W + 5 * ROW + s] = d, e, f
    b = b - m[M + 6] * a
    c = c - m[M + 12] * a - m[M + 13] * b
    d = d - m[M + 18] * a - m[M + 19] * b - m[M + 20] * c
    e = e - m[M + 24] * a - m[M + 25] * b - m[M + 26] * c - m[M + 27] * d
    f = f - m[M + 30] * a - m[M + 31] * b - m[M + 32] * c - m[M + 33] * d - m[M + 34] * e
    a, b, c = a * m[M], b * m[M + 7], c * m[M + 14]
    d, e, f = d * m[M + 21], e * m[M + 28], f * m[M + 35]
    e = e - m[M + 34] * f
    d = d - m[M + 33] * f - m[M + 27] * e
    c = c - m[M + 32] * f - m[M + 26] * e - m[M + 20] * d
    b = b - m[M + 31] * f - m[M + 25] * e - m[M + 19] * d - m[M + 13] * c
    a = a - m[M + 30] * f - m[M + 24] * e - m[M + 18] * d - m[M + 12] * c - m[M + 6] * b
    w[K + s], w[K + ROW + s], w[K + 2 * ROW + s] = a, b, c
    w[K + 3 * ROW + s], w[K + 4 * ROW + s], w[K + 5 * ROW + s] = d, e, f


def moved_by(w: FloatArray, m: FloatArray, s: int) -> float:
    """Return element ``s`` of K y."""
    first: float = w[K + s] * m[Y] + w[K + ROW + s] * m[Y + 1] + w[K + 2 * ROW + s] * m[Y + 2]
    second: float = w[K + 3 * ROW + s] * m[Y + 3] + w[K + 4 * ROW + s] * m[Y + 4] + w[K + 5 * ROW + s] * m[Y + 5]
    return first + second


def weigh_column(w: FloatArray, m: FloatArray, s: int) -> None:
    """Row ``s`` of V = W' - K S; above the diagonal M still holds S."""
    a, b, c = w[K + s], w[K + ROW + s], w[K + 2 * ROW + s]
    d, e, f = w[K + 3 * ROW + s], w[K + 4 * ROW + s], w[K + 5 * ROW + s]
    w[V + s] = w[W + s] - (a * m[DIAGONAL] + b * m[M + 1] + c * m[M + 2] + d * m[M + 3] + e * m[M + 4] + f * m[M + 5])
    w[V + ROW + s] = w[W + ROW + s] - (
        a * m[M + 1] + b * m[DIAGONAL + 1] + c * m[M + 8] + d * m[M + 9] + e * m[M + 10] + f * m[M + 11]
    )
    w[V + 2 * ROW + s] = w[W + 2 * ROW + s] - (
        a * m[M + 2] + b * m[M + 8] + c * m[DIAGONAL + 2] + d * m[M + 15] + e * m[M + 16] + f * m[M + 17]
    )
    w[V + 3 * ROW + s] = w[W + 3 * ROW + s] - (
        a * m[M + 3] + b * m[M + 9] + c * m[M + 15] + d * m[DIAGONAL + 3] + e * m[M + 22] + f * m[M + 23]
    )
    w[V + 4 * ROW + s] = w[W + 4 * ROW + s] - (
        a * m[M + 4] + b * m[M + 10] + c * m[M + 16] + d * m[M + 22] + e * m[DIAGONAL + 4] + f * m[M + 29]
    )
    w[V + 5 * ROW + s] = w[W + 5 * ROW + s] - (
        a * m[M + 5] + b * m[M + 11] + c * m[M + 17] + d * m[M + 23] + e * m[M + 29] + f * m[DIAGONAL + 5]
    )
