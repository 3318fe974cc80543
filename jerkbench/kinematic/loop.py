"""The compiled loop of kinematic filters over the time steps of eight runs: prediction, and sums of the errors.

The transition matrix F is the Kronecker product of A with I3, so the same product with A is computed for each axis of x
and for each pair of axes of P. The errors against the reference are added up during the runs.
"""

from functools import cache

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import Compilation, not_inlined
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
from jerkbench.kinematic.arguments import (
    NIS_OF_USED,
    ROWS_USED,
    SEEN_NIS,
    SEEN_ROWS,
    Called,
    Model,
    Output,
    Rules,
    Runs,
    Scoring,
    Steps,
    copy_matrix,
    loop_type,
    read,
    read_matrix,
    record_layout,
)
from jerkbench.kinematic.update import eliminate, fill_innovation, rows_used, update


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


# The prediction.


def predict_state(x: FloatArray, A: FloatArray, b: FloatArray, u: FloatArray, old: FloatArray) -> None:
    """Compute x = A x + b u for each of the three axes, where ``old`` is a buffer."""
    for i in range(3):
        for a in range(len(A)):
            old[a] = x[3 * a + i]
        for a in range(len(A)):
            moved = b[a] * u[i]
            for c in range(len(A)):
                moved += A[a, c] * old[c]
            x[3 * a + i] = moved


@not_inlined
def predict_covariance(P: FloatArray, A: FloatArray, Q: FloatArray, AP: FloatArray) -> None:
    """Compute the predicted covariance P = F P F' + Q (x) I3, where ``AP`` is a buffer."""
    for i in range(3):
        for j in range(i, 3):
            _predict_pair(P, A, Q, AP, i, j)


def _predict_pair(P: FloatArray, A: FloatArray, Q: FloatArray, AP: FloatArray, i: int, j: int) -> None:
    """Predict the covariance between axis i and axis j, and the transposed block."""
    n = len(A)
    for a in range(n):
        for c in range(n):
            product = A[a, 0] * P[i, 3 * c + j]
            for d in range(1, n):
                product += A[a, d] * P[3 * d + i, 3 * c + j]
            AP[a, c] = product
    for a in range(n):
        for c in range(a if i == j else 0, n):
            product = AP[a, 0] * A[c, 0]
            for d in range(1, n):
                product += AP[a, d] * A[c, d]
            if i == j:
                product += Q[a, c]
            P[3 * a + i, 3 * c + j] = P[3 * c + j, 3 * a + i] = product


def read_step(run: Runs, steps: Steps, model: Model, k: int) -> None:
    """Copy the values of step ``k`` to ``run``: the filter input u, and A, b and Q of the model."""
    length = steps.model[k]
    read(steps.u, steps.sample[k], run.u)
    read_matrix(model.A, length, run.A_step)
    read(model.b, length, run.b_step)
    read_matrix(model.Q, length, run.Q_step)


@not_inlined
def predict(run: Runs, x: FloatArray, P: FloatArray, steps: Steps, model: Model, k: int) -> None:
    """Predict the state x and its covariance P over step ``k``."""
    read_step(run, steps, model, k)
    predict_state(x, run.A_step, run.b_step, run.u, run.e)
    predict_covariance(P, run.A_step, run.Q_step, run.square)


def compose(run: Runs) -> None:
    """Add a step to the transition and process noise since the last update: A_step A and A_step Q A_step' + Q_step."""
    A, Q, A_step, AA, AQ, n = run.A_total, run.Q_total, run.A_step, run.square, run.M, len(run.A_total)
    for a in range(n):
        for b in range(n):
            moved, noise = A_step[a, 0] * A[0, b], A_step[a, 0] * Q[0, b]
            for c in range(1, n):
                moved += A_step[a, c] * A[c, b]
                noise += A_step[a, c] * Q[c, b]
            AA[a, b], AQ[a, b] = moved, noise
    for a in range(n):
        for b in range(a, n):
            noise = run.Q_step[a, b]
            for c in range(n):
                noise += AQ[a, c] * A_step[b, c]
            Q[a, b] = Q[b, a] = noise
        for b in range(n):
            A[a, b] = AA[a, b]


# The loop over the steps.


def run_steps(
    steps: Steps, scored: Scoring, model: Model, rules: Rules, adapt: Called, gain: Called, output: Output, state: Runs
) -> None:
    """Process all time steps of eight runs. The loop ends early if all runs have stopped.

    The state is predicted in each step. The covariance is predicted only before an update, with A and Q of all steps
    since the last update. If a metric or a trajectory needs the covariance at another time, a copy of the covariance
    (``shown``) is predicted to this time. Therefore the results of a run do not depend on the requested metrics.

    Args:
        steps: time steps and measurements of the runs.
        scored: true values and weights for the error sums.
        model: transition matrices and process noise of the filters.
        rules: parameters and memory of the adaptations.
        adapt: compiled function that adapts R (`called_type`).
        gain: compiled function that computes the Kalman gain (`called_type`).
        output: buffers for the results.
        state: initial state and covariance of the runs, and buffers (`record_layout`).
    """
    run = in_lanes(state)
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            read_step(run, steps, model, k)
            predict_state(run.x, run.A_step, run.b_step, run.u, run.e)
            compose(run)
        which, reference = steps.update[k], steps.reference[k]
        if which >= 0:
            fill_innovation(run, steps.z, which)
            _take_due(run)
            predict_covariance(run.P, run.A, run.Q, run.square)
            update(run, steps, rules, adapt, gain, which)
            note_update(run, scored.counts, output, which)
            if all_stopped(run, k):
                return
        if reference >= 0:
            if len(output.states) > 0 or scored.consistency:
                copy_matrix(run.P, run.shown)
                predict_covariance(run.shown, run.A_total, run.Q_total, run.square)
            give(run, run.shown, scored, output, reference)


def all_stopped(run: Runs, k: int) -> bool:
    """Store ``k`` as the last step of each run that stops at this step, and return whether all runs have stopped."""
    stopped = select(run.stopped[0], 0.0, 1.0, 0.0)
    run.ended[0] = select(stopped * (-0.5 - run.ended[0]), 0.0, float(k), run.ended[0])
    return not anywhere(1.0 - stopped)


def _take_due(run: Runs) -> None:
    """For each run with a measurement, move the accumulated A and Q to ``run.A`` and ``run.Q``.

    For each run without a measurement, ``run.A`` is the identity and ``run.Q`` is zero, so that the covariance is not
    predicted yet. Therefore the result of a run does not depend on the update times of other runs.
    """
    A, Q, A_total, Q_total, due = run.A, run.Q, run.A_total, run.Q_total, rows_used(run)
    for a in range(len(A)):
        for b in range(len(A)):
            same = 1.0 if a == b else 0.0
            A[a, b], Q[a, b] = select(due, 0.0, A_total[a, b], same), select(due, 0.0, Q_total[a, b], 0.0)
            A_total[a, b], Q_total[a, b] = select(due, 0.0, same, A_total[a, b]), select(due, 0.0, 0.0, Q_total[a, b])


@cache
def loop_for(n: int) -> Compilation:
    """Return the compiled loop for filters with ``n`` states per axis."""
    signature = loop_type(record_layout(n, 3 * n), Model)
    return Compilation(run_steps, f"the filter loop ({3 * n} states)", signature, contract=True)
