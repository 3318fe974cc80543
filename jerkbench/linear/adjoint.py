"""The adjoint: it lies in the array of a run, lambda in the place of x and Lambda in that of P."""

from functools import cache

from jerkbench.compilation.vectors import WIDE, chosen
from jerkbench.compilation.views import Lanes, View, copy, eights, room, wide_room
from jerkbench.kinematic.arguments import with_covariance
from jerkbench.kinematic.predict import mirror


def absorb(a: Lanes, tape: Lanes, states: int) -> None:
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


def _absorb_vector(a: Lanes, tape: Lanes) -> None:
    """Make lambda = (I - K H)' lambda - H' S^-1 y."""
    moved = room(a, "6")
    for r in range(6):
        moved[r] = tape.left[r, 0] * a.x[0] - tape.weighed[r]
        for s in range(1, a.s):
            moved[r] += tape.left[r, s] * a.x[s]
    for r in range(6):
        a.x[r] = moved[r]


def retreat(a: Lanes, model: View) -> None:
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


def _retreat_pairs(a: Lanes, A: View) -> None:
    """All pairs of axes of one run at once."""
    M = wide_room(a, "n n")
    for r in range(a.n):
        for c in range(a.n):
            M[r, c] = a.pairs[r, c]
    _transform(M, A, a.n)
    for r in range(a.n):
        for c in range(a.n):
            a.pairs[r, c] = M[r, c]


def _retreat_pair(a: Lanes, A: View, i: int, j: int) -> None:
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


# The smoothed position and velocity from filtered state and adjoint: x - P lambda, P - P Lambda P.


def smooth(run: Lanes, filtered: Lanes, a: Lanes) -> None:
    """Put them into ``run``."""
    weighed = room(run, "s")
    for s in range(6):
        moved = filtered.P[s, 0] * a.x[0]
        for t in range(1, run.s):
            moved += filtered.P[s, t] * a.x[t]
        run.x[s] = filtered.x[s] - moved
    for s in range(6):
        for r in range(run.s):  # Lambda P, column s
            total = a.P[r, 0] * filtered.P[s, 0]
            for t in range(1, run.s):
                total += a.P[r, t] * filtered.P[s, t]
            weighed[r] = total
        for r in range(s + 1):
            total = filtered.P[r, 0] * weighed[0]
            for t in range(1, run.s):
                total += filtered.P[r, t] * weighed[t]
            run.P[s, r] = filtered.P[s, r] - total


def smooth_alone(x: View, P: View, filtered: Lanes, a: Lanes) -> None:
    """Put them into a row of a trajectory: the same of one run, six columns at a time."""
    columns, weighed = room(filtered, "s 8"), wide_room(filtered, "s")
    copy(columns, filtered.P_six)
    prior = eights(columns)
    for r in range(filtered.s):  # Lambda P
        total = a.P[r, 0] * prior[0]
        for t in range(1, filtered.s):
            total += a.P[r, t] * prior[t]
        weighed[r] = total
    moved = a.x[0] * prior[0]
    for t in range(1, filtered.s):
        moved += a.x[t] * prior[t]
    six = room(filtered, "8")
    eights(six)[0] = moved
    for s in range(6):
        x[s] = filtered.x[s] - six[s]
    for s in range(6):
        left = prior[s]
        for t in range(filtered.s):
            left -= filtered.P[s, t] * weighed[t]
        eights(six)[0] = left
        for t in range(6):
            P[s, t] = six[t]


# The tape: filtered states, and what each update made of them.


def copy_state(into: Lanes, given: Lanes) -> None:
    """Copy the filtered state, from a run to a row of the tape or back."""
    for a in range(given.n):
        for b in range(given.n):
            if given.width == 1:
                into.pairs[a, b] = given.pairs[a, b]
            else:
                for p in range(6):
                    into.block[p, a, b] = given.block[p, a, b]
    for s in range(given.s):
        into.x[s] = given.x[s]


def write_update(tape: Lanes, run: Lanes) -> None:
    """Write I - K H, S^-1 and S^-1 y of the update that ``run`` has just seen.

    Column s of K' = S^-1 H P lies in Z; of a measured state whose R is the finer, it is that of S^-1 R, which is what
    is left of one (see `jerkbench.kinematic.correction`).
    """
    for r in range(6):
        for s in range(run.s):
            rest = (1.0 if r == s else 0.0) - run.Z[r, s]
            if s < 6:
                rest = chosen(run.fine[s], 0.0, run.Z[r, s], rest)
            tape.left[r, s] = rest
        tape.weighed[r] = run.v[r]
    _write_inverse(tape, run)


def _write_inverse(tape: Lanes, run: Lanes) -> None:
    """S^-1 = L^-1' D^-1 L^-1 from the factors of S; 0 where a row is not used."""
    inner = room(run, "6 6")  # L^-1
    for c in range(6):
        inner[c, c] = run.used[c]
        for r in range(c + 1, 6):
            rest = 0.0 - run.L[r, c] * inner[c, c]
            for j in range(c + 1, r):
                rest -= run.L[r, j] * inner[j, c]
            inner[r, c] = rest
    for i in range(6):
        for j in range(i + 1):
            total = inner[i, i] * run.over_D[i] * inner[i, j]
            for r in range(i + 1, 6):
                total += inner[r, i] * run.over_D[r] * inner[r, j]
            tape.inverse[i, j] = total


# The parts of a row of the tape.

SEGMENT = 32
"""Most steps from one row of the tape to the next."""


@cache
def tape_type(n: int, width: int) -> Lanes:
    """Return the type of a row, for ``width`` runs of a filter with ``n`` quantities on each axis."""
    s = 3 * n
    shapes = {
        "x": (s,),  # filtered state
        "left": (6, s),  # the first six columns of I - K H, one after the other
        "inverse": (6, 6),  # of S, its lower half
        "weighed": (6,),  # S^-1 y
    }
    return with_covariance(shapes, s, width)


ROW = tape_type(3, WIDE)
"""The type at hand: a compilation replaces it."""
