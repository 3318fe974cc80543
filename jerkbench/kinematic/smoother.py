"""The fixed-interval smoother of a kinematic filter, by adjoints.

Forward the filter itself. Backward (Bierman's form of the smoother of Rauch, Tung and Striebel) an adjoint of n numbers
and one of n by n, both zero at the end, from which the smoothed state follows wherever the filtered one is known::

    xs = x - P lambda,                              Ps = P - P Lambda P
    over an update, C = I - K H:
    lambda = C' lambda - H' S^-1 y,                 Lambda = C' Lambda C + H' S^-1 H
    over a step:
    lambda = F' lambda,                             Lambda = F' Lambda F

No covariance is inverted but S, which the filter has factors of. F' Lambda F is the same product for each pair of axes,
as F P F' is. An adaptation that fades P is one that had a larger Q in the step before, and asks for nothing else.

What the backward pass needs stands on a tape: the state after each update, and after so many steps without one. The
states in between are predicted once more from there, and lie in the cache then. `adjoint` has the steps of that pass.

Source: G. J. Bierman, "Fixed interval smoothing with discrete measurements", International Journal of Control 18(1),
1973, doi:10.1080/00207177308932487.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, FloatMatrix, FloatVector, IntArray, IntVector
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import aligned_zeros, chosen
from jerkbench.compilation.views import Lanes, View, copy, eights, room, row, runs_in, taken, wide_room
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate, Streamed
from jerkbench.kinematic.arguments import (
    RUN,
    Exchange,
    Kept,
    Model,
    Rules,
    Steps,
    TruthRows,
    run_type,
    with_covariance,
)
from jerkbench.kinematic.correction import solve_back, solve_forward, solve_gains
from jerkbench.kinematic.loop import APART, all_lost, move, runs_of, start, update, way_of
from jerkbench.kinematic.packs import Pack, model_of
from jerkbench.kinematic.plugin_call import Rule
from jerkbench.kinematic.predict import mark_axes, mirror, transform
from jerkbench.kinematic.runs import run_alone, run_packs
from jerkbench.kinematic.score import compare
from jerkbench.timeline import Run, Timeline


def absorb(a: Lanes, tape: Lanes, states: int) -> None:
    """Take the adjoint to before the update that stands in a row of the tape.

    ``states`` is their number, which as a constant would make the compiler unroll the loops.
    """
    for r in range(6):  # Lambda (I - K H)
        for s in range(states):
            total = a.P[s, 0] * tape.left[r, 0]
            for t in range(1, a.s):
                total += a.P[s, t] * tape.left[r, t]
            a.Z[r, s] = total
    _absorb_vector(a, tape)
    for r in range(6):  # (I - K H)' Lambda (I - K H) + H' S^-1 H
        for c in range(r + 1):
            total = tape.inverse[r, c]
            for s in range(a.s):
                total += tape.left[r, s] * a.Z[c, s]
            a.P[r, c] = total
        for s in range(6, states):
            a.P[s, r] = a.Z[r, s]
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
    A, last = room(a, "n n"), a.n - 1
    for q in range(a.n):
        for c in range(a.n):
            A[q, c] = model[last - c, last - q]  # A' M A is A M A' where rows and columns are counted from the end
    for i in range(3):
        for q in range(last, 0, -1):
            for c in range(q):
                a.x[3 * q + i] += model[c, q] * a.x[3 * c + i]
    if a.width == 1:
        _retreat_pairs(a, A)
    else:
        for i in range(3):
            for j in range(i, 3):
                _retreat_pair(a, A, i, j)


def _retreat_pairs(a: Lanes, A: View) -> None:
    """All pairs of axes of one run at once."""
    M, last = wide_room(a, "n n"), a.n - 1
    for r in range(a.n):
        for c in range(a.n):
            M[last - r, last - c] = a.pairs[r, c]
    transform(M, A, a.n, 0)
    for r in range(a.n):
        for c in range(a.n):
            a.pairs[r, c] = M[last - r, last - c]


def _retreat_pair(a: Lanes, A: View, i: int, j: int) -> None:
    M, last = room(a, "n n"), a.n - 1
    for r in range(a.n):
        for c in range(a.n):
            M[last - r, last - c] = a.P[3 * r + i, 3 * c + j]
    transform(M, A, a.n, 0)
    for r in range(a.n):
        for c in range(r if i == j else 0, a.n):
            a.P[3 * r + i, 3 * c + j] = M[last - r, last - c]


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

    Column s of K' = S^-1 H P lies in Z then; of a measured state whose R is the finer, that of -S^-1 R = K' - I (see
    `jerkbench.kinematic.correction`).
    """
    solve_gains(run)
    solved = room(run, "6 7")  # S^-1 and S^-1 y
    for c in range(7):
        for r in range(6):
            solved[r, c] = run.y[r] if c == 6 else run.used[r] if r == c else run.zero
        solve_forward(run, solved, c)
        solve_back(run, solved, c)
    for r in range(6):
        for s in range(run.s):
            rest = (1.0 if r == s else 0.0) - run.Z[r, s]
            if s < 6:
                rest = chosen(run.fine[s], 0.0, 0.0 - run.Z[r, s], rest)
            tape.left[r, s] = rest
        tape.weighed[r] = solved[r, 6]
        for c in range(r + 1):
            tape.inverse[r, c] = solved[r, c]


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
        "inverse": (6, 6),  # of S, its lower half; 0 where a row is not used
        "weighed": (6,),  # S^-1 y
    }
    return with_covariance(shapes, s, width)


