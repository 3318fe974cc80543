"""Errors of the compiled runs against the reference, summed during the runs."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import not_inlined
from jerkbench.compilation.vectors import anywhere, as_numbers, in_lanes, select
from jerkbench.estimate import (
    DIVERGED,
    MAX_ERROR,
    NEES,
    NEES_POSITION,
    NIS,
    NIS_USED,
    OUTAGE,
    POSITION_SQUARES,
    ROWS_LEFT,
    UPDATES,
    UPDATES_USED,
    VELOCITY_SQUARES,
    WITH_BURN_IN,
)
from jerkbench.kinematic.arguments import NIS_OF_USED, ROWS_USED, SEEN_NIS, SEEN_ROWS, Output, Runs, Scoring, read
from jerkbench.kinematic.update import eliminate


def give(run: Runs, P: FloatArray, scored: Scoring, output: Output, k: int) -> None:
    """Store the state ``run.x`` and its covariance P at time stamp ``k`` of the reference, and add up the errors."""
    if len(output.states) > 0:
        state, covariance = as_numbers(run.x), as_numbers(P)
        for r in range(6):
            output.states[k, r] = state[r, 0]
            for c in range(6):
                output.covariances[k, r, c] = covariance[r, c, 0]
    if len(scored.mark) > 0:
        _add_errors(run, scored, k)
        if scored.consistency:
            _add_consistency(run, P, scored.weights[k, 0], scored.weights[k, 3])
        if scored.mark[k] >= 0:
            _mark(run, P, in_lanes(output.errors)[scored.mark[k]], scored.consistency)


def _add_errors(run: Runs, scored: Scoring, k: int) -> None:
    """Compute the errors of position and velocity, and add their weighted squares to the error sums."""
    e, sums, weights = run.e, run.sums, scored.weights[k]
    read(scored.truth, k, e)
    for r in range(6):
        e[r] = run.x[r] - e[r]
    for i in range(3):
        sums[POSITION_SQUARES + i] += weights[0] * (e[i] * e[i])
    if scored.speeds:
        for i in range(3):
            sums[VELOCITY_SQUARES + i] += weights[2] * (e[3 + i] * e[3 + i])
    square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
    sums[WITH_BURN_IN] += weights[1] * square
    sums[MAX_ERROR] = select(weights[0] * square, sums[MAX_ERROR], square, sums[MAX_ERROR])
    if anywhere(square - scored.limit_m2):  # at the first divergence, the number of remaining rows is the largest
        left = select(square, scored.limit_m2, float(len(scored.weights) - k), 0.0)
        sums[DIVERGED] = select(left, sums[ROWS_LEFT], square, sums[DIVERGED])
        sums[ROWS_LEFT] = select(left, sums[ROWS_LEFT], left, sums[ROWS_LEFT])
    if len(scored.outage) > 0:
        read(scored.outage, k, run.one)
        sums[OUTAGE] += run.one[0] * square


@not_inlined
def _add_consistency(run: Runs, P: FloatArray, of_position: float, of_both: float) -> None:
    """Add the weighted NEES e' P^-1 e of position, and of position and velocity, to the sums of each run."""
    M, stopped = run.M, run.stopped[0]
    total = stopped * 0.0
    for r in range(6):
        M[r, 6] = run.e[r]
        for c in range(r, 6):
            M[r, c] = P[r, c]
    for r in range(6):
        stopped += select(M[r, r], 0.0, 0.0, 1.0)
        total += M[r, 6] * M[r, 6] * eliminate(M, r, 6, 7)
        if r == 2:
            run.sums[NEES_POSITION] += of_position * total
    run.sums[NEES] += of_both * total
    run.stopped[0] = stopped


def _mark(run: Runs, P: FloatArray, marked: FloatArray, consistency: bool) -> None:
    """Store the position error and the upper triangle of its covariance in ``marked``, a row of `Output.errors`."""
    for i in range(3):
        marked[i] = run.e[i]
    if consistency:
        index = 3
        for r in range(3):
            for c in range(r, 3):
                marked[index] = P[r, c]
                index += 1


@not_inlined
def note_update(run: Runs, counts: FloatArray, output: Output, which: int) -> None:
    """Store the values of an update in `Output.seen`, and add the NIS per measurement row to the sums."""
    seen, sums = run.seen, run.sums
    if len(output.seen) > 0:
        stored = in_lanes(output.seen)
        for e in range(len(seen)):
            stored[which, e] = seen[e]
    if len(counts) > 0:
        read(counts, which, run.one)
        rows, used_rows, weight = seen[SEEN_ROWS], seen[ROWS_USED], run.one[0]
        sums[NIS] += select(rows, 0.0, weight * seen[SEEN_NIS] / rows, 0.0)
        sums[UPDATES] += select(rows, 0.0, weight, 0.0)
        sums[NIS_USED] += select(used_rows, 0.0, weight * seen[NIS_OF_USED] / used_rows, 0.0)
        sums[UPDATES_USED] += select(used_rows, 0.0, weight, 0.0)
