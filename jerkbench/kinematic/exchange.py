"""The exchange with an adaptation: vectors hold a number of each run, and it wants all numbers of one run."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import gather, scatter
from jerkbench.compilation.vectors import aligned_zeros, chosen, vectors
from jerkbench.kinematic.arguments import Packed, Runs
from jerkbench.kinematic.layout import EIGHTS, KEPT, VARIANCE, WIDTH, R, Y

SIX, MATRIX = 8, 40
"""Six numbers, and 36, with room up to the next whole eight."""


def empty_runs(n: int, width: int) -> Runs:
    """Make room for ``width`` runs of a filter with ``n`` quantities on each axis."""
    HPHt, given, adapted = (aligned_zeros(width, MATRIX) for _ in range(3))
    y, kept, variance = (aligned_zeros(width, SIX) for _ in range(3))
    since = np.tile(np.concatenate([np.eye(n).ravel(), np.zeros(n * n)]), (width, 1))
    s = 3 * n
    room = np.zeros(114), np.zeros(6, dtype=np.int64), since, np.zeros(s + 4 * s * s), np.zeros((width, 2 + s + s * s))
    return Runs(HPHt, y, kept, given, adapted, variance, *room)


def show(w: FloatArray, runs: Runs) -> None:
    """Write H P H', R, y and kept run by run."""
    HPHt, given = vectors(runs.HPHt, WIDTH), vectors(runs.given, WIDTH)
    for g in range(5):
        a, b, c, d = w[EIGHTS[g, 0]], w[EIGHTS[g, 1]], w[EIGHTS[g, 2]], w[EIGHTS[g, 3]]
        e, f, h, i = w[EIGHTS[g, 4]], w[EIGHTS[g, 5]], w[EIGHTS[g, 6]], w[EIGHTS[g, 7]]
        scatter(HPHt, g, 5, (a, b, c, d, e, f, h, i))
        scatter(given, g, 5, _eight(w, R + 8 * g))
    scatter(vectors(runs.y, WIDTH), 0, 1, _eight(w, Y))
    scatter(vectors(runs.kept, WIDTH), 0, 1, _eight(w, KEPT))


def take(w: FloatArray, runs: Runs) -> None:
    """Take the adapted R from where each run has its own."""
    adapted = vectors(runs.adapted, WIDTH)
    for g in range(5):
        _put(w, R + 8 * g, gather(adapted, g, 5))
    for r in range(6):
        w[VARIANCE + r] = w[R + 7 * r]


def take_kept(w: FloatArray, runs: Runs) -> None:
    """Likewise the variances and which rows are used, where some are not; y of the others becomes 0."""
    _put(w, VARIANCE, gather(vectors(runs.variance, WIDTH), 0, 1))
    _put(w, KEPT, gather(vectors(runs.kept, WIDTH), 0, 1))
    for r in range(6):
        w[Y + r] = chosen(w[KEPT + r], 0.0, w[Y + r], 0.0)


def _eight(w: FloatArray, at: int) -> tuple[float, ...]:
    return w[at], w[at + 1], w[at + 2], w[at + 3], w[at + 4], w[at + 5], w[at + 6], w[at + 7]


def _put(w: FloatArray, at: int, eight: tuple[float, ...]) -> None:
    for e in range(8):
        w[at + e] = eight[e]


def packed_of(runs: Runs) -> Packed:
    """Point at what an adaptation sees where some rows are missing, and at room for what it says."""
    some = runs.some
    return Packed(runs.rows, some[108:114], some[:36], some[36:72], some[72:108])
