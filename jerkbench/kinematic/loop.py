"""The loop of the kernel: prediction, update, adaptation and score of each step of a timeline."""

import os
from contextlib import suppress
from functools import cache
from typing import Any

from jerkbench.arrays import WIDE, FloatArray
from jerkbench.compilation.compiled_loop import compiled_loop, is_compiled, run_beside
from jerkbench.compilation.module_cache import BEFORE_WAITING, LOOPS
from jerkbench.compilation.vectors import anywhere, chosen
from jerkbench.compilation.views import Lanes, View, ask_for, lane, room, row, runs_in, taken
from jerkbench.estimate import NIS, NIS_USED, UPDATES, UPDATES_USED
from jerkbench.kinematic.adapt import adapt_runs, find_gains
from jerkbench.kinematic.adapt_lanes import adapt_lanes, find_gains_of_lanes, note_coupling
from jerkbench.kinematic.arguments import (
    ASKED,
    AT_ONCE,
    DENSE,
    EACH,
    RUN,
    STRIDE,
    Exchange,
    Kept,
    Model,
    Rules,
    Steps,
    TruthRows,
    run_type,
)
from jerkbench.kinematic.correction import NAN, check_definite, correct, correct_by_gains, determinant, mahalanobis
from jerkbench.kinematic.predict import (
    ANY,
    AT_UPDATES,
    TRIANGULAR,
    advance,
    join_steps,
    mark_axes,
    mirror,
    no_time,
    predict,
    predict_covariance,
    predict_state,
    predict_usual,
    show_covariance,
)
from jerkbench.kinematic.score import AHEAD, add_errors, keep

# An update: what was measured, what the adaptation makes of it, what is kept of it, and how it counts.


def update(
    run: Lanes, steps: Steps, scored: TruthRows, rules: Rules, kept: Kept, exchange: Exchange, which: int, place: int
) -> None:
    """Take row ``which`` of the measurements, the ``place``-th update."""
    nis = expect(run, steps, rules, kept, exchange, which, place)
    if DENSE == 1:
        run.own = run.zero
        if ASKED == AT_ONCE:
            find_gains_of_lanes(run, exchange.rows, rules)
        else:
            find_gains(run, exchange, rules)
        if STRIDE > 1:
            note_coupling_of(run, run.Z, 6, run.s)
        correct_by_gains(run, exchange.states)
        mirror(run)
    else:
        correct(run, exchange.states)
    check_definite(run)
    finish(run, scored, kept, which, place, nis)


def seen_of(run: Lanes, kept: Kept, place: int) -> View:
    """Return where what the ``place``-th update sees is kept."""
    seen: View = row(kept.seen, place if len(kept.seen) > 1 else 0, run, "seen")
    return seen


def expect(run: Lanes, steps: Steps, rules: Rules, kept: Kept, exchange: Exchange, which: int, place: int) -> float:
    """Fill innovation and adapted R; return y' S^-1 y with it."""
    seen = seen_of(run, kept, place)
    kept.which[place] = which
    complete = _innovate(run, taken(steps.z, which, run, "6"))
    R = taken(steps.reported, which, run, "6 related")
    if run.width > 1:
        _scale(R, row(steps.told, 0, run, "3"))
        if steps.reported.shape[2] > 1:
            ask_for(row(steps.reported, which + 1, run, "6 related"))
            ask_for(row(steps.z, which + 1, run, "6"))
    _take_covariance(run, R, complete)
    nis = mahalanobis(run)
    seen[0], seen[1] = rows_used(run), nis
    if len(kept.seen) == len(kept.which):
        _keep_innovation(run, seen)
    if len(steps.R) > 0:
        _take_covariance(run, taken(steps.R, which, run, "6 related"), complete)
    same = _adapt(run, rules, exchange, complete)
    if not same or len(steps.R) > 0:
        nis = mahalanobis(run)
    return nis


def _adapt(run: Lanes, rules: Rules, exchange: Exchange, complete: bool) -> bool:
    """Ask for the adapted R, and prior; return whether both are what they were."""
    if rules.adapt[0] == 0:
        for r in range(6):
            run.variance[r] = chosen(run.used[r], 0.0, run.R[r, r], NAN)
        return True
    if ASKED == AT_ONCE:
        adapt_lanes(run, exchange.rows, rules, complete)
        return False
    same = adapt_runs(run, exchange, rules, complete)
    if STRIDE > 1:
        note_coupling_of(run, run.R, 6, 6)
        if DENSE == 1:
            note_coupling_of(run, run.P, run.s, run.s)
    return same


