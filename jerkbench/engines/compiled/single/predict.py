"""Prediction of one run with F = A (x) I3: all pairs of axes at once."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.engines.compiled.arguments import Model, Steps
from jerkbench.engines.compiled.places import B, N, X
from jerkbench.engines.compiled.predict import predict_axis, transform
from jerkbench.engines.compiled.single.places import AB, REST, SAME, SIZE


def predict(w: FloatArray, m: FloatArray, model: Model, steps: Steps, k: int) -> None:
    """Make x = F x + B u and P = F P F' + Q (x) I3 over step ``k``."""
    which, sample = steps.model[k], steps.sample[k]
    if model.triangular:
        for i in range(3):
            predict_axis(m, model.A, model.b, which, i, steps.u[sample, i])
        _predict_pair(w, model.A, model.Q, which)
    else:
        _predict_any_state(m, model, steps, which, sample)
        _predict_any_pair(w, model.A, model.Q, which)


def _predict_pair(w: FloatArray, A: FloatArray, Q: FloatArray, which: int) -> None:
    """A M A' + Q for an upper triangular A."""
    own, M = scratch(SIZE), scratch(SIZE)
    for e in range(N * N):
        own[e], M[e] = A[which, e // N, e % N], w[B + e]
    transform(M, own)
    for e in range(N * N):
        w[B + e] = M[e] + w[SAME] * Q[which, e // N, e % N]


def _predict_any_state(m: FloatArray, model: Model, steps: Steps, which: int, sample: int) -> None:
    """The state for any A."""
    for a in range(N):
        for i in range(3):
            moved = model.b[which, a] * steps.u[sample, i]
            for c in range(N):
                moved += model.A[which, a, c] * m[X + 3 * c + i]
            m[REST + 3 * a + i] = moved
    for s in range(3 * N):
        m[X + s] = m[REST + s]


def _predict_any_pair(w: FloatArray, A: FloatArray, Q: FloatArray, which: int) -> None:
    """A M A' + Q for any A."""
    for a in range(N):
        for b in range(N):
            total = w[B + b] * A[which, a, 0]
            for c in range(1, N):
                total += w[B + N * c + b] * A[which, a, c]
            w[AB + N * a + b] = total
    for a in range(N):
        for b in range(N):
            total = w[AB + N * a] * A[which, b, 0]
            for c in range(1, N):
                total += w[AB + N * a + c] * A[which, b, c]
            w[B + N * a + b] = total + w[SAME] * Q[which, a, b]
