"""The loop of the kernel: the steps of a timeline, one after the other."""

import os
from functools import cache
from typing import Any

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled_loop import compiled_loop, is_compiled, run_beside
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import RunView, View, ask_for, copy, lane, row, runs_in, shared_row
from jerkbench.kinematic.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.kinematic.layout import DENSE, RUN, run_type
from jerkbench.kinematic.predict import mark_axes, mirror, predict
from jerkbench.kinematic.score import compare
from jerkbench.kinematic.update_step import update
from jerkbench.kinematic.whole_matrices import advance

Models = tuple[FloatArray, FloatArray, FloatArray]

AHEAD = 64
"""So many rows before it is needed the memory is asked for it: about ten microseconds."""


def run_steps(steps: Steps, score: Score, model: Model, rules: Rules, kept: Kept, runs: Runs) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost.

    Args:
        steps: the steps.
        score: what the errors count for.
        model: the filter.
        rules: the adaptation.
        kept: gets what comes out.
        runs: room.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    run = runs_in(kept.w, RUN)
    start(run, row(steps.x0, 0, run, "6"), row(steps.P0, 0, run, "6 6"), model)
    reached = updates = begun = 0
    states = 3 * (2 + len(model.extra))
    for k in range(len(steps.model)):
        move(run, steps, model, k)
        if steps.update[k] >= 0:
            if DENSE == 1:
                advance(run, runs, model, steps, begun, k + 1)
                begun = k + 1
            update(run, steps, score, rules, kept, runs, steps.update[k], updates, states)
            updates += 1
            if all_lost(run, k):
                return reached, updates
        if steps.reference[k] >= 0:
            keep(run, score, kept, steps.reference[k], reached)
            reached += 1
    return reached, updates


def start(run: RunView, x0: View, P0: View, model: Model) -> None:
    """Put the initial state and covariance into the run, which is zero."""
    for s in range(6):
        run.x[s] = x0[s]
        for t in range(s + 1):
            run.P[s, t] = P0[s, t]
    for s in range(6, run.s):
        run.P[s, s] = row(model.extra, (s - 6) // 3, run, "1")[0]
    run.ended = run.ended - 1.0
    mirror(run)
    mark_axes(run)


def move(run: RunView, steps: Steps, model: Model, k: int) -> None:
    """Predict over step ``k``, if time passes."""
    move_by(run, steps, (model.A, model.b, model.Q), model.triangular, k)


def move_by(run: RunView, steps: Steps, models: Models, triangular: bool, k: int) -> None:
    """The same by ``models`` A, b, Q of all lengths of a step: all runs have the same, or each its own."""
    m, (A, b, Q) = steps.model[k], models
    if m < 0:
        return
    u = row(steps.u, steps.sample[k], run, "3")
    if run.width > 1:  # a single run's numbers come by themselves
        ask_for(row(steps.u, steps.sample[k] + AHEAD, run, "3"))
    if run.width == 1 or A.shape[2] == 1:
        predict(
            run, (shared_row(A, m, run, "n n"), shared_row(b, m, run, "n"), shared_row(Q, m, run, "n n")), triangular, u
        )
    else:
        predict(run, (row(A, m, run, "n n"), row(b, m, run, "n"), row(Q, m, run, "n n")), triangular, u)


def keep(run: RunView, score: Score, kept: Kept, reference: int, k: int) -> None:
    """Keep, and score, the state at the ``k``-th visited stamp of the reference."""
    kept.reference[k] = reference
    if len(kept.x) > 0:
        x = row(kept.x, k, run, "6")
        for s in range(6):
            x[s] = run.x[s]
        copy(row(kept.P, k, run, "6 6"), run.P_measured)
    if len(score.mark) > 0:
        if run.width > 1:
            ask_for(row(score.truth, k + AHEAD, run, "6"))
        compare(run, score, kept.errors, k)


def all_lost(run: RunView, step: int) -> bool:
    """Note ``step`` for the runs that are lost at its end; return whether none is left."""
    run.ended = chosen(run.lost * (-0.5 - run.ended), 0.0, float(step), run.ended)
    k = 0
    while k < run.width and lane(run, k).lost > 0.0:
        k += 1
    return k == run.width


# The compiled loop.

ALONE = ("run_steps", "predict", "add_row", "mahalanobis", "correct", "check_definite")
SELDOM = (
    *("predict_any", "clear_absent", "_pack", "fade_prior", "_unpack"),
    *("advance", "adapt_prior", "take_whole", "put_covariance", "find_gains", "put_gains", "_own_update", "_widen"),
)
APART = ALONE + SELDOM
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""


@cache
def loop_for(n: int, width: int, *, dense: bool = False) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for filters with ``n`` quantities on each axis.

    ``dense``: for adaptations that see whole matrices; all others have a loop without any of that.
    """
    return compiled_loop(run_steps, *_named(n, width, dense=dense))


def runs_of(width: int) -> str:
    """Return how a message says so many runs."""
    return "one run" if width == 1 else f"{width} runs"


def compile_beside(n: int) -> None:
    """Let another process compile the loop of one run, if it is not on the disk and there is a processor for it."""
    if (os.cpu_count() or 1) > 1 and not is_compiled(run_steps, *_named(n, 1, dense=False)):
        run_beside(f"from {__name__} import loop_for; loop_for({n}, 1)")


def _named(n: int, width: int, *, dense: bool) -> tuple[str, dict[str, Any], tuple[str, ...]]:
    title = f"the loop for {runs_of(width)} of {3 * n} states{', dense' * dense}"
    return title, {"RUN": run_type(n, width), "DENSE": int(dense)}, APART
