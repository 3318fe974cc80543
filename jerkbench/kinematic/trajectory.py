"""The trajectory: position, velocity and their covariance at each visited stamp of the reference."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import picked
from jerkbench.compilation.vectors import WIDE, vectors, vectors_from
from jerkbench.kinematic.layout import (
    AT,
    FIRST_EIGHT,
    FOURTH_EIGHT,
    LAST_EIGHT,
    SECOND_EIGHT,
    THIRD_EIGHT,
    WIDTH,
    B,
    N,
    X,
)


def store(w: FloatArray, x: FloatArray, P: FloatArray, row: int) -> None:
    """Write row ``row`` of x (k, 6) and P (k, 36)."""
    for s in range(6):
        x[6 * row + s] = w[X + s]
    if WIDTH == 1:
        _store_pairs(vectors(w, WIDE), P, 36 * row)
    else:
        for s in range(6):
            for t in range(6):
                P[36 * row + 6 * s + t] = w[AT[s, t]]


def _store_pairs(w: FloatArray, P: FloatArray, at: int) -> None:
    """Eight numbers at once; the last eight begin before the others end."""
    a, b, c, d = w[B // WIDE], w[B // WIDE + 1], w[B // WIDE + N], w[B // WIDE + N + 1]
    vectors_from(P, at, WIDE)[0] = picked(a, b, c, d, FIRST_EIGHT)
    vectors_from(P, at + 8, WIDE)[0] = picked(a, b, c, d, SECOND_EIGHT)
    vectors_from(P, at + 16, WIDE)[0] = picked(a, b, c, d, THIRD_EIGHT)
    vectors_from(P, at + 24, WIDE)[0] = picked(a, b, c, d, FOURTH_EIGHT)
    vectors_from(P, at + 28, WIDE)[0] = picked(a, b, c, d, LAST_EIGHT)
