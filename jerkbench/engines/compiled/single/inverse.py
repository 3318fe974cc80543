"""The update where S is not positive definite: the filter is past saving, but it must fail as the reference does."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.places import KEPT, M, R, Y
from jerkbench.engines.compiled.single.places import (
    COVARIANCE,
    FIRST,
    GAIN,
    HP,
    INVERSE,
    LEFT,
    PRIOR,
    PRIOR_ROW,
    STEP,
    S,
)


def mahalanobis_by_inverse(m: FloatArray) -> float:
    """Return y' (H P H' + R)^-1 y of the rows that are kept."""
    _invert(m)
    total = 0.0
    for r in range(6):
        for c in range(6):
            total += m[Y + r] * m[INVERSE + 6 * r + c] * m[Y + c]
    return total


def correct_by_inverse(m: FloatArray) -> float:
    """K = P H' S^-1;  step = K y;  P = A - (A H' - K R) K' with A = (I - K H) P, symmetrised; return y' S^-1 y."""
    nis = mahalanobis_by_inverse(m)
    _find_gain(m)
    _subtract(m, GAIN, HP)
    _find_rest(m)
    _subtract(m, LEFT, GAIN)
    for s in range(S):
        for t in range(s):
            mean = 0.5 * (m[COVARIANCE + PRIOR_ROW * s + t] + m[COVARIANCE + PRIOR_ROW * t + s])
            m[COVARIANCE + PRIOR_ROW * s + t] = m[COVARIANCE + PRIOR_ROW * t + s] = mean
    return nis


def _find_gain(m: FloatArray) -> None:
    """Put the kept rows of H P into W, P H' S^-1 into K, transposed, and K y into STEP."""
    for s in range(S):
        m[STEP + s] = 0.0
        for r in range(6):
            m[HP + PRIOR_ROW * r + s] = m[COVARIANCE + PRIOR_ROW * (FIRST + r) + s] * m[KEPT + r]
        for r in range(6):
            total = 0.0
            for c in range(6):
                total += m[HP + PRIOR_ROW * c + s] * m[INVERSE + 6 * c + r]
            m[GAIN + PRIOR_ROW * r + s] = total
            m[STEP + s] += total * m[Y + r]


def _find_rest(m: FloatArray) -> None:
    """Put A H' - K R into V, transposed, where P holds A; the rows that are not kept are zero in K and R."""
    for s in range(S):
        for r in range(6):
            total = m[COVARIANCE + PRIOR_ROW * s + FIRST + r] * m[KEPT + r]
            for c in range(6):
                total -= m[GAIN + PRIOR_ROW * c + s] * m[R + 6 * c + r]
            m[LEFT + PRIOR_ROW * r + s] = total


def _subtract(m: FloatArray, left: int, right: int) -> None:
    """P = P - left' right, of two parts with six rows."""
    for s in range(S):
        for t in range(S):
            total = 0.0
            for r in range(6):
                total += m[left + PRIOR_ROW * r + s] * m[right + PRIOR_ROW * r + t]
            m[COVARIANCE + PRIOR_ROW * s + t] -= total


def _invert(m: FloatArray) -> None:
    """Put (H P H' + R)^-1 into INVERSE by Gauss-Jordan elimination with pivoting; M is spoilt."""
    for r in range(6):
        for c in range(6):
            there = m[KEPT + r] * m[KEPT + c] > 0.0
            identity = 1.0 if r == c else 0.0
            m[M + 6 * r + c] = m[PRIOR + PRIOR_ROW * r + c] + m[R + 6 * r + c] if there else identity
            m[INVERSE + 6 * r + c] = identity
    for c in range(6):
        best = c
        for r in range(c + 1, 6):
            if abs(m[M + 6 * r + c]) > abs(m[M + 6 * best + c]):
                best = r
        for at in (M, INVERSE):
            for j in range(6):
                m[at + 6 * c + j], m[at + 6 * best + j] = m[at + 6 * best + j], m[at + 6 * c + j]
        _eliminate(m, c)


def _eliminate(m: FloatArray, c: int) -> None:
    """Make column ``c`` of M that of the identity, and do the same to INVERSE."""
    scale = 1.0 / m[M + 7 * c]
    for at in (M, INVERSE):
        for j in range(6):
            m[at + 6 * c + j] *= scale
    for r in range(6):
        factor = m[M + 6 * r + c]
        if r != c:
            for at in (M, INVERSE):
                for j in range(6):
                    m[at + 6 * r + j] -= factor * m[at + 6 * c + j]
