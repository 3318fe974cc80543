"""Prediction of several runs: each number of a pair of axes is a vector."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.engines.compiled.lanes.places import SIZE
from jerkbench.engines.compiled.places import B, N
from jerkbench.engines.compiled.predict import predict_axis, transform, transform_symmetric


def predict(w: FloatArray, A: FloatArray, b: FloatArray, Q: FloatArray, k: int, u: FloatArray, sample: int) -> None:
    """Make x = F x + B u and P = F P F' + Q (x) I3 with model ``k`` and row ``sample`` of u."""
    own, noise = scratch(SIZE), scratch(SIZE)
    for e in range(N * N):
        own[e], noise[e] = A[k, e // N, e % N], Q[k, e // N, e % N]
    for i in range(3):
        predict_axis(w, A, b, k, i, u[3 * sample + i])
    p = 0
    for i in range(3):
        _predict_same(w, own, noise, B + N * N * p)
        for _ in range(i + 1, 3):
            p += 1
            _predict_apart(w, own, B + N * N * p)
        p += 1


def _predict_apart(w: FloatArray, A: FloatArray, at: int) -> None:
    """The covariance of two axes."""
    M = scratch(SIZE)
    for e in range(N * N):
        M[e] = w[at + e]
    transform(M, A)
    for e in range(N * N):
        w[at + e] = M[e]


def _predict_same(w: FloatArray, A: FloatArray, Q: FloatArray, at: int) -> None:
    """The upper triangle of the covariance of one axis."""
    M = scratch(SIZE)
    for a in range(N):
        for b in range(a, N):
            M[N * a + b] = w[at + N * a + b]
    transform_symmetric(M, A)
    for a in range(N):
        for b in range(a, N):
            w[at + N * a + b] = M[N * a + b] + Q[N * a + b]