def _keep_innovation(run: Lanes, seen: View) -> None:
    """Keep y, NaN where there is none, and det S with the reported R."""
    seen[16] = determinant(run)
    for r in range(6):
        seen[4 + r] = chosen(run.used[r], 0.0, run.y[r], NAN)


def note_coupling_of(run: Lanes, M: View, rows: int, columns: int) -> None:
    """Note where a matrix that an adaptation made has something between two axes."""
    squares = run.zero
    for r in range(rows):
        for c in range(columns):
            if (r - c) % STRIDE != 0:
                squares += M[r, c] * M[r, c]
    note_coupling(run, chosen(run.lost, 0.0, 0.0, 1.0), squares)


def _innovate(run: Lanes, z: View) -> bool:
    """Make y = z - H x; return whether all rows of all runs are there."""
    absent = run.zero
    for r in range(6):
        run.used[r] = chosen(1.0, z[r] * 0.0, 1.0, 0.0)
        run.y[r] = chosen(run.used[r], 0.0, z[r] - run.x[r], 0.0)
        absent += 1.0 - run.used[r]
    return not anywhere(absent)


def _take_covariance(run: Lanes, R: View, complete: bool) -> None:
    """Take R, 0 where a row is not there."""
    for r in range(6):
        for c in range(r % STRIDE, 6, STRIDE):
            run.R[r, c] = R[r, c // STRIDE]
    if not complete:
        clear_absent(run)


def _scale(R: View, told: View) -> None:
    """Make of the reported R the one that each run is told (`jerkbench.timeline.ScaledMeasurements`)."""
    for b in range(2):
        for r in range(3 * b, 3 * b + 3):
            for c in range(3 * b + r % STRIDE, 3 * b + 3, STRIDE):
                R[r, c // STRIDE] *= told[b]
            R[r, r // STRIDE] = chosen(told[2], R[r, r // STRIDE], told[2], R[r, r // STRIDE])


def clear_absent(run: Lanes) -> None:
    """Make R zero where a row is not there."""
    for r in range(6):
        for c in range(6):
            run.R[r, c] = chosen(run.used[r] * run.used[c], 0.0, run.R[r, c], 0.0)


def finish(run: Lanes, scored: TruthRows, kept: Kept, which: int, place: int, nis: float) -> None:
    """Keep what the adapted R made of it, and count the update."""
    seen, used = seen_of(run, kept, place), rows_used(run)
    nis_used = chosen(used, 0.0, nis, NAN)
    if len(kept.seen) == len(kept.which):
        seen[2], seen[3] = used, nis_used
        for r in range(6):
            seen[10 + r] = run.variance[r]
    if len(scored.counts) > 0:
        counts = taken(scored.counts, which, run, "1")[0]
        run.sums[NIS] += chosen(seen[0], 0.0, counts * seen[1] / seen[0], 0.0)
        run.sums[UPDATES] += chosen(seen[0], 0.0, counts, 0.0)
        run.sums[NIS_USED] += chosen(used, 0.0, counts * nis_used / used, 0.0)
        run.sums[UPDATES_USED] += chosen(used, 0.0, counts, 0.0)


def rows_used(run: Lanes) -> float:
    """Return how many rows are used."""
    rows: float = run.used[0]
    for r in range(1, 6):
        rows += run.used[r]
    return rows


# The loop of the kernel: the steps of a timeline, one after the other.

ModelArrays = tuple[FloatArray, FloatArray, FloatArray]


def run_steps(
    steps: Steps, scored: TruthRows, model: Model, rules: Rules, kept: Kept, exchange: Exchange
) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost.

    Args:
        steps: the steps.
        scored: what the errors count for.
        model: the filter.
        rules: the adaptation.
        kept: gets what comes out.
        exchange: room.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    run = runs_in(kept.w, RUN)
    start(run, row(steps.x0, 0, run, "6"), row(steps.P0, 0, run, "6 6"), model)
    reached = updates = begun = usual = 0 * len(steps.model)  # of a literal numba compiles what it is handed to twice
    all_read = True
    how = way_of(model)
    if run.width > 1 and how == TRIANGULAR:
        how = AT_UPDATES
    k = 0
    while k < len(steps.model):
        if run.width > 1 and how == AT_UPDATES and not scored.consistency:
            k, reached = coast(run, steps, scored, model, kept, k, reached)
        else:
            move(run, steps, (model.A, model.b, model.Q), how, k)
        if steps.update[k] >= 0:
            if how == AT_UPDATES:
                usual, all_read = catch_up(run, model, steps, begun, k, usual, all_read)
            elif DENSE == 1:
                advance(run, model, steps, begun, k + 1)
            begun = k + 1
            update(run, steps, scored, rules, kept, exchange, steps.update[k], updates)
            updates += 1
            if how == AT_UPDATES and scored.consistency:
                show_covariance(run, run.due)
            if all_lost(run, k):
                return reached, updates
        if steps.reference[k] >= 0:
            keep(run, scored, kept, steps.reference[k], reached, later=how == AT_UPDATES)
            reached += 1
        k += 1
    return reached, updates


def coast(
    run: Lanes, steps: Steps, scored: TruthRows, model: Model, kept: Kept, k: int, reached: int
) -> tuple[int, int]:
    """Move the states from step ``k`` on, and score them, up to a step with an update, or the last: moved, not scored.

    Until then nothing depends on the covariance, so state and sums stay in the registers.

    Returns:
        That step, and how many stamps of the reference were visited before it.
    """
    x, e, sums = room(run, "s"), room(run, "6"), room(run, "errors")
    for s in range(run.s):
        x[s] = run.x[s]
    for total in range(run.errors):
        sums[total] = run.sums[total]
    while True:
        if steps.model[k] >= 0:
            move_state(run, x, steps, model, k)
        if steps.update[k] >= 0 or k + 1 == len(steps.model):
            break
        if steps.reference[k] >= 0:
            add_errors(run, x, e, sums, scored, kept.errors, reached)
            reached += 1
        k += 1
    for s in range(run.s):
        run.x[s] = x[s]
    for total in range(run.errors):
        run.sums[total] = sums[total]
    return k, reached


def move_state(run: Lanes, x: View, steps: Steps, model: Model, k: int) -> None:
    """Predict the state ``x`` alone over step ``k``."""
    ask_ahead(run, steps, k)
    u, m = taken(steps.u, steps.sample[k], run, "3"), steps.model[k]
    predict_state(run, x, taken(model.A, m, run, "n n"), taken(model.b, m, run, "n"), u)


def ask_ahead(run: Lanes, steps: Steps, k: int) -> None:
    """Ask the memory for what is sensed some steps after ``k``; the numbers of one recording come by themselves."""
    if steps.u.shape[2] > 1:
        ask_for(row(steps.u, steps.sample[k] + AHEAD, run, "3"))


def catch_up(run: Lanes, model: Model, steps: Steps, begin: int, k: int, usual: int, fresh: bool) -> tuple[int, bool]:
    """Predict the covariance of the runs that measure anything at step ``k``, and the transition that a rule is shown.

    Returns:
        How many steps are ``usual`` now, and whether these are all runs.
    """
    z, due = taken(steps.z, steps.update[k], run, "6"), run.zero
    for r in range(6):
        due += chosen(1.0, z[r] * 0.0, 1.0, 0.0)
    run.due, complete = due, not anywhere(1.0 - due)
    count = 0
    for step in range(begin, k + 1):
        count += 1 if steps.model[step] >= 0 else 0
    known = fresh and count == usual > 0 and len(model.A) == 1
    if known and complete and DENSE == 0:
        predict_usual(run)
        return usual, True
    join_steps(run, model, steps, begin, k + 1, known, fresh)
    predict_covariance(run)
    return count if fresh else usual, complete


def start(run: Lanes, x0: View, P0: View, model: Model) -> None:
    """Put the initial state and covariance into the run, which is zero."""
    for s in range(6):
        run.x[s] = x0[s]
        for t in range(s % STRIDE, s + 1, STRIDE):
            run.P[s, t] = P0[s, t]
    for s in range(6, run.s):
        run.P[s, s] = row(model.extra, (s - 6) // 3, run, "1")[0]
    run.ended = run.ended - 1.0
    if DENSE == 1:
        no_time(run, run.since_A, run.since_Q)
    no_time(run, run.gone_A, run.gone_Q)
    show_covariance(run, run.zero + 1.0)
    mirror(run)
    mark_axes(run)


def way_of(model: Model) -> int:
    """Return how the covariance is predicted at each step (`jerkbench.kinematic.predict`)."""
    return TRIANGULAR if model.triangular else ANY


def move(run: Lanes, steps: Steps, models: ModelArrays, how: int, k: int) -> None:
    """Predict over step ``k``, if time passes, as ``how`` says (`jerkbench.kinematic.predict`).

    ``models`` are A, b, Q of all lengths of a step: all runs have the same, or each its own.
    """
    m, (A, b, Q) = steps.model[k], models
    if m < 0:
        return
    ask_ahead(run, steps, k)
    u = taken(steps.u, steps.sample[k], run, "3")
    if run.width == 1 or A.shape[2] == 1:  # `predict` stands apart: what it is handed is read from where it lies
        one = lane(run, 0)
        predict(run, (row(A, m, one, "n n"), row(b, m, one, "n"), row(Q, m, one, "n n")), how, u)
    else:
        predict(run, (row(A, m, run, "n n"), row(b, m, run, "n"), row(Q, m, run, "n n")), how, u)


def all_lost(run: Lanes, step: int) -> bool:
    """Note ``step`` for the runs that are lost at its end; return whether none is left."""
    if anywhere(run.lost * (-0.5 - run.ended)):
        run.ended = chosen(run.lost * (-0.5 - run.ended), 0.0, float(step), run.ended)
    return not anywhere(chosen(run.lost, 0.0, 0.0, 1.0))


# The compiled loop.

ALONE = ("run_steps", "predict", "predict_covariance", "add_nees", "mahalanobis", "correct", "check_definite")
SELDOM = (
    *("predict_any", "clear_absent", "_pack", "fade_prior", "_unpack", "adapt_lanes", "_keep_memory"),
    *("_restore_memory", "advance", "adapt_prior", "take_whole", "find_gains", "find_gains_of_lanes"),
    *("_own_update", "_widen"),
)
APART = ALONE + SELDOM
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""


@cache
def loop_for(n: int, width: int, *, dense: bool = False, asked: int = EACH, stride: int = 1) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for filters with ``n`` quantities on each axis.

    ``dense``: for adaptations that see whole matrices; all others have a loop without any of that. ``asked``: by whom,
    ``stride``: 3 where axes have nothing to do with each other (`jerkbench.kinematic.arguments`).
    """
    return compiled_loop(run_steps, *_named(n, width, dense=dense, asked=asked, stride=stride))


class Busy(Exception):  # noqa: N818 - no error
    """Another process is compiling the loop."""


def _compile_announced() -> None:
    """Compile the other loops that a sweep needs (`jerkbench.engines.compiled_engine`), before waiting for one."""
    BEFORE_WAITING[:] = [_leave]
    try:
        for loop in filter(None, os.environ.get(LOOPS, "").split(",")):
            n, dense, at_once = map(int, loop.split())
            with suppress(Busy):
                loop_for(n, WIDE, dense=bool(dense), asked=AT_ONCE if at_once else EACH)
    finally:
        BEFORE_WAITING[:] = [_compile_announced]


def _leave() -> None:
    raise Busy


BEFORE_WAITING.append(_compile_announced)


def runs_of(width: int) -> str:
    """Return how a message says so many runs."""
    return "one run" if width == 1 else f"{width} runs"


def compile_beside(n: int) -> None:
    """Let another process compile the loop of one run, if it is not on the disk and there is a processor for it."""
    if (os.cpu_count() or 1) > 1 and not is_compiled(run_steps, *_named(n, 1)):
        run_beside(f"from {__name__} import loop_for; loop_for({n}, 1)")


def _named(
    n: int, width: int, *, dense: bool = False, asked: int = EACH, stride: int = 1
) -> tuple[str, dict[str, Any], tuple[str, ...]]:
    each = ", one run" if width == 1 else ", an adaptation of single runs" * (asked == EACH)
    ways = f"{each}{', with full matrices' * dense}{', decoupled axes' * (stride > 1)}"
    constants = {"RUN": run_type(n, width, related=6 // stride), "DENSE": int(dense), "ASKED": asked, "STRIDE": stride}
    return f"the filter loop ({3 * n} states{ways})", constants, APART
