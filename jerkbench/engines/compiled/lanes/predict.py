"""Prediction of several runs, and the two forms of their covariances."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.places import ROW, B, N, P
from jerkbench.engines.compiled.predict import predict_axis, predict_pair


def predict(w: FloatArray, A: FloatArray, b: FloatArray, Q: FloatArray, k: int, u: FloatArray, sample: int) -> None:
    """Make x = F x + B u and P = F P F' + Q (x) I3 with model ``k`` and row ``sample`` of u."""
    for i in range(3):
        predict_axis(w, A, b, k, i, u[3 * sample + i])
    for p in range(6):
        predict_pair(w, A, B + N * N * p, k)
    for i in range(3):
        _add_noise(w, Q, B + N * N * (0, 3, 5)[i], k)


def _add_noise(w: FloatArray, Q: FloatArray, at: int, k: int) -> None:
    for a in range(N):
        for b in range(N):
            w[at + N * a + b] += Q[k, a, b]


def pairs_to_square(w: FloatArray) -> None:
    """Write the covariance by pairs of axes into the square."""
    p = 0
    for i in range(3):
        for j in range(i, 3):
            for a in range(N):
                for b in range(N):
                    value = w[B + N * N * p + N * a + b]
                    w[P + ROW * (3 * a + i) + 3 * b + j] = value
                    w[P + ROW * (3 * b + j) + 3 * a + i] = value
            p += 1


def square_to_pairs(w: FloatArray) -> None:
    """Write the square into the pairs of axes."""
    p = 0
    for i in range(3):
        for j in range(i, 3):
            for a in range(N):
                for b in range(N):
                    w[B + N * N * p + N * a + b] = w[P + ROW * (3 * a + i) + 3 * b + j]
            p += 1