ROW = tape_type(3, WIDE)
"""The type at hand: a compilation replaces it."""


# Arguments of the loops besides those of the filter; WIDTH is the number of runs side by side.


class Tape(NamedTuple):
    """Room for what the backward pass needs.

    Attributes:
        step: (rows,) the step after which the row was written; -1: the start.
        updated: (rows,) 1 where that step ended with an update.
        rows: (rows, any) filtered states, and what the updates made of them.
        between: (SEGMENT, any) states between two rows.
        moving: (LENGTH WIDTH,) the filter that is predicted once more.
        adjoint: (LENGTH WIDTH,) lambda in the place of the state, Lambda in that of the covariance.
    """

    step: IntVector
    updated: IntVector
    rows: FloatMatrix
    between: FloatMatrix
    moving: FloatVector
    adjoint: FloatVector


# The loops of the smoother: the steps of a timeline forward, and back.


def run_smoother(
    steps: Steps, scored: TruthRows, model: Model, rules: Rules, kept: Kept, exchange: Exchange, tape: Tape
) -> tuple[int, int]:
    """Run all steps forward and back; only forward where the last run is lost on the way.

    Arguments are those of `jerkbench.kinematic.loop.run_steps`, and ``tape``.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    rows, reached, updates = run_forward(steps, scored, model, rules, kept, exchange, tape)
    if rows > 0:
        run_back(steps, scored, model, kept, tape, rows, reached, exchange.states)
    return reached, updates


def run_forward(
    steps: Steps, scored: TruthRows, model: Model, rules: Rules, kept: Kept, exchange: Exchange, tape: Tape
) -> tuple[int, int, int]:
    """Filter, and fill the tape; returns its rows and the stamps of the reference (0: lost), and the updates."""
    run = runs_in(kept.w, RUN)
    start(run, row(steps.x0, 0, run, "6"), row(steps.P0, 0, run, "6 6"), model)
    tape.step[0], tape.updated[0] = -1, 0
    copy_state(runs_in(tape.rows[0], ROW), run)
    reached, updates, last = 0, 0, 0
    for k in range(len(steps.model)):
        move(run, steps, (model.A, model.b, model.Q), way_of(model), k)
        due = steps.update[k] >= 0
        if due:
            update(run, steps, scored, rules, kept, exchange, steps.update[k], updates)
            updates += 1
            if all_lost(run, k):
                return 0, 0, updates
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
    steps: Steps, scored: TruthRows, model: Model, kept: Kept, tape: Tape, rows: int, reached: int, states: int
) -> None:
    """Smooth, from the last row of the tape to the first."""
    a, moving = runs_in(tape.adjoint, RUN), runs_in(tape.moving, RUN)
    mark_axes(moving)
    left = reached
    for number in range(rows - 1, 0, -1):
        first, last = tape.step[number - 1], tape.step[number]
        copy_state(moving, runs_in(tape.rows[number - 1], ROW))
        for k in range(first + 1, last):
            move(moving, steps, (model.A, model.b, model.Q), way_of(model), k)
            copy_state(runs_in(tape.between[k - first - 1], ROW), moving)
        left = give(steps, scored, kept, last, runs_in(tape.rows[number], ROW), a, left)
        if tape.updated[number] > 0:
            absorb(a, runs_in(tape.rows[number], ROW), states)
        step_back(a, steps, model, last)
        for k in range(last - 1, first, -1):
            left = give(steps, scored, kept, k, runs_in(tape.between[k - first - 1], ROW), a, left)
            step_back(a, steps, model, k)


def step_back(a: Lanes, steps: Steps, model: Model, k: int) -> None:
    """Take the adjoint to before step ``k``, if time passes in it."""
    if steps.model[k] >= 0:
        retreat(a, taken(model.A, steps.model[k], a, "n n"))


def give(steps: Steps, scored: TruthRows, kept: Kept, k: int, filtered: Lanes, a: Lanes, left: int) -> int:
    """Keep, or score, the smoothed state after step ``k``, if the reference is there; return how many are left."""
    if steps.reference[k] < 0:
        return left
    place = left - 1
    run = runs_in(kept.w, RUN)
    if run.width == 1:
        kept.reference[place] = steps.reference[k]
        smooth_alone(row(kept.x, place, run, "6"), row(kept.P, place, run, "6 6"), filtered, a)
    else:
        smooth(run, filtered, a)
        if len(scored.mark) > 0:
            compare(run, run.P_measured, scored, kept.errors, place)
    return place


# Smoothed runs from Python: timelines in, an estimate with its trajectory or sums out.

_OWN = (
    *("run_smoother", "run_forward", "run_back", "move", "step_back", "give", "smooth", "smooth_alone"),
    *("absorb", "retreat", "copy_state", "write_update"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""


@cache
def smoother_for(n: int, width: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled smoother of ``width`` runs for a filter with ``n`` quantities on each axis."""
    constants = {"RUN": run_type(n, width), "ROW": tape_type(n, width), "DENSE": 0}
    return compiled_loop(run_smoother, f"the smoother of {runs_of(width)} of {3 * n} states", constants, APART + _OWN)


