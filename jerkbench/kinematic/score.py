"""The score of the kernel: errors against the reference, added up as a run goes."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import anywhere, chosen
from jerkbench.compilation.views import Lanes, View, ask_for, copy, room, row, taken
from jerkbench.estimate import (
    MAX_ERROR,
    NEES,
    NEES_POSITION,
    OUTAGE,
    POSITION_SQUARES,
    ROWS_LEFT,
    STRAYED,
    VELOCITY_SQUARES,
    WHOLE,
)
from jerkbench.kinematic.arguments import Kept, TruthRows

AHEAD = 48
"""So many rows before it is needed the memory is asked for it: about three microseconds."""


def keep(run: Lanes, scored: TruthRows, kept: Kept, reference: int, k: int, later: bool = False) -> None:
    """Keep, and score, the state at the ``k``-th visited stamp of the reference; P may be predicted ``later``."""
    if len(kept.x) > 0 and not later:
        kept.reference[k] = reference
        x = row(kept.x, k, run, "6")
        for s in range(6):
            x[s] = run.x[s]
        copy(row(kept.P, k, run, "6 6"), run.P_measured)
    if later:
        compare(run, run.P_scored, scored, kept.errors, k)
    elif len(scored.mark) > 0:
        compare(run, run.P_measured, scored, kept.errors, k)


def compare(run: Lanes, P: View, scored: TruthRows, errors: FloatArray, k: int) -> None:
    """Score the state with row ``k`` of the reference; P (6, 6) is the covariance of position and velocity."""
    add_errors(run, run.x, run.e, run.sums, scored, errors, k)
    if scored.consistency:
        add_nees(run, P, scored.weights[k])
        if scored.mark[k] >= 0:
            marked = row(errors, scored.mark[k], run, "marked")
            marked[3], marked[4], marked[5] = P[0, 0], P[0, 1], P[0, 2]
            marked[6], marked[7], marked[8] = P[1, 1], P[1, 2], P[2, 2]


def add_errors(run: Lanes, x: View, e: View, sums: View, scored: TruthRows, errors: FloatArray, k: int) -> None:
    """Make e = x - truth of position and velocity, add its squares to the ``sums``, and keep it where that is asked."""
    if scored.truth.shape[2] > 1:
        ask_for(row(scored.truth, k + AHEAD, run, "6"))
    truth, weights = taken(scored.truth, k, run, "6"), scored.weights[k]
    counted, whole, moving = weights[0], weights[1], weights[2]  # in the order of `arguments.WEIGHTS`
    for s in range(6):
        e[s] = x[s] - truth[s]
    for i in range(3):
        sums[POSITION_SQUARES + i] += counted * (e[i] * e[i])
    if scored.speeds:
        for i in range(3):
            sums[VELOCITY_SQUARES + i] += moving * (e[3 + i] * e[3 + i])
    square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
    sums[WHOLE] += whole * square
    if anywhere(square - scored.limit_m2):  # rows that are left, for a smoother's come the other way
        left = chosen(square, scored.limit_m2, float(len(scored.truth) - k), 0.0)
        sums[STRAYED] = chosen(left, sums[ROWS_LEFT], square, sums[STRAYED])
        sums[ROWS_LEFT] = chosen(left, sums[ROWS_LEFT], left, sums[ROWS_LEFT])
    sums[MAX_ERROR] = chosen(counted * square, sums[MAX_ERROR], square, sums[MAX_ERROR])
    if len(scored.outage) > 0:
        sums[OUTAGE] += taken(scored.outage, k, run, "1")[0] * square
    if scored.mark[k] >= 0:
        marked = row(errors, scored.mark[k], run, "marked")
        for i in range(3):
            marked[i] = e[i]


def add_nees(run: Lanes, P: View, weights: FloatArray) -> None:
    """Add e' P^-1 e of position, and of position and velocity, by elimination."""
    C, e, total = room(run, "6 6"), room(run, "6"), run.zero
    for r in range(6):
        e[r] = run.e[r]
        for c in range(r, 6):
            C[r, c] = P[r, c]
    for c in range(6):
        pivot = C[c, c]
        run.lost += chosen(pivot, 0.0, 0.0, 1.0)
        scale = 1.0 / pivot
        scaled = e[c] * scale
        total += e[c] * scaled
        for r in range(c + 1, 6):
            e[r] -= C[c, r] * scaled
            factor = C[c, r] * scale
            for j in range(r, 6):
                C[r, j] -= factor * C[c, j]
        if c == 2:
            run.sums[NEES_POSITION] += weights[0] * total
    run.sums[NEES] += weights[3] * total
