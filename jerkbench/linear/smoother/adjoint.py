"""The adjoint: it lies in the array of a run, lambda in the place of x and Lambda in that of P."""

from jerkbench.compilation.views import Run, View, room, wide_room
from jerkbench.kinematic.predict import mirror


def absorb(a: Run, tape: Run, states: int) -> None:
    """Take the adjoint to before the update that stands in a row of the tape.

    ``states`` is their number, which as a constant would make the compiler unroll the loops.
    """
    for r in range(6):  # Lambda (I - K H)
        for s in range(states):
            total = a.P[s, 0] * tape.left[r, 0]
            for t in range(1, a.s):
                total += a.P[s, t] * tape.left[r, t]
            a.G[r, s] = total
    _absorb_vector(a, tape)
    for r in range(6):  # (I - K H)' Lambda (I - K H) + H' S^-1 H
        for c in range(r + 1):
            total = tape.inverse[r, c]
            for s in range(a.s):
                total += tape.left[r, s] * a.G[c, s]
            a.P[r, c] = total
        for s in range(6, states):
            a.P[s, r] = a.G[r, s]
    mirror(a)


def _absorb_vector(a: Run, tape: Run) -> None:
    """Make lambda = (I - K H)' lambda - H' S^-1 y."""
    moved = room(a, "6")
    for r in range(6):
        moved[r] = tape.left[r, 0] * a.x[0] - tape.weighed[r]
        for s in range(1, a.s):
            moved[r] += tape.left[r, s] * a.x[s]
    for r in range(6):
        a.x[r] = moved[r]


def retreat(a: Run, model: View) -> None:
    """Take the adjoint to before a step: A' lambda and A' Lambda A, A upper triangular with ones on its diagonal."""
    A = room(a, "n n")
    for q in range(a.n):
        for c in range(a.n):
            A[q, c] = model[q, c]
    for i in range(3):
        for q in range(a.n - 1, 0, -1):
            for c in range(q):
                a.x[3 * q + i] += A[c, q] * a.x[3 * c + i]
    if a.width == 1:
        _retreat_pairs(a, A)
    else:
        for i in range(3):
            for j in range(i, 3):
                _retreat_pair(a, A, i, j)


def _retreat_pairs(a: Run, A: View) -> None:
    """All pairs of axes of one run at once."""
    M = wide_room(a, "n n")
    for r in range(a.n):
        for c in range(a.n):
            M[r, c] = a.pairs[r, c]
    _transform(M, A, a.n)
    for r in range(a.n):
        for c in range(a.n):
            a.pairs[r, c] = M[r, c]


def _retreat_pair(a: Run, A: View, i: int, j: int) -> None:
    M = room(a, "n n")
    for r in range(a.n):
        for c in range(a.n):
            M[r, c] = a.P[3 * r + i, 3 * c + j]
    _transform(M, A, a.n)
    for r in range(a.n):
        for c in range(r if i == j else 0, a.n):
            a.P[3 * r + i, 3 * c + j] = M[r, c]


def _transform(M: View, A: View, n: int) -> None:
    """M = A' M A, A upper triangular with ones on its diagonal: rows from below, then columns from the right."""
    for r in range(n - 1, 0, -1):
        for c in range(n):
            for j in range(r):
                M[r, c] += A[j, r] * M[j, c]
    for c in range(n - 1, 0, -1):
        for r in range(n):
            for j in range(c):
                M[r, c] += A[j, c] * M[r, j]
