"""Prediction with F = A (x) I3, A upper triangular with ones on its diagonal: the same product for each pair of axes.

The covariance between updates lies by pairs of axes: element (a, b) of the p-th matrix of (0, 0), (0, 1), (0, 2),
(1, 1), (1, 2), (2, 2) is that of quantity a on the first and quantity b on the second axis. Half of the covariance is
enough.
"""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.places import N, X


def predict_axis(w: FloatArray, A: FloatArray, b: FloatArray, k: int, i: int, u: float) -> None:
    """Make x = A x + b u of axis ``i`` with model ``k``."""
    for a in range(N):
        moved = w[X + 3 * a + i] + b[k, a] * u
        for c in range(a + 1, N):
            moved += A[k, a, c] * w[X + 3 * c + i]
        w[X + 3 * a + i] = moved


def predict_pair(w: FloatArray, A: FloatArray, at: int, k: int) -> None:
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
