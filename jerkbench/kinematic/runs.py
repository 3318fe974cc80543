"""Python functions that call the compiled loop, for one run with its trajectory or for a batch in packs of eight."""

import math
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache, lru_cache, partial
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import Compilation, compile_all
from jerkbench.contracts import Adaptation, Filter, wants_truth
from jerkbench.estimate import (
    NEES,
    NEES_POSITION,
    VELOCITY_SQUARES,
    WITH_BURN_IN,
    ErrorWeights,
    Estimate,
    Streamed,
    Updates,
)
from jerkbench.kinematic.arguments import (
    DETERMINANT,
    INNOVATION,
    NIS_OF_USED,
    SEEN_NIS,
    SEEN_ROWS,
    VARIANCE,
    Output,
    new_output,
    new_state,
    record_layout,
)
from jerkbench.kinematic.loop import loop_for
from jerkbench.kinematic.packs import Kind, Pack, pack_runs
from jerkbench.kinematic.rules import Rule, compilations_of, rules_of
from jerkbench.timeline import Run, Timeline

Prepared = tuple[Compilation, np.dtype[Any], Any, dict[str, FloatArray]]
"""The loop, the `record_layout` of its state, the argument that describes the filter, and the initial values of fields.

The initial values are passed to `new_state`.
"""

Prepare = Callable[[Pack], Prepared]
"""A function that prepares the loop for a pack."""

_NONE = np.empty(0)
NO_SCORING = ErrorWeights(np.empty((0, 6)), _NONE, _NONE, _NONE, _NONE, _NONE.astype(np.int64), 0.0, consistency=False)


# A single run.


def run_single(timeline: Timeline, model: Filter, rule: Rule) -> Estimate | None:
    """Return the estimate of one run up to a divergence, or None if the adaptation raises an error."""
    return run_trajectory(timeline, rule, partial(_prepared, [model]))[0]


def _prepared(models: Sequence[Filter], pack: Pack) -> Prepared:
    model, initial = pack.kinematic(models)
    n = model.A.shape[1]
    return loop_for(n), record_layout(n, 3 * n), model, initial


def run_trajectory(timeline: Timeline, rule: Rule, prepare: Prepare) -> tuple[Estimate | None, Any]:
    """Run a compiled loop over ``timeline``, and store the trajectory.

    Returns:
        A pair: the estimate, or None if the adaptation raises an error, and the record with the final state of the run.
    """
    (pack,) = pack_runs([Run(timeline, NO_SCORING)], [((), wants_truth(rule.adaptation))])
    rows, updates = timeline.reference[timeline.reference >= 0], len(pack.update_s)
    output = new_output(visits=len(rows), marks=0, updates=updates)
    state = _call(prepare, pack, [rule], output)
    if state["failed"][0, 0] > 0.0:
        return None, state
    failure = ""
    if (ended := int(state["ended"][0, 0])) >= 0:
        failure = f"the covariance is no longer positive definite at {timeline.t_s[ended]:.2f} s"
        rows = rows[: 1 + pack.steps.reference[:ended].max(initial=-1)]
        updates = 1 + pack.steps.update[: ended + 1].max()
    x, P = output.states[: len(rows)], output.covariances[: len(rows)]
    seen = _updates_of(pack.update_s[:updates], output.seen[:updates, :, 0])
    return Estimate(rows, x[:, :3], x[:, 3:], P, timeline.euler_rad[rows], seen, failure), state


def _call(prepare: Prepare, pack: Pack, rules: Sequence[Rule], output: Output) -> Any:  # noqa: ANN401 - a record
    """Call the loop for the runs of a pack, and return the record with the final states."""
    loop, of, model, initial = prepare(pack)
    state, functions = new_state(of, initial, len(pack.members)), rules[0].functions()
    arrays = rules_of(rules, len(state["x"]))
    loop.result()(pack.steps, pack.scored, model, arrays, *functions, output, state)
    return state


