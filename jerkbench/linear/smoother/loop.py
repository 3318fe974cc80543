"""The loops of the smoother: the steps of a timeline forward, and back."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import vectors
from jerkbench.kinematic.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.kinematic.layout import WIDTH
from jerkbench.kinematic.loop import all_lost, mark_axes, start
from jerkbench.kinematic.predict import predict
from jerkbench.kinematic.score import compare
from jerkbench.kinematic.update_step import update
from jerkbench.linear.smoother.adjoint import absorb, retreat
from jerkbench.linear.smoother.arguments import Tape
from jerkbench.linear.smoother.layout import FILTERED, ROW, SEGMENT
from jerkbench.linear.smoother.smoothed import smooth, smooth_alone
from jerkbench.linear.smoother.tape import read_state, write_state, write_update


def run_smoother(
    steps: Steps, score: Score, model: Model, rules: Rules, kept: Kept, runs: Runs, tape: Tape
) -> tuple[int, int]:
    """Run all steps forward and back; only forward where the last run is lost on the way.

    Arguments are those of `jerkbench.kinematic.loop.run_steps`, and ``tape``.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    columns = 3 * (2 + len(model.extra))
    rows, states, updates = run_forward(steps, score, model, rules, kept, runs, tape, columns)
    if rows > 0:
        run_back(steps, score, model, kept, tape, rows, states, columns)
    return states, updates


def run_forward(
    steps: Steps, score: Score, model: Model, rules: Rules, kept: Kept, runs: Runs, tape: Tape, columns: int
) -> tuple[int, int, int]:
    """Filter, and fill the tape; returns its rows (0: lost), the stamps of the reference, and the updates."""
    w, tape_rows = vectors(kept.w, WIDTH), vectors(tape.rows, WIDTH)
    start(w, vectors(steps.x0, WIDTH), vectors(steps.P0, WIDTH), vectors(model.extra, WIDTH))
    tape.step[0], tape.updated[0] = -1, 0
    write_state(w, tape_rows, 0)
    states, updates, row = 0, 0, 0
    for k in range(len(steps.model)):
        move(w, steps, model, k)
        due = steps.update[k] >= 0
        if due:
            update(w, steps, score, rules, kept, runs, steps.update[k], updates, columns)
            updates += 1
            if all_lost(kept.w):
                return 0, states, updates
        if steps.reference[k] >= 0:
            states += 1
        if due or k - tape.step[row] == SEGMENT or k == len(steps.model) - 1:
            row += 1
            tape.step[row], tape.updated[row] = k, 1 if due else 0
            write_state(w, tape_rows, ROW * row)
            if due:
                write_update(w, tape_rows, ROW * row)
    return row + 1, states, updates


def move(w: FloatArray, steps: Steps, model: Model, k: int) -> None:
    """Predict over step ``k``, if time passes."""
    if steps.model[k] >= 0:
        u = vectors(steps.u, WIDTH)
        if WIDTH == 1 or model.A.shape[2] == 1:
            shared = vectors(model.A, 1), vectors(model.b, 1), vectors(model.Q, 1)
            predict(w, shared, model.triangular, steps.model[k], u, steps.sample[k])
        else:
            own = vectors(model.A, WIDTH), vectors(model.b, WIDTH), vectors(model.Q, WIDTH)
            predict(w, own, model.triangular, steps.model[k], u, steps.sample[k])


def run_back(
    steps: Steps, score: Score, model: Model, kept: Kept, tape: Tape, rows: int, states: int, columns: int
) -> None:
    """Smooth, from the last row of the tape to the first."""
    tape_rows, between = vectors(tape.rows, WIDTH), vectors(tape.between, WIDTH)
    a, moving = vectors(tape.adjoint, WIDTH), vectors(tape.moving, WIDTH)
    mark_axes(moving)
    left = states
    for row in range(rows - 1, 0, -1):
        first, last = tape.step[row - 1], tape.step[row]
        read_state(tape_rows, ROW * (row - 1), moving)
        for k in range(first + 1, last):
            move(moving, steps, model, k)
            write_state(moving, between, FILTERED * (k - first - 1))
        left = give(steps, score, kept, last, tape_rows, ROW * row, a, left)
        if tape.updated[row] > 0:
            absorb(a, tape_rows, ROW * row, columns)
        step_back(a, steps, model, last)
        for k in range(last - 1, first, -1):
            left = give(steps, score, kept, k, between, FILTERED * (k - first - 1), a, left)
            step_back(a, steps, model, k)


def step_back(a: FloatArray, steps: Steps, model: Model, k: int) -> None:
    """Take the adjoint to before step ``k``, if time passes in it."""
    if steps.model[k] >= 0:
        if WIDTH == 1 or model.A.shape[2] == 1:
            retreat(a, vectors(model.A, 1), steps.model[k])
        else:
            retreat(a, vectors(model.A, WIDTH), steps.model[k])


def give(steps: Steps, score: Score, kept: Kept, k: int, rows: FloatArray, at: int, a: FloatArray, left: int) -> int:
    """Keep, or score, the smoothed state after step ``k``, if the reference is there; return how many are left."""
    if steps.reference[k] < 0:
        return left
    row = left - 1
    kept.reference[row] = steps.reference[k]
    if WIDTH == 1:
        smooth_alone(vectors(kept.x, WIDTH), vectors(kept.P, WIDTH), row, rows, at, a)
    else:
        w = vectors(kept.w, WIDTH)
        smooth(w, rows, at, a)
        if len(score.mark) > 0:
            compare(w, score, vectors(score.truth, WIDTH), kept.errors, row)
    return row
