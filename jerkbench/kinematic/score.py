"""The score: what a row of the reference adds to the sums of a run."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import chosen, vectors
from jerkbench.kinematic.arguments import MARKED, Score
from jerkbench.kinematic.layout import (
    AT,
    EAST,
    FARTHEST,
    LARGEST,
    LOST,
    NEES,
    NEES_POSITION,
    OUTAGE,
    SQUARE,
    VEAST,
    WHOLE,
    WIDTH,
    E,
    X,
)


def compare(w: FloatArray, score: Score, truth: FloatArray, errors: FloatArray, row: int) -> None:
    """Score the state with row ``row`` of ``truth``."""
    if score.mark[row] >= 0:
        marked = vectors(errors, WIDTH)
        place = MARKED * score.mark[row]
        for i in range(3):
            marked[place + i] = w[X + i] - truth[6 * row + i]
            marked[place + 3 + i] = w[AT[0, i]]
        for i in range(2):
            marked[place + 6 + i] = w[AT[1, 1 + i]]
        marked[place + 8] = w[AT[2, 2]]
    add_row(w, truth, row, score.weights)
    if len(score.outage) > 0:
        w[OUTAGE] += vectors(score.outage, WIDTH)[row] * w[SQUARE]


def add_row(w: FloatArray, truth: FloatArray, row: int, weights: FloatArray) -> None:
    """Add row ``row`` of ``truth`` (k, 6 vectors), with its ``weights`` (k, 4) in the order of `layout.WEIGHTS`."""
    for s in range(6):
        w[E + s] = w[X + s] - truth[6 * row + s]
    counted, whole, moving = weights[row, 0], weights[row, 1], weights[row, 2]
    for i in range(3):
        w[EAST + i] += counted * (w[E + i] * w[E + i])
        w[VEAST + i] += moving * (w[E + 3 + i] * w[E + 3 + i])
    square = w[E] * w[E] + w[E + 1] * w[E + 1] + w[E + 2] * w[E + 2]
    w[SQUARE] = square
    w[WHOLE] += whole * square
    w[FARTHEST] = chosen(square, w[FARTHEST], square, w[FARTHEST])
    w[LARGEST] = chosen(counted * square, w[LARGEST], square, w[LARGEST])
    _add_nees(w, counted, weights[row, 3])


def _add_nees(w: FloatArray, counted: float, both: float) -> None:
    """Add e' P^-1 e of position, and of position and velocity, by elimination."""
    C, e = scratch(36, WIDTH), scratch(6, WIDTH)
    for r in range(6):
        e[r] = w[E + r]
        for c in range(r, 6):
            C[6 * r + c] = w[AT[r, c]]
    total = e[0] * 0.0
    for c in range(6):
        pivot = C[7 * c]
        w[LOST] += chosen(pivot, 0.0, 0.0, 1.0)
        scale = 1.0 / pivot
        scaled = e[c] * scale
        total += e[c] * scaled
        for r in range(c + 1, 6):
            e[r] -= C[6 * c + r] * scaled
            factor = C[6 * c + r] * scale
            for j in range(r, 6):
                C[6 * r + j] -= factor * C[6 * c + j]
        if c == 2:
            w[NEES_POSITION] += counted * total
    w[NEES] += both * total
