"""The measurement update in Joseph form, with the gain from a Cholesky factor of S."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.repeated import Repeated
from jerkbench.engines.compiled.sizes import INVERSE, KEPT, K, M, P, R, S, W, X, Y
from jerkbench.engines.compiled.solve import factorised, invert, quadratic, solve_rows, whitened_square


def fill_innovation_covariance(w: FloatArray) -> None:
    """M = H P H' + R; a row that is not kept becomes one of the identity."""
    for r in range(6):
        for c in range(6):
            kept = w[KEPT + r] * w[KEPT + c] > 0.0
            w[M + 6 * r + c] = w[P + S * r + c] + w[R + 6 * r + c] if kept else (1.0 if r == c else 0.0)


def mahalanobis(w: FloatArray) -> float:
    """Return y' (H P H' + R)^-1 y of the rows that are kept."""
    fill_innovation_covariance(w)
    return whitened_square(w) if factorised(w) else _mahalanobis_by_inverse(w)


def _mahalanobis_by_inverse(w: FloatArray) -> float:
    """The same where the matrix has no factor; rare, so it stands apart."""
    fill_innovation_covariance(w)
    invert(w)
    return quadratic(w)


def correct(w: FloatArray) -> float:
    """Update state and covariance with the rows that are kept; return y' S^-1 y.

    K = P H' S^-1;  x = x + K y;  P = (I - K H) P (I - K H)' + K R K', symmetrised.
    """
    for r in range(6):
        kept = w[KEPT + r]
        for s in range(S):
            w[W + S * r + s] = w[P + S * r + s] * kept
    nis = _gain(w)
    for r in range(6):
        y = w[Y + r]
        for s in range(S):
            w[X + s] += w[K + S * r + s] * y
    _joseph(w)
    return nis


def _gain(w: FloatArray) -> float:
    """K' = S^-1 H P; return y' S^-1 y."""
    fill_innovation_covariance(w)
    if not factorised(w):
        return _gain_by_inverse(w)
    for e in range(6 * S):
        w[K + e] = w[W + e]
    solve_rows(w)
    return whitened_square(w)


def _gain_by_inverse(w: FloatArray) -> float:
    """The same where S has no factor; the filter is then past saving, but it must fail as the reference does."""
    nis = _mahalanobis_by_inverse(w)
    for r in range(6):
        for s in range(S):
            total = 0.0
            for c in range(6):
                total += w[INVERSE + 6 * c + r] * w[W + S * c + s]
            w[K + S * r + s] = total
    return nis


def _joseph(w: FloatArray) -> None:
    """P = A - (A H' - K R) K' with A = (I - K H) P; one triangle is computed, the other is its mirror.

    A lies transposed, and the triangle that is computed is the one whose columns are measured: there A (I - H' K')
    shrinks the rounding of A, which the size of the prior decides, by R/S. The columns of A H' are its own, not its
    rows: so an error of K enters only squared.
    """
    _gain_rows(w)
    _noise_rows(w)
    _joseph_rows(w)
    for s in range(S):
        for t in range(s):
            w[P + S * s + t] = w[P + S * t + s]


def _gain_row(w: FloatArray, s: int) -> None:
    """A' = P - (H P)' K', in the place of P; the first six rows are needed in full."""
    for t in range(0 if s < 6 else s, S):
        total = w[P + S * s + t]
        for r in range(6):
            total -= w[W + S * r + s] * w[K + S * r + t]
        w[P + S * s + t] = total


def _noise_row(w: FloatArray, c: int) -> None:
    """W = (A H' - K R)'; the rows of K that are not kept are zero."""
    for s in range(S):
        total = w[P + S * c + s]
        for r in range(6):
            total -= w[R + 6 * r + c] * w[K + S * r + s]
        w[W + S * c + s] = total


def _joseph_row(w: FloatArray, s: int) -> None:
    """P = A' - K W, on and above the diagonal."""
    for t in range(s, S):
        total = w[P + S * s + t]
        for r in range(6):
            total -= w[K + S * r + s] * w[W + S * r + t]
        w[P + S * s + t] = total


_gain_rows, _joseph_rows = Repeated(_gain_row, globals(), "S"), Repeated(_joseph_row, globals(), "S")
_noise_rows = Repeated(_noise_row, globals(), 6)
