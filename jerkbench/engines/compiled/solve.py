"""Small linear algebra with six rows in w; a row that is absent is one of the identity."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.sizes import INVERSE, SPARE, WHITE, K, M, P, S, Y


def factorised(w: FloatArray) -> bool:
    """Replace the lower triangle of M by its Cholesky factor L, with the reciprocals of the diagonal.

    False where M is not symmetric or not positive definite; M is then spoilt.
    """
    for r in range(6):
        for c in range(r):
            if abs(w[M + 6 * r + c] - w[M + 6 * c + r]) > 1e-9 * abs(w[M + 6 * r + c]):
                return False
    for r in range(6):
        for c in range(r):
            rest = w[M + 6 * r + c]
            for j in range(c):
                rest -= w[M + 6 * r + j] * w[M + 6 * c + j]
            w[M + 6 * r + c] = rest * w[M + 7 * c]
        pivot = w[M + 7 * r]
        for j in range(r):
            pivot -= w[M + 6 * r + j] * w[M + 6 * r + j]
        if not pivot > 0.0:
            return False
        w[M + 7 * r] = 1.0 / pivot**0.5
    return True


def whitened_square(w: FloatArray) -> float:
    """Return y' M^-1 y with the factor L in the place of M."""
    total = 0.0
    for r in range(6):
        rest = w[Y + r]
        for j in range(r):
            rest -= w[M + 6 * r + j] * w[WHITE + j]
        w[WHITE + r] = rest * w[M + 7 * r]
        total += w[WHITE + r] * w[WHITE + r]
    return total


def solve_rows(w: FloatArray) -> None:
    """Replace the rows of K by M^-1 K with the factor L in the place of M."""
    for r in range(6):
        for j in range(r):
            _subtract_row(w, r, j, w[M + 6 * r + j])
        _scale_row(w, r, w[M + 7 * r])
    for back in range(6):
        r = 5 - back
        for j in range(r + 1, 6):
            _subtract_row(w, r, j, w[M + 6 * j + r])
        _scale_row(w, r, w[M + 7 * r])


def _subtract_row(w: FloatArray, r: int, j: int, factor: float) -> None:
    for s in range(S):
        w[K + S * r + s] -= factor * w[K + S * j + s]


def _scale_row(w: FloatArray, r: int, factor: float) -> None:
    for s in range(S):
        w[K + S * r + s] *= factor


def invert(w: FloatArray) -> None:
    """Gauss-Jordan with pivoting, for an M that has no Cholesky factor; M is spoilt."""
    for e in range(36):
        w[INVERSE + e] = 1.0 if e % 7 == 0 else 0.0
    for c in range(6):
        best = c
        for r in range(c + 1, 6):
            if abs(w[M + 6 * r + c]) > abs(w[M + 6 * best + c]):
                best = r
        for at in (M, INVERSE):
            for j in range(6):
                w[at + 6 * c + j], w[at + 6 * best + j] = w[at + 6 * best + j], w[at + 6 * c + j]
        _eliminate(w, c)


def _eliminate(w: FloatArray, c: int) -> None:
    """Make column ``c`` of M that of the identity, and do the same to its inverse."""
    scale = 1.0 / w[M + 7 * c]
    for at in (M, INVERSE):
        for j in range(6):
            w[at + 6 * c + j] *= scale
    for r in range(6):
        factor = w[M + 6 * r + c]
        if r != c:
            for at in (M, INVERSE):
                for j in range(6):
                    w[at + 6 * r + j] -= factor * w[at + 6 * c + j]


def quadratic(w: FloatArray) -> float:
    """Return y' M^-1 y with the inverse."""
    total = 0.0
    for r in range(6):
        for c in range(6):
            total += w[Y + r] * w[INVERSE + 6 * r + c] * w[Y + c]
    return total


def positive_definite(w: FloatArray) -> bool:
    """Whether the covariance has a Cholesky factor (found without roots, as L D L')."""
    for e in range(S * S):
        w[SPARE + e] = w[P + e]
    for c in range(S):
        pivot = w[SPARE + (S + 1) * c]
        if not pivot > 0.0:
            return False
        scale = 1.0 / pivot
        for r in range(c + 1, S):
            factor = w[SPARE + S * c + r] * scale
            for j in range(r, S):
                w[SPARE + S * r + j] -= factor * w[SPARE + S * c + j]
    return True
