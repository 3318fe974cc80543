"""The gain: S = H P H' + R = L D L' of the rows that are used, and S^-1 times six rows, in local names."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.kalman import ROUNDING, SYMMETRIC
from jerkbench.kinematic.layout import AT, DIAGONAL, FINE, KEPT, LOST, SOLVED, WHITE, K, M, R, S, W, Y

UNEQUAL = SYMMETRIC * SYMMETRIC
"""How much of S_ii S_jj the square of a difference may be."""


NAN = float("nan")


def mahalanobis(w: FloatArray) -> float:
    """Return y' S^-1 y of the rows that are used; NaN where the run is lost.

    It is lost by an S that is not symmetric and positive definite beyond rounding.
    """
    _fill_innovation_covariance(w)
    _factorise(w)
    total: float = w[WHITE] * 0.0
    for r in range(6):
        rest = w[Y + r]
        for j in range(r):
            rest -= w[M + 6 * r + j] * w[WHITE + j]
        w[WHITE + r] = rest
        total += rest * rest * w[M + 7 * r]
    distance: float = chosen(w[LOST], 0.0, NAN, total)
    return distance


def determinant(w: FloatArray) -> float:
    """Return det S of the rows that are used, from the factors that `mahalanobis` has found."""
    reciprocal: float = w[M]
    for r in range(1, 6):
        reciprocal *= w[M + 7 * r]
    return 1.0 / reciprocal


def _fill_innovation_covariance(w: FloatArray) -> None:
    """M = H P H' + R; a row that is not used becomes one of the identity."""
    lost = w[LOST]
    for r in range(6):
        kept = w[KEPT + r]
        w[DIAGONAL + r] = kept * (w[AT[r, r]] + w[R + 7 * r]) + (1.0 - kept)
        for c in range(r):
            both = kept * w[KEPT + c]
            w[M + 6 * r + c] = both * (w[AT[r, c]] + w[R + 6 * r + c])
            apart = both * (w[R + 6 * r + c] - w[R + 6 * c + r])
            lost += chosen(apart * apart, UNEQUAL * w[DIAGONAL + r] * w[DIAGONAL + c], 1.0, 0.0)
    w[LOST] = lost


def _factorise(w: FloatArray) -> None:
    """S = L D L': put L (ones on its diagonal) below the diagonal of M, and the reciprocals of D onto it.

    No root is drawn: one division follows the other six times here, and each step waits for them. Above the diagonal
    is what is still to be eliminated.
    """
    for r in range(6):
        w[M + 7 * r] = w[DIAGONAL + r]
        for c in range(r):
            w[M + 6 * c + r] = w[M + 6 * r + c]
    lost = w[LOST]
    for c in range(6):
        lost += chosen(w[M + 7 * c], ROUNDING * w[DIAGONAL + c], 0.0, 1.0)
        w[M + 7 * c] = 1.0 / w[M + 7 * c]
        for r in range(5, c, -1):  # a row needs those above it before they are scaled
            factor = w[M + 6 * r + c] * w[M + 7 * c]
            for j in range(c + 1, r + 1):
                w[M + 6 * r + j] -= factor * w[M + 6 * j + c]
            w[M + 6 * r + c] = factor
    w[LOST] = lost


def solve_innovation(w: FloatArray) -> None:
    """Find v = S^-1 y from L^-1 y."""
    for r in range(5, -1, -1):
        rest = w[WHITE + r] * w[M + 7 * r]
        for j in range(r + 1, 6):
            rest -= w[M + 6 * j + r] * w[SOLVED + j]
        w[SOLVED + r] = rest


def solve_measured(w: FloatArray, s: int) -> None:
    """Column ``s`` of position or velocity: of R where that is the finer, else of W = H P."""
    fine, row = w[FINE + s], R + 6 * s
    a = chosen(fine, 0.0, w[row], w[AT[0, s]] * w[KEPT])
    b = chosen(fine, 0.0, w[row + 1], w[AT[1, s]] * w[KEPT + 1])
    c = chosen(fine, 0.0, w[row + 2], w[AT[2, s]] * w[KEPT + 2])
    d = chosen(fine, 0.0, w[row + 3], w[AT[3, s]] * w[KEPT + 3])
    e = chosen(fine, 0.0, w[row + 4], w[AT[4, s]] * w[KEPT + 4])
    f = chosen(fine, 0.0, w[row + 5], w[AT[5, s]] * w[KEPT + 5])
    _solve(w, s, a, b, c, d, e, f)


def solve_column(w: FloatArray, s: int) -> None:
    """Column ``s`` of W = H P, of a state that is not measured."""
    a, b, c = w[AT[0, s]] * w[KEPT], w[AT[1, s]] * w[KEPT + 1], w[AT[2, s]] * w[KEPT + 2]
    d, e, f = w[AT[3, s]] * w[KEPT + 3], w[AT[4, s]] * w[KEPT + 4], w[AT[5, s]] * w[KEPT + 5]
    _solve(w, s, a, b, c, d, e, f)


def _solve(w: FloatArray, s: int, a: float, b: float, c: float, d: float, e: float, f: float) -> None:
    """Keep a column G as column ``s`` of W, and S^-1 G as that of K."""
    w[W + s], w[W + S + s], w[W + 2 * S + s] = a, b, c
    w[W + 3 * S + s], w[W + 4 * S + s], w[W + 5 * S + s] = d, e, f
    b = b - w[M + 6] * a
    c = c - w[M + 12] * a - w[M + 13] * b
    d = d - w[M + 18] * a - w[M + 19] * b - w[M + 20] * c
    e = e - w[M + 24] * a - w[M + 25] * b - w[M + 26] * c - w[M + 27] * d
    f = f - w[M + 30] * a - w[M + 31] * b - w[M + 32] * c - w[M + 33] * d - w[M + 34] * e
    a, b, c = a * w[M], b * w[M + 7], c * w[M + 14]
    d, e, f = d * w[M + 21], e * w[M + 28], f * w[M + 35]
    e = e - w[M + 34] * f
    d = d - w[M + 33] * f - w[M + 27] * e
    c = c - w[M + 32] * f - w[M + 26] * e - w[M + 20] * d
    b = b - w[M + 31] * f - w[M + 25] * e - w[M + 19] * d - w[M + 13] * c
    a = a - w[M + 30] * f - w[M + 24] * e - w[M + 18] * d - w[M + 12] * c - w[M + 6] * b
    w[K + s], w[K + S + s], w[K + 2 * S + s] = a, b, c
    w[K + 3 * S + s], w[K + 4 * S + s], w[K + 5 * S + s] = d, e, f
