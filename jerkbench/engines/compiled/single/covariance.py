"""The two forms of the covariance of one run: by pairs of axes in vectors, and as a square."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import picked
from jerkbench.compilation.vectors import WIDTH, vectors
from jerkbench.engines.compiled.places import ROW, B, N
from jerkbench.engines.compiled.single.places import (
    COVARIANCE,
    FIRST_EIGHT,
    FOURTH_EIGHT,
    LAST_EIGHT,
    PAIRS,
    PAIRS_FROM_SQUARE,
    PRIOR_ROW,
    REST,
    SECOND_EIGHT,
    SPARE,
    SQUARE,
    SQUARE_FROM_PAIRS,
    THIRD_EIGHT,
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


def store_measured(w: FloatArray, covariance: FloatArray, k: int) -> None:
    """Write position and velocity of the covariance in pairs into row ``k`` of ``covariance`` (k, 36)."""
    row, end = vectors(covariance[k]), vectors(covariance[k, 36 - WIDTH :])
    a, b, c, d = w[B], w[B + 1], w[B + N], w[B + N + 1]
    row[0] = picked(a, b, c, d, FIRST_EIGHT)
    row[1] = picked(a, b, c, d, SECOND_EIGHT)
    row[2] = picked(a, b, c, d, THIRD_EIGHT)
    row[3] = picked(a, b, c, d, FOURTH_EIGHT)
    end[0] = picked(a, b, c, d, LAST_EIGHT)


def definite(w: FloatArray, m: FloatArray) -> bool:
    """Whether the lower triangle of the square has factors L D L' with D > 0."""
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
