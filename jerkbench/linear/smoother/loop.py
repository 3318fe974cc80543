"""The loops of the smoother: the steps of a timeline forward, and back."""

from jerkbench.compilation.views import Run, row, runs_in, shared_row
from jerkbench.kinematic.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.kinematic.layout import RUN
from jerkbench.kinematic.loop import all_lost, move, start
from jerkbench.kinematic.predict import mark_axes
from jerkbench.kinematic.score import compare
from jerkbench.kinematic.update_step import update
from jerkbench.linear.smoother.adjoint import absorb, retreat
from jerkbench.linear.smoother.arguments import Tape
from jerkbench.linear.smoother.layout import ROW, SEGMENT
from jerkbench.linear.smoother.smoothed import smooth, smooth_alone
from jerkbench.linear.smoother.tape import copy_state, write_update


def run_smoother(
    steps: Steps, score: Score, model: Model, rules: Rules, kept: Kept, runs: Runs, tape: Tape
) -> tuple[int, int]:
    """Run all steps forward and back; only forward where the last run is lost on the way.

    Arguments are those of `jerkbench.kinematic.loop.run_steps`, and ``tape``.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    states = 3 * (2 + len(model.extra))
    rows, reached, updates = run_forward(steps, score, model, rules, kept, runs, tape, states)
    if rows > 0:
        run_back(steps, score, model, kept, tape, rows, reached, states)
    return reached, updates


def run_forward(
    steps: Steps, score: Score, model: Model, rules: Rules, kept: Kept, runs: Runs, tape: Tape, states: int
) -> tuple[int, int, int]:
    """Filter, and fill the tape; returns its rows (0: lost), the stamps of the reference, and the updates."""
    run = runs_in(kept.w, RUN)
    start(run, row(steps.x0, 0, run, "6"), row(steps.P0, 0, run, "6 6"), model)
    tape.step[0], tape.updated[0] = -1, 0
    copy_state(runs_in(tape.rows[0], ROW), run)
    reached, updates, last = 0, 0, 0
    for k in range(len(steps.model)):
        move(run, steps, model, k)
        due = steps.update[k] >= 0
        if due:
            update(run, steps, score, rules, kept, runs, steps.update[k], updates, states)
            updates += 1
            if all_lost(run):
                return 0, reached, updates
        if steps.reference[k] >= 0:
            reached += 1
        if due or k - tape.step[last] == SEGMENT or k == len(steps.model) - 1:
            last += 1
            tape.step[last], tape.updated[last] = k, 1 if due else 0
            copy_state(runs_in(tape.rows[last], ROW), run)
            if due:
                write_update(runs_in(tape.rows[last], ROW), run)
    return last + 1, reached, updates


def run_back(
    steps: Steps, score: Score, model: Model, kept: Kept, tape: Tape, rows: int, reached: int, states: int
) -> None:
    """Smooth, from the last row of the tape to the first."""
    a, moving = runs_in(tape.adjoint, RUN), runs_in(tape.moving, RUN)
    mark_axes(moving)
    left = reached
    for number in range(rows - 1, 0, -1):
        first, last = tape.step[number - 1], tape.step[number]
        copy_state(moving, runs_in(tape.rows[number - 1], ROW))
        for k in range(first + 1, last):
            move(moving, steps, model, k)
            copy_state(runs_in(tape.between[k - first - 1], ROW), moving)
        left = give(steps, score, kept, last, runs_in(tape.rows[number], ROW), a, left)
        if tape.updated[number] > 0:
            absorb(a, runs_in(tape.rows[number], ROW), states)
        step_back(a, steps, model, last)
        for k in range(last - 1, first, -1):
            left = give(steps, score, kept, k, runs_in(tape.between[k - first - 1], ROW), a, left)
            step_back(a, steps, model, k)


def step_back(a: Run, steps: Steps, model: Model, k: int) -> None:
    """Take the adjoint to before step ``k``, if time passes in it."""
    if steps.model[k] >= 0:
        if a.width == 1 or model.A.shape[2] == 1:
            retreat(a, shared_row(model.A, steps.model[k], a, "n n"))
        else:
            retreat(a, row(model.A, steps.model[k], a, "n n"))


def give(steps: Steps, score: Score, kept: Kept, k: int, filtered: Run, a: Run, left: int) -> int:
    """Keep, or score, the smoothed state after step ``k``, if the reference is there; return how many are left."""
    if steps.reference[k] < 0:
        return left
    place = left - 1
    kept.reference[place] = steps.reference[k]
    run = runs_in(kept.w, RUN)
    if run.width == 1:
        smooth_alone(row(kept.x, place, run, "6"), row(kept.P, place, run, "6 6"), filtered, a)
    else:
        smooth(run, filtered, a)
        if len(score.mark) > 0:
            compare(run, score, kept.errors, place)
    return place
