"""The two forms of the covariance of one run: by pairs of axes in vectors, and as a square."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.places import PRIOR_ROW, ROW, N
from jerkbench.engines.compiled.single.places import (
    COVARIANCE,
    MEASURED,
    PAIRS,
    PAIRS_FROM_SQUARE,
    REST,
    SPARE,
    SQUARE,
    SQUARE_FROM_PAIRS,
    S,
)


def pairs_to_square(m: FloatArray) -> None:
    """Write the pairs into the square."""
    for r in range(S):
        for c in range(S):
            m[COVARIANCE + PRIOR_ROW * r + c] = m[PAIRS + SQUARE_FROM_PAIRS[r, c]]


def square_to_pairs(m: FloatArray) -> None:
    """Write the lower triangle of the square into the pairs."""
    for e in range(N * N):
        for p in range(6):
            m[PAIRS + WIDTH * e + p] = m[COVARIANCE + PAIRS_FROM_SQUARE[e, p]]


def store_measured(m: FloatArray, covariance: FloatArray, k: int) -> None:
    """Write position and velocity of the covariance in pairs into row ``k`` of ``covariance`` (k, 36)."""
    for r in range(6):
        for c in range(6):
            covariance[k, 6 * r + c] = m[PAIRS + MEASURED[r, c]]


def definite(w: FloatArray, m: FloatArray) -> bool:
    """Whether the lower triangle of the square has a Cholesky factor (found without roots, as L D L')."""
    for e in range(S * ROW):
        w[SPARE + e] = w[SQUARE + e]
    for c in range(S):
        pivot = m[REST + PRIOR_ROW * c + c]
        if not pivot > 0.0:
            return False
        for t in range(WIDTH * (c // WIDTH + 1), S):  # row c right of the vector that its diagonal is in: by symmetry
            m[REST + PRIOR_ROW * c + t] = m[REST + PRIOR_ROW * t + c]
        scale = 1.0 / pivot
        for r in range(c + 1, S):
            factor = m[REST + PRIOR_ROW * r + c] * scale
            for piece in range(c // WIDTH, r // WIDTH + 1):
                w[SPARE + ROW * r + piece] -= factor * w[SPARE + ROW * c + piece]
    return True