def smooth_one(timeline: Timeline, model: Filter, rule: Rule) -> Estimate | None:
    """Run with a trajectory; where the filter stops on the way, what comes before is smoothed by itself.

    None where A is not upper triangular with ones on its diagonal.
    """
    lengths_s, which = timeline.lengths
    prepared = _prepared([model], lengths_s, timeline.dt0_s, timeline.update)
    if prepared is None:
        return None
    estimate, w = run_alone(timeline, which, rule, prepared)
    if not estimate.failure:
        return estimate
    end = int(w[prepared[1].fields["ended"].places[0]])
    steps = {name: getattr(timeline, name)[:end] for name in ("t_s", "dt_s", "sample", "update", "reference")}
    before, _ = run_alone(replace(timeline, **steps), which[:end], rule, prepared)
    return replace(before, updates=estimate.updates, failure=estimate.failure)


def smooth_many(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run all ``runs`` side by side without trajectories; None as above."""

    def prepare(pack: Pack, lanes: Sequence[int]) -> tuple[Any, ...] | None:
        return _prepared([models[k] for k in lanes], pack.lengths_s, pack.timelines[0].dt0_s, pack.steps.update)

    sizes = [2 + len(model.initial_variances()) for model in models]
    return run_packs(runs, sizes, rules, prepare, updates=updates, threads=threads)


def _prepared(
    models: Sequence[Filter], lengths_s: FloatArray, dt0_s: float, update: IntArray
) -> tuple[Any, ...] | None:
    """The loop of a filter for each run, the type of the runs, the model, and the tape; ``update`` of each step."""
    model, width = model_of(models, lengths_s, dt0_s), len(models)
    n = 2 + len(model.extra)
    if not model.triangular:
        return None
    return smoother_for(n, width), run_type(n, width), model, _tape_for(update, n, width)


def _tape_for(update: IntArray, n: int, width: int) -> Tape:
    """Room for the tape of ``width`` runs."""
    rows = 2 + len(update) // SEGMENT + int(np.count_nonzero(update >= 0)) + 1
    row, length = tape_type(n, width).sizes["length"], run_type(n, width).sizes["length"]
    return Tape(
        np.empty(rows, dtype=np.int64),
        np.empty(rows, dtype=np.int64),
        np.empty((rows, row)),
        np.empty((SEGMENT, row)),
        aligned_zeros(length),
        aligned_zeros(length),
    )
