"""The adjoint: it lies in an array of the kernel's layout, lambda in the place of x and Lambda in that of P."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import WIDE, vectors
from jerkbench.kinematic.correction import mirror
from jerkbench.kinematic.layout import AT, AXES, PAIR, SIZE, WIDTH, B, N, S, W, X
from jerkbench.linear.smoother.layout import INVERSE, LEFT, WEIGHED


def absorb(a: FloatArray, rows: FloatArray, at: int, columns: int) -> None:
    """Take the adjoint to before the update that stands from number ``at`` of ``rows`` on.

    ``columns`` is the number of states, which as a constant would make the compiler unroll the loops.
    """
    left = at + LEFT
    for r in range(6):
        for s in range(columns):
            total = a[AT[s, 0]] * rows[left + S * r]
            for t in range(1, S):
                total += a[AT[s, t]] * rows[left + S * r + t]
            a[W + S * r + s] = total  # Lambda (I - K H)
    _absorb_vector(a, rows, at)
    for r in range(6):
        for c in range(r + 1):
            total = rows[at + INVERSE + r * (r + 1) // 2 + c]
            for s in range(S):
                total += rows[left + S * r + s] * a[W + S * c + s]
            a[AT[r, c]] = total
        for s in range(6, columns):
            a[AT[s, r]] = a[W + S * r + s]
    if WIDTH == 1:
        mirror(a)


def _absorb_vector(a: FloatArray, rows: FloatArray, at: int) -> None:
    moved = scratch(6, WIDTH)
    for r in range(6):
        moved[r] = rows[at + LEFT + S * r] * a[X] - rows[at + WEIGHED + r]
        for s in range(1, S):
            moved[r] += rows[at + LEFT + S * r + s] * a[X + s]
    for r in range(6):
        a[X + r] = moved[r]


def retreat(a: FloatArray, models: FloatArray, k: int) -> None:
    """Take the adjoint to before a step of length number ``k``: A' lambda and A' Lambda A, A with ones on its diagonal.

    ``models`` is A of all lengths, upper triangular.
    """
    A = scratch(SIZE, WIDTH)
    for e in range(SIZE):
        A[e] = models[SIZE * k + e]
    for i in range(3):
        for q in range(N - 1, 0, -1):
            for c in range(q):
                a[X + 3 * q + i] += A[N * c + q] * a[X + 3 * c + i]
    if WIDTH == 1:
        _retreat_pairs(vectors(a, WIDE), A)
    else:
        for p in range(len(AXES)):
            _retreat_pair(a, A, B + PAIR * p, AXES[p][0] == AXES[p][1])


def _retreat_pairs(a: FloatArray, A: FloatArray) -> None:
    """All pairs of axes of one run at once."""
    L = scratch(SIZE, WIDE)
    for e in range(SIZE):
        L[e] = a[B // WIDE + e]
    _transform(L, A)
    for e in range(SIZE):
        a[B // WIDE + e] = L[e]


def _retreat_pair(a: FloatArray, A: FloatArray, at: int, same: bool) -> None:
    """One pair; of an axis with itself the upper half is kept."""
    L = scratch(SIZE, WIDTH)
    for r in range(N):
        for c in range(N):
            L[N * r + c] = a[at + N * min(r, c) + max(r, c)] if same else a[at + N * r + c]
    _transform(L, A)
    for e in range(SIZE):
        a[at + e] = L[e]


def _transform(L: FloatArray, A: FloatArray) -> None:
    """L = A' L A, A upper triangular with ones on its diagonal: rows from below, then columns from the right."""
    for r in range(N - 1, 0, -1):
        for c in range(N):
            for j in range(r):
                L[N * r + c] += A[N * j + r] * L[N * j + c]
    for c in range(N - 1, 0, -1):
        for r in range(N):
            for j in range(c):
                L[N * r + c] += A[N * j + c] * L[N * r + j]
