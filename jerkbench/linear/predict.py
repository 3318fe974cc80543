"""Prediction with F = A (x) I3, row by row of a square covariance."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scatter
from jerkbench.linear.arguments import Models, Steps
from jerkbench.linear.layout import P_AT, QUANTITIES, ROW, SPARE, SPARE_AT, STATES, STRIDE, P, X

LAST = 8
"""The ninth state, whose column lies alone in its vector."""


def predict(w: FloatArray, m: FloatArray, models: Models, j: int, steps: Steps, k: int) -> None:
    """X = F x + B u and P = F P F' + Q of filter ``j`` over step ``k``."""
    A, b, Q = models.A[j, steps.model[k]], models.b[j, steps.model[k]], models.Q[j, steps.model[k]]
    for i in range(3):
        u = steps.u[steps.sample[k], i]
        for a in range(QUANTITIES):
            moved = b[a] * u
            for c in range(QUANTITIES):
                moved += A[a, c] * m[X + 3 * c + i]
            m[SPARE_AT + a] = moved
        for a in range(QUANTITIES):
            m[X + 3 * a + i] = m[SPARE_AT + a]
    _move_rows(w, A)
    _transpose(w, m)
    _move_rows(w, A)
    for a in range(QUANTITIES):
        for c in range(QUANTITIES):
            for i in range(3):
                m[SPARE_AT + STRIDE * (3 * a + i) + 3 * c + i] += Q[a, c]
    for e in range(ROW * STATES):
        w[P + e] = w[SPARE + e]


def _move_rows(w: FloatArray, A: FloatArray) -> None:
    """Fill SPARE with F P."""
    for a in range(QUANTITIES):
        for i in range(3):
            for piece in range(ROW):
                moved = A[a, 0] * w[P + ROW * i + piece]
                for c in range(1, QUANTITIES):
                    moved += A[a, c] * w[P + ROW * (3 * c + i) + piece]
                w[SPARE + ROW * (3 * a + i) + piece] = moved


def _transpose(w: FloatArray, m: FloatArray) -> None:
    """P = SPARE'."""
    a, b, c, d = w[SPARE], w[SPARE + ROW], w[SPARE + 2 * ROW], w[SPARE + 3 * ROW]
    e, f, g, h = w[SPARE + 4 * ROW], w[SPARE + 5 * ROW], w[SPARE + 6 * ROW], w[SPARE + 7 * ROW]
    scatter(w, P, ROW, (a, b, c, d, e, f, g, h))
    if STATES > LAST:
        for s in range(STATES):
            m[P_AT + STRIDE * s + LAST] = m[SPARE_AT + STRIDE * LAST + s]
            m[P_AT + STRIDE * LAST + s] = m[SPARE_AT + STRIDE * s + LAST]
