"""Prediction with F = A (x) I3: the same product for each pair of axes.

Element (a, b) of the p-th pair (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2) is the covariance of quantity a on the
first and quantity b on the second axis. Half of the covariance is enough. A, b, Q and M are scratch: the compiler then
knows that no two of their numbers are the same.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import WIDE, vectors
from jerkbench.kinematic.layout import AXES, ELEMENT, PAIR, SAME, SIZE, WIDTH, B, N, X


def predict(
    w: FloatArray,
    models: tuple[FloatArray, FloatArray, FloatArray],
    triangular: bool,
    k: int,
    u: FloatArray,
    sample: int,
) -> None:
    """Make x = F x + B u and P = F P F' + Q (x) I3.

    Args:
        w: the runs.
        models: A, b and Q of all lengths of a step: numbers, or vectors where each run has its own.
        triangular: whether A is upper triangular with ones on its diagonal.
        k: which length.
        u: the input.
        sample: which row of it.
    """
    A, b, Q = scratch(SIZE, WIDTH), scratch(N, WIDTH), scratch(SIZE, WIDTH)
    for e in range(SIZE):
        A[e], Q[e] = models[0][SIZE * k + e], models[2][SIZE * k + e]
    for a in range(N):
        b[a] = models[1][N * k + a]
    if not triangular:
        predict_any(w, A, b, Q, u, sample)
        return
    for i in range(3):
        _predict_axis(w, A, b, i, u[3 * sample + i])
    if WIDTH == 1:
        _predict_pairs(vectors(w, WIDE), A, Q)
    else:
        p = 0
        for i in range(3):
            _predict_same(w, A, Q, B + PAIR * p)
            for _ in range(i + 1, 3):
                p += 1
                _predict_apart(w, A, B + PAIR * p)
            p += 1


def _predict_axis(w: FloatArray, A: FloatArray, b: FloatArray, i: int, u: float) -> None:
    """Make x = A x + b u of axis ``i``."""
    for a in range(N):
        moved = w[X + 3 * a + i] + b[a] * u
        for c in range(a + 1, N):
            moved += A[N * a + c] * w[X + 3 * c + i]
        w[X + 3 * a + i] = moved


def _predict_pairs(w: FloatArray, A: FloatArray, Q: FloatArray) -> None:
    """All pairs of axes of one run at once."""
    M = scratch(SIZE, WIDE)
    for e in range(SIZE):
        M[e] = w[B // WIDE + e]
    _transform(M, A)
    for e in range(SIZE):
        w[B // WIDE + e] = M[e] + w[SAME // WIDE] * Q[e]


def _predict_apart(w: FloatArray, A: FloatArray, at: int) -> None:
    """The covariance of two axes."""
    M = scratch(SIZE, WIDTH)
    for e in range(SIZE):
        M[e] = w[at + e]
    _transform(M, A)
    for e in range(SIZE):
        w[at + e] = M[e]


def _predict_same(w: FloatArray, A: FloatArray, Q: FloatArray, at: int) -> None:
    """The upper triangle of the covariance of one axis."""
    M = scratch(SIZE, WIDTH)
    for a in range(N):
        for b in range(a, N):
            M[N * a + b] = w[at + N * a + b]
    _transform_symmetric(M, A)
    for a in range(N):
        for b in range(a, N):
            w[at + N * a + b] = M[N * a + b] + Q[N * a + b]


def _transform(M: FloatArray, A: FloatArray) -> None:
    """M = A M A', A upper triangular with ones on its diagonal: rows from above, then columns from the left."""
    for a in range(N):
        for b in range(N):
            for c in range(a + 1, N):
                M[N * a + b] += A[N * a + c] * M[N * c + b]
    for a in range(N):
        for b in range(N):
            for d in range(b + 1, N):
                M[N * a + b] += A[N * b + d] * M[N * a + d]


def _transform_symmetric(M: FloatArray, A: FloatArray) -> None:
    """The same for the upper triangle of a symmetric M."""
    for a in range(N):
        for b in range(a, N):
            for c in range(a + 1, N):
                M[N * a + b] += A[N * a + c] * M[N * min(b, c) + max(b, c)]
    for a in range(N):
        for b in range(a, N):
            for d in range(b + 1, N):
                M[N * a + b] += A[N * b + d] * M[N * a + d]


def predict_any(w: FloatArray, A: FloatArray, b: FloatArray, Q: FloatArray, u: FloatArray, sample: int) -> None:
    """The same for any A."""
    old, M = scratch(N, WIDTH), scratch(SIZE, WIDTH)
    for i in range(3):
        for a in range(N):
            old[a] = w[X + 3 * a + i]
        for a in range(N):
            moved = b[a] * u[3 * sample + i]
            for c in range(N):
                moved += A[N * a + c] * old[c]
            w[X + 3 * a + i] = moved
    for p in range(len(AXES)):
        same = AXES[p][0] == AXES[p][1]
        for a in range(N):
            for c in range(N):
                e = N * min(a, c) + max(a, c) if same else N * a + c
                M[N * a + c] = w[B + PAIR * p + ELEMENT * e]
        _transform_any(w, A, M, B + PAIR * p)
        if same:
            for e in range(SIZE):
                w[B + PAIR * p + ELEMENT * e] += Q[e]


def _transform_any(w: FloatArray, A: FloatArray, M: FloatArray, at: int) -> None:
    """Put A M A' at ``at``."""
    AM = scratch(SIZE, WIDTH)
    for a in range(N):
        for b in range(N):
            AM[N * a + b] = A[N * a] * M[b]
            for c in range(1, N):
                AM[N * a + b] += A[N * a + c] * M[N * c + b]
    for a in range(N):
        for b in range(N):
            total = A[N * b] * AM[N * a]
            for d in range(1, N):
                total += A[N * b + d] * AM[N * a + d]
            w[at + ELEMENT * (N * a + b)] = total
