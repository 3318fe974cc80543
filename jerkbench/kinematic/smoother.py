"""The compiled fixed-interval smoother of a kinematic filter, with adjoint variables.

The forward pass runs the Kalman filter. The backward pass is Bierman's form of the Rauch-Tung-Striebel smoother. The
backward pass propagates an adjoint vector lambda (s,) and an adjoint matrix Lambda (s, s), where s is the number of
states. The adjoint variables are zero at the end of the run. The following equations compute the smoothed xs and Ps
from the filtered x and P::

    xs = x - P lambda,                              Ps = P - P Lambda P
    over an update, C = I - K H:
    lambda = C' lambda - H' S^-1 y,                 Lambda = C' Lambda C + H' S^-1 H
    over a step:
    lambda = F' lambda,                             Lambda = F' Lambda F

The smoother inverts only the innovation covariance S, whose factors are known from the forward pass. If the adaptation
multiplies P by a fading factor before an update, the effect on the smoother is the same as of a larger Q in the step
before this update.

The forward pass stores its state in a buffer, the tape, after each update, and after every `SEGMENT` steps without an
update. The backward pass computes the states between two rows of the tape again by prediction.

Source: G. J. Bierman, "Fixed interval smoothing with discrete measurements", International Journal of Control 18(1),
1973, doi:10.1080/00207177308932487.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, FloatCube, FloatStack, IntVector
from jerkbench.compilation.compiled import Compilation, not_inlined
from jerkbench.compilation.vectors import aligned_zeros, in_lanes
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate, Streamed
from jerkbench.kinematic.arguments import (
    Called,
    Model,
    Output,
    Rules,
    Runs,
    Scoring,
    Steps,
    copy_matrix,
    loop_type,
    read_matrix,
    record_layout,
)
from jerkbench.kinematic.loop import all_stopped, give, note_update, predict, predict_covariance, predict_state
from jerkbench.kinematic.rules import Rule
from jerkbench.kinematic.runs import Pack, Prepared, run_packs, run_trajectory, states_on_axis
from jerkbench.kinematic.update import fill_innovation, solve_back, update
from jerkbench.timeline import Run, Timeline

SEGMENT = 32
"""Maximum number of steps between two successive rows of the tape."""


class Tape(NamedTuple):
    """The model of the filter, and buffers in which the forward pass stores the filtered states for the backward pass.

    Attributes:
        model: model of the filter.
        step: (rows,) index of the step after which each row of the tape was written, or -1 for the initial state.
        x: (rows, s, 8) filtered states.
        P: (rows, s, s, 8) covariances of ``x``.
        left: (rows, 6, s, 8) first six columns of I - K H, transposed.
        solved: (rows, 6, 7, 8) weighted innovation S^-1 y, followed by the inverse S^-1 of the innovation covariance,
            with zeros for measurement rows that are not used.
        between_x: (SEGMENT, s, 8) states after each step from one row of the tape to the next row.
        between_P: (SEGMENT, s, s, 8) covariances of ``between_x``.
    """

    model: Model
    step: IntVector
    x: FloatCube
    P: FloatStack
    left: FloatStack
    solved: FloatStack
    between_x: FloatCube
    between_P: FloatStack


def _layout(n: int) -> np.dtype[Any]:
    """Return the `record_layout` of the filter, with fields for lambda and Lambda and two fields of zeros."""
    s = 3 * n
    return record_layout(n, s, (("adjoint_x", (s,)), ("adjoint_P", (s, s)), ("none", (6,)), ("no_Q", (n, n))))


def run_smoother(
    steps: Steps, scored: Scoring, tape: Tape, rules: Rules, adapt: Called, gain: Called, output: Output, state: Runs
) -> None:
    """Run the forward and the backward pass of eight runs. If all runs stop early, the backward pass is skipped.

    The arguments are the same as in `jerkbench.kinematic.loop.run_steps`, with ``tape`` instead of ``model``.
    """
    run, x, P = in_lanes(state), in_lanes(tape.x), in_lanes(tape.P)
    left, solved = in_lanes(tape.left), in_lanes(tape.solved)
    tape.step[0] = -1
    last = tape.step[0] + 1  # 0, but with the integer type of ``step``, because a literal has another type
    _copy(run.x, run.P, x[0], P[0])
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            predict(run, run.x, run.P, steps, tape.model, k)
        which = steps.update[k]
        if which >= 0:
            fill_innovation(run, steps.z, which)
            update(run, steps, rules, adapt, gain, which)
            note_update(run, scored.counts, output, which)
            if all_stopped(run, k):
                return
        if which >= 0 or k - tape.step[last] == SEGMENT or k == len(steps.model) - 1:
            last += 1
            tape.step[last] = k
            _copy(run.x, run.P, x[last], P[last])
            if which >= 0:
                _write_update(run, left[last], solved[last])
    _run_backward(run, steps, scored, tape, output, last)


def _copy(x: FloatArray, P: FloatArray, into_x: FloatArray, into_P: FloatArray) -> None:
    for s in range(len(into_x)):
        into_x[s] = x[s]
    copy_matrix(P, into_P)


@not_inlined
def _write_update(run: Runs, left: FloatArray, solved: FloatArray) -> None:
    """Write I - K H, S^-1 y and S^-1 of the last update to the tape.

    Column a of ``run.gain`` is column a of K' = S^-1 H P. If state a is measured and its variance in R is smaller than
    in P, column a of ``run.gain`` is -S^-1 R = K' - I (see `jerkbench.kinematic.update`).
    """
    M, Z = run.M, run.gain
    solve_back(M, Z, 7, len(run.x))
    for r in range(6):
        for a in range(len(run.x)):
            left[r, a] = (1.0 - run.fine[r] if r == a else 0.0) - Z[r, a]
        for c in range(6):  # the columns of M that contain G are overwritten with L^-1
            M[r, 7 + c] = run.used[r] if r == c else 0.0
            for j in range(r):
                M[r, 7 + c] -= M[j, r] / M[j, j] * M[j, 7 + c]
    solve_back(M, solved, 6, 7)


@not_inlined
def _run_backward(run: Runs, steps: Steps, scored: Scoring, tape: Tape, output: Output, rows: int) -> None:
    """Run the backward pass from the last row of the tape, which has the index ``rows``, to row 0."""
    x, P, between_x, between_P = in_lanes(tape.x), in_lanes(tape.P), in_lanes(tape.between_x), in_lanes(tape.between_P)
    left, solved = in_lanes(tape.left), in_lanes(tape.solved)
    for row in range(rows, 0, -1):
        first, last = tape.step[row - 1], tape.step[row]
        _copy(x[row - 1], P[row - 1], run.x, run.P)
        for k in range(first + 1, last):
            if steps.model[k] >= 0:
                predict(run, run.x, run.P, steps, tape.model, k)
            _copy(run.x, run.P, between_x[k - first - 1], between_P[k - first - 1])
        _copy(x[row], P[row], between_x[last - first - 1], between_P[last - first - 1])
        for k in range(last, first, -1):
            if steps.reference[k] >= 0:
                _smooth(run, between_x[k - first - 1], between_P[k - first - 1])
                give(run, run.P, scored, output, steps.reference[k])
            if k == last and steps.update[k] >= 0:
                _absorb(run, left[row], solved[row])
            if steps.model[k] >= 0:
                _step_back(run, tape.model.A, steps.model[k])


@not_inlined
def _smooth(run: Runs, x: FloatArray, P: FloatArray) -> None:
    """Compute the smoothed position and velocity, x - P lambda, and their covariance, P - P Lambda P."""
    adjoint, Adjoint, weighted, s = run.adjoint_x, run.adjoint_P, run.before, len(x)
    for a in range(6):
        moved = P[a, 0] * adjoint[0]
        for t in range(1, s):
            moved += P[a, t] * adjoint[t]
        run.x[a] = x[a] - moved
    for a in range(6):
        for r in range(s):  # Lambda P
            total = Adjoint[r, 0] * P[a, 0]
            for t in range(1, s):
                total += Adjoint[r, t] * P[a, t]
            weighted[r] = total
        for r in range(a + 1):
            total = P[r, 0] * weighted[0]
            for t in range(1, s):
                total += P[r, t] * weighted[t]
            run.P[a, r] = run.P[r, a] = P[r, a] - total


@not_inlined
def _absorb(run: Runs, left: FloatArray, solved: FloatArray) -> None:
    """Propagate the adjoint variables backwards over a measurement update."""
    x, P, Z, moved, s = run.adjoint_x, run.adjoint_P, run.gain, run.D, len(run.x)
    for r in range(6):  # compute Lambda (I - K H)
        for a in range(s):
            total = P[a, 0] * left[r, 0]
            for t in range(1, s):
                total += P[a, t] * left[r, t]
            Z[r, a] = total
    for r in range(6):  # compute (I - K H)' lambda - H' S^-1 y
        total = left[r, 0] * x[0] - solved[r, 0]
        for a in range(1, s):
            total += left[r, a] * x[a]
        moved[r] = total
    for r in range(6):  # compute (I - K H)' Lambda (I - K H) + H' S^-1 H
        x[r] = moved[r]
        for c in range(r + 1):
            total = solved[r, 1 + c]
            for a in range(s):
                total += left[r, a] * Z[c, a]
            P[r, c] = P[c, r] = total
        for a in range(6, s):
            P[a, r] = P[r, a] = Z[r, a]


@not_inlined
def _step_back(run: Runs, A: FloatArray, length: int) -> None:
    """Propagate the adjoint variables backwards over a time step.

    The backward step is equivalent to a prediction with the transition matrix A' and without process noise.
    """
    n = len(run.A_step)
    read_matrix(A, length, run.A_step)
    for a in range(n):
        for b in range(n):
            run.Q_step[a, b] = run.A_step[b, a]
    predict_state(run.adjoint_x, run.Q_step, run.none, run.none, run.e)
    predict_covariance(run.adjoint_P, run.Q_step, run.no_Q, run.square)


# Python functions that run the compiled smoother.


@cache
def smoother_for(n: int) -> Compilation:
    """Return the compiled smoother for filters with ``n`` states per axis."""
    return Compilation(run_smoother, f"the smoother ({3 * n} states)", loop_type(_layout(n), Tape), contract=True)


def smooth_one(timeline: Timeline, model: Filter, rule: Rule) -> Estimate | None:
    """Return the smoothed trajectory of one run, or None if the adaptation raises an error.

    If the forward pass diverges, only the steps before the divergence are smoothed.
    """
    estimate, record = run_trajectory(timeline, rule, partial(_prepared, [model]))
    if estimate is None or not estimate.failure:
        return estimate
    end = int(record["ended"][0, 0])
    steps = {name: getattr(timeline, name)[:end] for name in ("t_s", "dt_s", "sample", "update", "reference")}
    again, _ = run_trajectory(replace(timeline, **steps), rule, partial(_prepared, [model]))
    return None if again is None else replace(again, updates=estimate.updates, failure=estimate.failure)


def smooth_many(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule | None], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Return the error sums of each smoothed run of a batch.

    The result is None for a run without a compiled adaptation, that diverged, or whose adaptation raised an error. The
    caller must repeat such a run alone.
    """
    states = [3 * states_on_axis(model) for model in models]
    return run_packs(runs, states, rules, partial(_prepared, models), updates=updates, threads=threads)


def _prepared(models: Sequence[Filter], pack: Pack) -> Prepared:
    """Return the smoother, its `record_layout`, its empty `Tape`, and the initial states."""
    (model, initial), update = pack.kinematic(models), pack.steps.update
    n = model.A.shape[1]
    s, rows = 3 * n, 3 + len(update) // SEGMENT + int(np.count_nonzero(update >= 0))
    shapes = ((rows, s), (rows, s, s), (rows, 6, s), (rows, 6, 7), (SEGMENT, s), (SEGMENT, s, s))
    tape = Tape(model, np.empty(rows, dtype=np.int64), *(aligned_zeros(*shape, WIDE) for shape in shapes))
    return smoother_for(n), _layout(n), tape, initial