def _updates_of(t_s: FloatArray, seen: FloatArray) -> Updates:
    """Return the updates at the times ``t_s`` (m,) from the stored values ``seen`` (m, SEEN) of one run."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log_det = np.asarray(np.log(seen[:, DETERMINANT]), dtype=np.float64)
    rows, innovation, variances = seen[:, SEEN_ROWS], seen[:, INNOVATION:VARIANCE], seen[:, VARIANCE:DETERMINANT]
    return Updates(t_s, rows, seen[:, SEEN_NIS], seen[:, NIS_OF_USED], innovation, variances, log_det)


# Batches of runs.

OF_COVARIANCE, OF_VELOCITY = [NEES, NEES_POSITION], [*range(VELOCITY_SQUARES, WITH_BURN_IN)]


def compile_ahead(models: Sequence[Filter], adaptations: Sequence[Adaptation]) -> None:
    """Compile the loops and adaptations of a batch, in parallel with other processes where this is possible."""
    with suppress(Exception):  # the error of a plugin is raised again by its run
        loops = [loop_for(states) for states in dict.fromkeys(map(states_on_axis, models))]
        compile_all([*loops, *(one for of in map(compilations_of, dict.fromkeys(adaptations)) for one in of)])


def states_on_axis(model: Filter) -> int:
    """Return the number of states that a kinematic filter has on each axis."""
    return 2 + len(model.initial_variances())


def run_batch(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule | None], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run each run k with the filter ``models[k]`` and the adaptation ``rules[k]``, and return the error sums per run.

    The result is None for a run without a compiled adaptation, that diverged, or whose adaptation raised an error. The
    caller must repeat such a run alone.
    """
    states = [3 * states_on_axis(model) for model in models]
    return run_packs(runs, states, rules, partial(_prepared, models), updates=updates, threads=threads)


def run_packs(
    runs: Sequence[Run],
    states: Sequence[int],
    rules: Sequence[Rule | None],
    prepare: Prepare,
    *,
    kinds: Sequence[Hashable] = (),
    updates: bool,
    threads: int,
) -> list[Streamed | None]:
    """Process runs in packs of up to eight runs, and return the error sums of each run.

    The runs of a pack have the same number of states, the same time steps and the same kind of adaptation. The result
    is None for a run that the caller must repeat alone.

    Args:
        runs: timeline and scoring of each run.
        states: number of states of the filter of each run.
        rules: compiled adaptation of each run, or None for each run that is skipped.
        prepare: function that prepares the compiled loop for a pack.
        kinds: for each run, an additional property that must be equal in a pack, or empty without such a property.
        updates: whether the results contain the innovation, the NIS and R of each update.
        threads: maximum number of packs that are processed at the same time.
    """
    results: list[Streamed | None] = [None] * len(runs)

    def run_pack(pack: Pack) -> None:
        marks = int(pack.scored.mark.max()) + 1 if any(map(len, pack.marks)) else 0
        output = new_output(visits=0, marks=marks, updates=len(pack.update_s) * updates)
        state = _call(prepare, pack, [rule for k in pack.lanes if (rule := rules[k])], output)
        for index, result in zip(pack.members, _results_of(pack, state, output), strict=False):
            results[index] = result

    grouped: list[Kind | None] = [
        None if rule is None else ((s, kind, rule.group(s)), wants_truth(rule.adaptation))
        for s, kind, rule in zip(states, kinds or states, rules, strict=True)
    ]
    packs = _packs(tuple(runs), tuple(grouped))
    if threads <= 1 or len(packs) <= 1:
        for pack in packs:
            run_pack(pack)
    else:
        list(_pool(threads).map(run_pack, packs))
    return results


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Return a thread pool. The pool is cached, because starting the threads takes as long as a run."""
    return ThreadPoolExecutor(threads, "jerkbench-runs")


_packs = lru_cache(maxsize=2)(pack_runs)  # the next filter reuses the packs; 150 s at 100 Hz need 10 MB of memory


def _results_of(pack: Pack, state: Any, output: Output) -> list[Streamed | None]:  # noqa: ANN401 - a record
    """Return the error sums of each run of a pack, with NaN for sums that no metric reads.

    The result is None for a run that stopped early or whose state or sums are not finite.
    """
    results: list[Streamed | None] = [None] * len(pack.members)
    sums = state["sums"].T.copy()
    healthy = np.isfinite(sums).all(axis=1) & np.isfinite(state["x"]).all(axis=0) & (state["stopped"][0] == 0.0)
    sums[:, OF_COVARIANCE * (not pack.scored.consistency) + OF_VELOCITY * (not pack.scored.speeds)] = math.nan
    for lane in np.flatnonzero(healthy[: len(results)]).tolist():
        errors, seen = output.errors[pack.marks[lane], :, lane], output.seen[:, :, lane]
        mine = np.flatnonzero(seen[:, SEEN_ROWS] > 0)
        results[lane] = Streamed.of(sums[lane], errors, _updates_of(pack.update_s[mine], seen[mine]))
    return results
