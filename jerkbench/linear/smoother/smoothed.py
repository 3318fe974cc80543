"""The smoothed position and velocity, from the filtered state and the adjoint."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import picked, scratch
from jerkbench.compilation.vectors import WIDE, vectors_from
from jerkbench.kinematic.layout import AT, AXES, WIDTH, B, N, S, X
from jerkbench.linear.smoother.layout import STATE


def _six_of(axis: int) -> tuple[int, ...]:
    """Where a row of the covariance with position and velocity lies in four vectors of pairs, and two numbers more.

    The row is that of quantity a on ``axis``; the vectors are those of (a, 0), (a, 1), (0, a) and (1, a).
    """
    six = []
    for quantity in range(2):
        for other in range(3):
            pair = AXES.index((min(axis, other), max(axis, other)))
            six.append(WIDE * (quantity + (2 if other < axis else 0)) + pair)
    return (*six, 0, 0)


EAST_ROW, NORTH_ROW, UP_ROW = map(_six_of, range(3))


def smooth(w: FloatArray, rows: FloatArray, at: int, a: FloatArray) -> None:
    """Put x - P lambda and P - P Lambda P into ``w``, of the state from number ``at`` of ``rows`` on."""
    weighed = scratch(S, WIDTH)
    for s in range(6):
        moved = rows[at + AT[s, 0]] * a[X]
        for t in range(1, S):
            moved += rows[at + AT[s, t]] * a[X + t]
        w[X + s] = rows[at + STATE + s] - moved
    for s in range(6):
        for r in range(S):
            total = a[AT[r, 0]] * rows[at + AT[s, 0]]
            for t in range(1, S):
                total += a[AT[r, t]] * rows[at + AT[s, t]]
            weighed[r] = total
        for r in range(s + 1):
            total = rows[at + AT[r, 0]] * weighed[0]
            for t in range(1, S):
                total += rows[at + AT[r, t]] * weighed[t]
            w[AT[s, r]] = rows[at + AT[s, r]] - total


def smooth_alone(x: FloatArray, P: FloatArray, row: int, rows: FloatArray, at: int, a: FloatArray) -> None:
    """The same of one run, into row ``row`` of x (k, 6) and P (k, 36), six columns at a time."""
    prior, weighed = scratch(S, WIDE), scratch(S, WIDE)
    pairs = vectors_from(rows, at + B, WIDE)
    for q in range(N):
        first, second, third, fourth = pairs[N * q], pairs[N * q + 1], pairs[q], pairs[N + q]
        prior[3 * q] = picked(first, second, third, fourth, EAST_ROW)
        prior[3 * q + 1] = picked(first, second, third, fourth, NORTH_ROW)
        prior[3 * q + 2] = picked(first, second, third, fourth, UP_ROW)
    for r in range(S):
        total = a[AT[r, 0]] * prior[0]
        for t in range(1, S):
            total += a[AT[r, t]] * prior[t]
        weighed[r] = total
    moved = a[X] * prior[0]
    for t in range(1, S):
        moved += a[X + t] * prior[t]
    _store_state(x, 6 * row, rows, at + STATE, moved)
    for s in range(6):
        left = prior[s]
        for t in range(S):
            left -= rows[at + AT[s, t]] * weighed[t]
        _store_six(P, 36 * row + 6 * s, left)


def _store_state(x: FloatArray, into: int, rows: FloatArray, at: int, moved: FloatArray) -> None:
    six = scratch(WIDE, 1)
    vectors_from(six, 0, WIDE)[0] = vectors_from(rows, at, WIDE)[0] - moved
    for s in range(6):
        x[into + s] = six[s]


def _store_six(P: FloatArray, into: int, left: FloatArray) -> None:
    six = scratch(WIDE, 1)
    vectors_from(six, 0, WIDE)[0] = left
    for s in range(6):
        P[into + s] = six[s]
