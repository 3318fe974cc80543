"""Smoothed runs from Python: timelines in, an estimate with its trajectory or sums out."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import WIDE, aligned_zeros
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate
from jerkbench.kinematic.arguments import Steps, empty_runs
from jerkbench.kinematic.batch import results_of, room_of, run_packs
from jerkbench.kinematic.compiled_loop import APART, runs_of
from jerkbench.kinematic.layout import run_type
from jerkbench.kinematic.models import model_of
from jerkbench.kinematic.packs import Kind, Pack
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.kinematic.single_run import NO_SCORE, estimate_of, steps_of, trajectory_room
from jerkbench.linear.smoother.arguments import Tape
from jerkbench.linear.smoother.layout import SEGMENT, tape_type
from jerkbench.linear.smoother.loop import run_smoother
from jerkbench.streamed_run import Run, Streamed
from jerkbench.timeline.lengths import step_lengths
from jerkbench.timeline.timeline import Timeline

OWN = (
    *("run_smoother", "run_forward", "run_back", "move", "step_back", "give", "smooth", "smooth_alone"),
    *("absorb", "retreat", "copy_state", "write_update"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""


@cache
def smoother_for(n: int, width: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled smoother of ``width`` runs for a filter with ``n`` quantities on each axis."""
    constants = {"RUN": run_type(n, width), "ROW": tape_type(n, width), "DENSE": 0}
    return compiled_loop(run_smoother, f"the smoother of {runs_of(width)} of {3 * n} states", constants, APART + OWN)


def smooth_one(timeline: Timeline, model: Filter, rule: Rule) -> Estimate | None:
    """Run with a trajectory; None where the filter stops on the way: then NumPy smooths up to there.

    None too where A is not upper triangular with ones on its diagonal.
    """
    lengths_s, which = step_lengths(timeline.dt_s)
    prepared = model_of([model], lengths_s, timeline.dt0_s)
    if not prepared.triangular:
        return None
    n = 2 + len(prepared.extra)
    kept, steps = trajectory_room(timeline, n), steps_of(timeline, which, wants_truth=rule.wants_truth)
    arguments = steps, NO_SCORE, prepared, rules_of([rule], 3 * n), kept, empty_runs(n, 1), tape_for(steps, n, 1)
    states, updates = smoother_for(n, 1)(*arguments)
    estimate = estimate_of(timeline, kept, states, updates, n)
    return None if estimate.failure else estimate


def smooth_many(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run all ``runs`` side by side without trajectories; None as above."""
    kinds = [
        Kind(2 + len(model.initial_variances()), rule.wants_truth, rule.dense)
        for model, rule in zip(models, rules, strict=True)
    ]

    def run_pack(pack: Pack, lanes: Sequence[int]) -> list[Streamed | None]:
        """Run one with the filters and adaptations that are its own."""
        model = model_of([models[k] for k in lanes], pack.lengths_s, pack.timelines[0].dt0_s)
        if not model.triangular:
            return [None] * len(pack.members)
        n = 2 + len(model.extra)
        kept, rule = room_of(pack, run_type(n, WIDE), updates=updates), rules_of([rules[k] for k in lanes], 3 * n)
        tape = tape_for(pack.steps, n, WIDE)
        smoother_for(n, WIDE)(pack.steps, pack.score, model, rule, kept, empty_runs(n, WIDE), tape)
        return results_of(pack, kept, run_type(n, WIDE), updates=updates)

    return run_packs(runs, kinds, run_pack, threads)


def tape_for(steps: Steps, n: int, width: int) -> Tape:
    """Make room for the tape of ``width`` runs."""
    rows = 2 + len(steps.model) // SEGMENT + int(np.count_nonzero(steps.update >= 0)) + 1
    row, length = tape_type(n, width).sizes["length"], run_type(n, width).sizes["length"]
    return Tape(
        np.empty(rows, dtype=np.int64),
        np.empty(rows, dtype=np.int64),
        np.empty((rows, row)),
        np.empty((SEGMENT, row)),
        aligned_zeros(length),
        aligned_zeros(length),
    )
