"""What several runs show to an adaptation, run by run: vectors hold a number of each run, it wants all of one."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import transpose
from jerkbench.compilation.vectors import WIDTH, vectors
from jerkbench.engines.compiled.lanes.places import HPHT_AT, VARIANCE
from jerkbench.engines.compiled.places import KEPT, R, Y

SIX, MATRIX = 8, 40
"""Six numbers, and 36, with room up to the next whole vector."""


class Runs(NamedTuple):
    """Numbers of each run, without gaps; the ends of the rows mean nothing.

    Attributes:
        HPHt: (WIDTH, MATRIX).
        y: (WIDTH, SIX) innovation.
        kept: (WIDTH, SIX) 1 where a row is used, else 0.
        given: (WIDTH, MATRIX) R, as the adaptation gets it.
        adapted: (WIDTH, MATRIX) R, as the adaptation says.
        variance: (WIDTH, SIX) its diagonal, before rows without a finite one are left out.
    """

    HPHt: FloatArray
    y: FloatArray
    kept: FloatArray
    given: FloatArray
    adapted: FloatArray
    variance: FloatArray


def empty_runs() -> Runs:
    """Make room."""
    matrix, six = np.zeros((WIDTH, MATRIX)), np.zeros((WIDTH, SIX))
    return Runs(matrix, six, six.copy(), matrix.copy(), matrix.copy(), six.copy())


def spread(w: FloatArray, runs: Runs) -> None:
    """Write H P H', R, y and kept run by run."""
    HPHt, given = vectors(runs.HPHt), vectors(runs.given)
    for g in range(5):
        a, b, c, d = w[HPHT_AT[g, 0]], w[HPHT_AT[g, 1]], w[HPHT_AT[g, 2]], w[HPHT_AT[g, 3]]
        e, f, h, i = w[HPHT_AT[g, 4]], w[HPHT_AT[g, 5]], w[HPHT_AT[g, 6]], w[HPHT_AT[g, 7]]
        transpose(HPHt, g, 5, (a, b, c, d, e, f, h, i))
        transpose(given, g, 5, _eight(w, R + 8 * g, 1))
    transpose(vectors(runs.y), 0, 1, _eight(w, Y, 1))
    transpose(vectors(runs.kept), 0, 1, _eight(w, KEPT, 1))


def gather(w: FloatArray, runs: Runs) -> None:
    """Take the adapted R from where each run has its own."""
    adapted = vectors(runs.adapted)
    for g in range(5):
        transpose(w, R + 8 * g, 1, _eight(adapted, g, 5))
    for r in range(6):
        w[VARIANCE + r] = w[R + 7 * r]


def gather_kept(w: FloatArray, runs: Runs) -> None:
    """Likewise the variances and which rows are kept, where some are not; y of the others becomes 0."""
    transpose(w, VARIANCE, 1, _eight(vectors(runs.variance), 0, 1))
    transpose(w, KEPT, 1, _eight(vectors(runs.kept), 0, 1))
    for r in range(6):
        w[Y + r] = w[Y + r] * w[KEPT + r]


def _eight(w: FloatArray, at: int, step: int) -> tuple[float, ...]:
    a, b, c, d = w[at], w[at + step], w[at + 2 * step], w[at + 3 * step]
    e, f, g, h = w[at + 4 * step], w[at + 5 * step], w[at + 6 * step], w[at + 7 * step]
    return a, b, c, d, e, f, g, h
