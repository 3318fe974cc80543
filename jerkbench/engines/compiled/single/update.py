"""The measurement update of one run in Joseph form, whose rows of matrices are vectors.

`jerkbench.engines.compiled.gain` has the gain. Then, with A = (I - K H) P,

    P = A - (A H' - K R) K'

A lies transposed in the place of P. Of the two sides of the covariance the one is computed whose row is measured: there
A (I - H' K') shrinks the rounding of A, which the size of the prior decides, by R/S. The columns of A H' are its own,
not its rows: so an error of K enters only squared.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.gain import mahalanobis, moved_by, solve_column
from jerkbench.engines.compiled.places import ODD, ROW, K, R, V, X
from jerkbench.engines.compiled.single.inverse import correct_by_inverse, mahalanobis_by_inverse
from jerkbench.engines.compiled.single.places import FIRST, GAIN, HP, MOVE, PRIOR_ROW, SQUARE, STEP, P, S


def distance(m: FloatArray) -> float:
    """Return y' (H P H' + R)^-1 y of the rows that are kept."""
    m[ODD] = 0.0
    nis = mahalanobis(m)
    return nis if m[ODD] == 0.0 else mahalanobis_by_inverse(m)


def correct(w: FloatArray, m: FloatArray) -> float:
    """Update state and covariance (its lower triangle) with the rows that are kept; return y' S^-1 y."""
    m[ODD] = 0.0
    nis = mahalanobis(m)
    if m[ODD] == 0.0:
        for piece in range(ROW):
            solve_column(w, m, piece)
            w[MOVE + piece] = moved_by(w, m, piece)
        _joseph(w, m)
    else:
        nis = correct_by_inverse(m)
    for s in range(6):
        m[X + s] += m[STEP + FIRST + s]
    for s in range(6, S):
        m[X + s] += m[STEP + s - 6]
    return nis


def _joseph(w: FloatArray, m: FloatArray) -> None:
    for s in range(S):
        for piece in range(ROW if s >= FIRST else s // WIDTH + 1):
            _subtract(w, m, s, piece, HP, K)  # A' = P - (H P)' K'
    for r in range(6):
        for piece in range(ROW):
            _subtract_noise(w, m, r, piece)
    for s in range(S):
        for piece in range(s // WIDTH + 1):
            _subtract(w, m, s, piece, GAIN, V)  # P = A' - K V


def _subtract(w: FloatArray, m: FloatArray, s: int, piece: int, left: int, right: int) -> None:
    """One vector of row ``s`` of the square less ``left``' ``right``, of two parts with six rows (numbers, vectors)."""
    first, second = m[left + s] * w[right + piece], m[left + PRIOR_ROW + s] * w[right + ROW + piece]
    for r in range(2, 6, 2):
        first += m[left + PRIOR_ROW * r + s] * w[right + ROW * r + piece]
        second += m[left + PRIOR_ROW * (r + 1) + s] * w[right + ROW * (r + 1) + piece]
    w[SQUARE + ROW * s + piece] -= first + second


def _subtract_noise(w: FloatArray, m: FloatArray, r: int, piece: int) -> None:
    """V = (A H' - K R)'; the rows of K that are not kept are zero."""
    first, second = m[R + r] * w[K + piece], m[R + 6 + r] * w[K + ROW + piece]
    for c in range(2, 6, 2):
        first += m[R + 6 * c + r] * w[K + ROW * c + piece]
        second += m[R + 6 * (c + 1) + r] * w[K + ROW * (c + 1) + piece]
    w[V + ROW * r + piece] = w[P + ROW * r + piece] - (first + second)
