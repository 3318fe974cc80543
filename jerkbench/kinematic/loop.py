"""The compiled loop of kinematic filters, which processes the time steps of eight runs."""

from functools import cache

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import Compilation
from jerkbench.compilation.vectors import anywhere, in_lanes, select
from jerkbench.kinematic.arguments import Called, Model, Output, Rules, Runs, Scoring, Steps, loop_type, record_layout
from jerkbench.kinematic.prediction import Axis, compose, predict_covariance, predict_state, read_step
from jerkbench.kinematic.scoring import give, note_update
from jerkbench.kinematic.update import fill_innovation, rows_used, update


def run_steps(
    axis: Axis,
    steps: Steps,
    scored: Scoring,
    model: Model,
    rules: Rules,
    adapt: Called,
    gain: Called,
    output: Output,
    state: Runs,
) -> None:
    """Process all time steps of eight runs. The loop ends early if all runs have stopped.

    The state is predicted in each step. The covariance is predicted only before an update, with A and Q of all steps
    since the last update. If a metric or a trajectory needs the covariance at another time, a copy of the covariance
    (``shown``) is predicted to this time. Therefore the results of a run do not depend on the requested metrics.

    Args:
        axis: tuple whose length is the number of states per axis. The values in the tuple have no meaning.
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
            predict_state(run.x, run.A_step, run.b_step, run.u, run.e, axis)
            compose(run, axis)
        which, reference = steps.update[k], steps.reference[k]
        if which >= 0:
            fill_innovation(run, steps.z, which)
            _take_due(run)
            predict_covariance(run.P, run.A, run.Q, run.square, axis)
            update(run, steps, rules, adapt, gain, which)
            note_update(run, scored.counts, output, which)
            if all_stopped(run, k):
                return
        if reference >= 0:
            if len(output.states) > 0 or scored.consistency:
                _copy(run.P, run.shown)
                predict_covariance(run.shown, run.A_total, run.Q_total, run.square, axis)
            give(run, run.shown, scored, output, reference)


def all_stopped(run: Runs, k: int) -> bool:
    """Store ``k`` as the last step of each run that stops at this step, and return whether all runs have stopped."""
    stopped = select(run.stopped[0], 0.0, 1.0, 0.0)
    run.ended[0] = select(stopped * (-0.5 - run.ended[0]), 0.0, float(k), run.ended[0])
    return not anywhere(1.0 - stopped)


def _copy(given: FloatArray, into: FloatArray) -> None:
    for a in range(len(given)):
        for b in range(len(given)):
            into[a, b] = given[a, b]


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
