"""Prediction with F = A (x) I3, A upper triangular with ones on its diagonal: the same product for each pair of axes.

The covariance between updates lies by pairs of axes: element (a, b) of the p-th matrix of (0, 0), (0, 1), (0, 2),
(1, 1), (1, 2), (2, 2) is that of quantity a on the first and quantity b on the second axis. Half of the covariance is
enough. In `transform` A and M are scratch: the compiler then knows that no two of their numbers are the same.
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


def transform(M: FloatArray, A: FloatArray) -> None:
    """M = A M A': rows from above, then columns from the left, in place."""
    for a in range(N):
        for b in range(N):
            for c in range(a + 1, N):
                M[N * a + b] += A[N * a + c] * M[N * c + b]
    for a in range(N):
        for b in range(N):
            for d in range(b + 1, N):
                M[N * a + b] += A[N * b + d] * M[N * a + d]


def transform_symmetric(M: FloatArray, A: FloatArray) -> None:
    """The same for the upper triangle of a symmetric M."""
    for a in range(N):
        for b in range(a, N):
            for c in range(a + 1, N):
                M[N * a + b] += A[N * a + c] * M[N * min(b, c) + max(b, c)]
    for a in range(N):
        for b in range(a, N):
            for d in range(b + 1, N):
                M[N * a + b] += A[N * b + d] * M[N * a + d]
