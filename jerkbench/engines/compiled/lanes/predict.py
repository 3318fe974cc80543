"""Prediction of several runs with F = A (x) I3, A upper triangular with ones on its diagonal."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.sizes import B, N, P, S, X


def predict(w: FloatArray, A: FloatArray, b: FloatArray, Q: FloatArray, k: int, u: FloatArray, sample: int) -> None:
    """Make x = F x + B u and P = F P F' + Q (x) I3 with model ``k`` and row ``sample`` of u."""
    for i in range(3):
        _predict_axis(w, A, b, k, i, u[3 * sample + i])
    for p in range(6):
        _predict_pair(w, A, B + N * N * p, k)
    for i in range(3):
        _add_noise(w, Q, B + N * N * (0, 3, 5)[i], k)


def _predict_axis(w: FloatArray, A: FloatArray, b: FloatArray, k: int, i: int, u: float) -> None:
    for a in range(N):
        moved = w[X + 3 * a + i] + b[k, a] * u
        for c in range(a + 1, N):
            moved += A[k, a, c] * w[X + 3 * c + i]
        w[X + 3 * a + i] = moved


def _predict_pair(w: FloatArray, A: FloatArray, at: int, k: int) -> None:
    """A M A' of the matrix M (N, N) at ``at``: rows from above, then columns from the left, in place."""
    if N == 3:
        _predict_three(w, at, A[k, 0, 1], A[k, 0, 2], A[k, 1, 2])
    else:
        _predict_any(w, A, at, k)


def _predict_three(w: FloatArray, at: int, f: float, g: float, h: float) -> None:
    """The same for A = (1 f g; 0 1 h; 0 0 1), each element read and written once."""
    a, b, c = w[at], w[at + 1], w[at + 2]
    d, e, i = w[at + 3], w[at + 4], w[at + 5]
    x, y, z = w[at + 6], w[at + 7], w[at + 8]
    a, b, c = a + f * d + g * x, b + f * e + g * y, c + f * i + g * z
    d, e, i = d + h * x, e + h * y, i + h * z
    w[at], w[at + 1], w[at + 2] = a + f * b + g * c, b + h * c, c
    w[at + 3], w[at + 4], w[at + 5] = d + f * e + g * i, e + h * i, i
    w[at + 6], w[at + 7] = x + f * y + g * z, y + h * z


def _predict_any(w: FloatArray, A: FloatArray, at: int, k: int) -> None:
    for a in range(N):
        for c in range(a + 1, N):
            factor = A[k, a, c]
            for b in range(N):
                w[at + N * a + b] += factor * w[at + N * c + b]
    for b in range(N):
        for d in range(b + 1, N):
            factor = A[k, b, d]
            for a in range(N):
                w[at + N * a + b] += factor * w[at + N * a + d]


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
                    w[P + S * (3 * a + i) + 3 * b + j] = value
                    w[P + S * (3 * b + j) + 3 * a + i] = value
            p += 1


def square_to_pairs(w: FloatArray) -> None:
    """Write the square into the pairs of axes."""
    p = 0
    for i in range(3):
        for j in range(i, 3):
            for a in range(N):
                for b in range(N):
                    w[B + N * N * p + N * a + b] = w[P + S * (3 * a + i) + 3 * b + j]
            p += 1
