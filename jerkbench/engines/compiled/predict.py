"""Prediction with F = A (x) I3: blocks of nine numbers, one product for each element of A that is not zero."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.sizes import FB, MOVED, B, N, S, X


def predict_state(w: FloatArray, A: FloatArray, b: FloatArray, k: int, u: FloatArray, sample: int) -> None:
    """Turn x into F x + B u with model ``k`` and row ``sample`` of u."""
    for a in range(N):
        for i in range(3):
            moved = b[k, a] * u[sample, i]
            for c in range(N):
                moved += A[k, a, c] * w[X + 3 * c + i]
            w[MOVED + 3 * a + i] = moved
    for s in range(S):
        w[X + s] = w[MOVED + s]


def predict_state_triangular(w: FloatArray, A: FloatArray, b: FloatArray, k: int, u: FloatArray, sample: int) -> None:
    """The same in place, for A upper triangular with ones on its diagonal."""
    for a in range(N):
        for c in range(a + 1, N):
            factor = A[k, a, c]
            for i in range(3):
                w[X + 3 * a + i] += factor * w[X + 3 * c + i]
        factor = b[k, a]
        for i in range(3):
            w[X + 3 * a + i] += factor * u[sample, i]


def predict_triangular(w: FloatArray, A: FloatArray, Q: FloatArray, k: int) -> None:
    """P = F P F' + Q (x) I3 in place, for A upper triangular with ones on its diagonal."""
    for a in range(N):
        for c in range(a + 1, N):
            factor = A[k, a, c]
            for e in range(9 * N):
                w[B + 9 * N * a + e] += factor * w[B + 9 * N * c + e]
    for b in range(N):
        for d in range(b + 1, N):
            factor = A[k, b, d]
            for a in range(N):
                for e in range(9):
                    w[B + 9 * (N * a + b) + e] += factor * w[B + 9 * (N * a + d) + e]
    _add_noise(w, Q, k)


def predict_general(w: FloatArray, A: FloatArray, Q: FloatArray, k: int) -> None:
    """P = F P F' + Q (x) I3, for any A."""
    for a in range(N):
        for e in range(9 * N):
            total = 0.0
            for c in range(N):
                total += A[k, a, c] * w[B + 9 * N * c + e]
            w[FB + 9 * N * a + e] = total
    for a in range(N):
        for b in range(N):
            for e in range(9):
                total = 0.0
                for d in range(N):
                    total += A[k, b, d] * w[FB + 9 * (N * a + d) + e]
                w[B + 9 * (N * a + b) + e] = total
    _add_noise(w, Q, k)


def _add_noise(w: FloatArray, Q: FloatArray, k: int) -> None:
    for a in range(N):
        for b in range(N):
            noise = Q[k, a, b]
            for i in range(3):
                w[B + 9 * (N * a + b) + 4 * i] += noise
