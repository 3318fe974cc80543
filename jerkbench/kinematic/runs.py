"""Python functions that call the compiled loop, for one run with its trajectory or for a batch in packs of eight.

The filters and runs of a pack are converted to arrays. All runs of a pack have the same time steps.
"""

import math
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache, cached_property, lru_cache, partial
from hashlib import blake2b
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, IntArray, Keyed, Same
from jerkbench.compilation.compiled import Compilation, compile_all
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.contracts import Adaptation, Filter, axis_models, wants_truth
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
    Model,
    Output,
    Scoring,
    Steps,
    new_output,
    new_state,
    record_layout,
)
from jerkbench.kinematic.loop import loop_for
from jerkbench.kinematic.rules import Rule, compilations_of, rules_of
from jerkbench.timeline import VARIANCE_FLOOR, Run, ScaledMeasurements, Timeline


def _is_frozen(model: Filter) -> bool:
    """Return whether the filter is a frozen dataclass. Only the arrays of frozen dataclasses are cached."""
    return bool(getattr(getattr(model, "__dataclass_params__", None), "frozen", False))


def _arrays_of(model: Filter, lengths_s: bytes, dt0_s: float) -> Model:
    """Return the arrays A, b and Q of one filter for each step length.

    If a step length is not positive, its transition matrix A is the identity matrix.
    """
    return Model(*(stack_runs([array]) for array in axis_models(model, np.frombuffer(lengths_s), dt0_s)))


_cached_arrays: Callable[..., Model] = lru_cache(maxsize=32)(_arrays_of)


# Packs of runs with the same time steps.


class Pack(NamedTuple):
    """A pack of up to WIDE runs, which one call of the compiled loop processes.

    If a pack has fewer than WIDE (eight) runs, the arrays contain copies of the last run.

    Attributes:
        steps: the time steps and measurements of all runs of the pack.
        scored: the true values and error weights of all runs of the pack.
        lengths_s: the distinct step lengths [s].
        dt0_s: nominal length of a step [s].
        update_s: (m,) times at which at least one run has an update [s].
        marks: for each run, the rows of `Output.errors` that contain errors of this run.
        members: indices of the runs of this pack in the batch.
        timelines: timelines of the WIDE runs, including the copies of the last run.
    """

    steps: Steps
    scored: Scoring
    lengths_s: FloatArray
    dt0_s: float
    update_s: FloatArray
    marks: tuple[IntArray, ...]
    members: tuple[int, ...] = ()
    timelines: tuple[Timeline, ...] = ()

    @property
    def lanes(self) -> tuple[int, ...]:
        """Indices (WIDE,) of the runs of this pack in the batch, including the copies of the last run."""
        return (*self.members, *[self.members[-1]] * (WIDE - len(self.members)))

    def kinematic(self, models: Sequence[Filter]) -> tuple[Model, dict[str, FloatArray]]:
        """Return A, b and Q of the filters of this pack, and the initial states x and their covariances P.

        The argument ``models`` contains the filters of all runs of a batch. All filters of a pack must have the same
        number of states.
        """
        filters, key = [models[k] for k in self.lanes], (self.lengths_s.tobytes(), self.dt0_s)
        arrays = [(_cached_arrays if _is_frozen(model) else _arrays_of)(model, *key) for model in filters]
        if not all(model is filters[0] or model == filters[0] for model in filters):
            arrays[0] = Model(
                *(stack_runs([stream[..., 0] for stream in streams]) for streams in zip(*arrays, strict=True))
            )
        extra = stack_runs([np.repeat(model.initial_variances(), 3) for model in filters])
        s = 6 + len(extra)
        P = np.zeros((s, s, WIDE))
        P[:6, :6], P[range(6, s), range(6, s)] = stack_runs([timeline.P0 for timeline in self.timelines]), extra
        return arrays[0], {"x": stack_runs([timeline.x0 for timeline in self.timelines]), "P": P}


Kind = tuple[Hashable, bool]
"""Properties that must be equal in all runs of a pack, in addition to the time steps of the runs.

The first element contains the number of states and all other properties that select the compiled loop. The second
element is true if the adaptation receives the true covariance as R.
"""


def pack_runs(runs: Sequence[Run], kinds: Sequence[Kind | None]) -> list[Pack]:
    """Return packs of runs that have the same kind, time steps, reference time stamps and error weights.

    A run whose kind is None is not in any pack.
    """
    groups: dict[tuple[Kind, _Grid], list[int]] = {}
    lanes = [_Lane(run) for run in runs]
    for index, (lane, kind) in enumerate(zip(lanes, kinds, strict=True)):
        if kind is not None:
            groups.setdefault((kind, _grid(lane)), []).append(index)
    return [
        _pack(lanes, members, wants_truth=kind[1])
        for (kind, _), indices in groups.items()
        for members in _members(lanes, indices)
    ]


SPARE = 2
"""Maximum number of unused places in a pack with runs of only one recording.

Filling these places with runs of another recording would take longer, because the arrays would have to be stacked.
"""


def _members(lanes: Sequence["_Lane"], indices: Sequence[int]) -> list[tuple[int, ...]]:
    """Divide the run indices ``indices`` into groups of at most WIDE runs.

    As many groups as possible contain runs on only one recording, because all runs of such a group share the same
    arrays. If possible, each remaining group contains one run on each of WIDE recordings. The order of the recordings
    is the same in all groups of this type, so that their stacked arrays can be reused.
    """
    by_inputs: dict[_Lane, list[int]] = {}
    for index in indices:
        by_inputs.setdefault(lanes[index], []).append(index)
    cut = [(runs, len(runs) if -len(runs) % WIDE <= SPARE else len(runs) // WIDE * WIDE) for runs in by_inputs.values()]
    full = [runs[:end] for runs, end in cut]
    left = [runs[end:] for runs, end in cut if end < len(runs)]
    rest: list[int] = []
    for some in (left[k : k + WIDE] for k in range(0, len(left), WIDE)):
        turns = zip_longest(*some) if len(some) == WIDE else some
        rest += [index for turn in turns for index in turn if index is not None]
    return [tuple(runs[begin : begin + WIDE]) for runs in (*full, rest) for begin in range(0, len(runs), WIDE)]


class _Lane(Same):
    """A run. Two runs are equal if the arrays of their inputs are the same objects, except the factors on R.

    Therefore runs on the same recording with different factors on R are equal, and their arrays are stacked only once,
    because stacking the arrays takes longer than a run.
    """

    def __init__(self, run: Run) -> None:
        t, self.run, self.reported = run.timeline, run, run.timeline.measurements
        self.scale = _AS_REPORTED if self.reported.unfloored is None else FLOORED  # column of `Steps.scale`
        if isinstance(self.reported, ScaledMeasurements):
            self.scale = np.array([self.reported.position, self.reported.velocity, VARIANCE_FLOOR])
            self.reported = self.reported.reported
        arrays = (t.dt_s, t.sample, t.update, t.reference, t.accel_enu_mps2, t.measurements.z)
        super().__init__(*arrays, run.scoring, self.reported)


_AS_REPORTED, FLOORED = np.array([1.0, 1.0, -np.inf]), np.array([1.0, 1.0, VARIANCE_FLOOR])


class _Grid(Keyed):
    """The time steps and weights that all runs of a pack share.

    Two grids are equal if the hashes of their arrays are equal. The attributes ``reference`` and ``weights`` have the
    same meaning as in `Steps` and `Scoring`. All packs with equal grids use the same array objects.
    """

    def __init__(self, lane: _Lane) -> None:
        t, s = self.timeline, self.scoring = lane.run
        numbers = np.array([t.dt0_s, s.consistency, s.limit_m])
        shared = (numbers, t.dt_s, t.sample, t.reference, s.counted, s.with_burn_in, s.moving)
        super().__init__(blake2b(b"|".join(np.ascontiguousarray(array).tobytes() for array in shared)).digest())

    @cached_property
    def reference(self) -> IntArray:
        return numbered(len(self.timeline.reference), np.flatnonzero(self.timeline.reference >= 0).tobytes())

    @cached_property
    def weights(self) -> FloatArray:
        s = self.scoring
        return np.column_stack([s.counted, s.with_burn_in, s.moving, s.counted * s.moving])


_same_grid: Callable[[_Grid], _Grid] = lru_cache(maxsize=64)(lambda grid: grid)


@lru_cache(maxsize=64)  # each grid with its cached arrays needs up to 1 MB
def _grid(lane: _Lane) -> _Grid:
    """Return the grid of a run, or an equal grid from the cache."""
    return _same_grid(_Grid(lane))


@lru_cache(maxsize=32)
def numbered(length: int, indices: bytes) -> IntArray:
    """Return an array (length,) with the values 0, 1, 2, ... at ``indices`` (int64), and -1 elsewhere."""
    numbers, at = np.full(length, -1, dtype=np.int64), np.frombuffer(indices, dtype=np.int64)
    numbers[at] = np.arange(len(at))
    return numbers


def _pack(of_runs: Sequence[_Lane], members: tuple[int, ...], *, wants_truth: bool) -> Pack:
    lanes = [of_runs[index] for index in members]
    lanes += [lanes[-1]] * (WIDE - len(lanes))
    distinct = tuple(dict.fromkeys(lanes))
    shared = _one_stream(distinct, wants_truth) if len(distinct) == 1 else _streams(tuple(lanes), wants_truth)
    steps = shared.steps._replace(scale=stack_runs([lane.scale for lane in lanes]))
    marks, timelines = shared.marks * (WIDE // len(shared.marks)), tuple(lane.run.timeline for lane in lanes)
    return shared._replace(steps=steps, marks=marks, members=members, timelines=timelines)


def _stacked_streams(lanes: tuple[_Lane, ...], wants_truth: bool) -> Pack:
    """Return a pack with the stacked arrays of the runs, but without ``members``, ``timelines`` and factors on R."""
    runs, grid, none = [lane.run for lane in lanes], _grid(lanes[0]), np.empty((0, 6, 6, 1))
    timeline, (lengths_s, model) = grid.timeline, grid.timeline.lengths
    updated = np.flatnonzero(np.any([run.timeline.update >= 0 for run in runs], axis=0))
    update_s = runs[0].timeline.t_s[updated]
    marks = np.unique(np.concatenate([run.scoring.marks for run in runs]))

    def at_updates(rows: Callable[[_Lane], FloatArray], nothing: float) -> FloatArray:
        return stack_runs([_at_updates(lane.run, updated, rows(lane), nothing) for lane in lanes])

    steps = Steps(
        model,
        np.require(timeline.sample, np.int64, ["C", "W", "A"]),
        numbered(len(model), updated.tobytes()),
        grid.reference,
        stack_runs([run.timeline.accel_enu_mps2 for run in runs]),
        at_updates(lambda lane: lane.run.timeline.measurements.z, math.nan),
        at_updates(lambda lane: lane.reported.R_true, 0.0) if wants_truth else none,
        at_updates(lambda lane: lane.reported.as_reported, 0.0),
        none[..., 0, 0],
    )
    of_runs = tuple(np.searchsorted(marks, run.scoring.marks) for run in runs)
    return Pack(steps, _truth_rows(runs, marks, update_s, grid.weights), lengths_s, timeline.dt0_s, update_s, of_runs)


_streams = lru_cache(maxsize=16)(_stacked_streams)  # each entry needs about 10 MB
_one_stream = lru_cache(maxsize=128)(_stacked_streams)  # each entry needs about 1 MB


def _truth_rows(runs: Sequence[Run], marks: IntArray, update_s: FloatArray, weights: FloatArray) -> Scoring:
    scorings = [run.scoring for run in runs]
    first, outage = scorings[0], stack_runs([scoring.outage[:, None] for scoring in scorings])
    return Scoring(
        numbered(len(first.truth), marks.tobytes()),
        stack_runs([(update_s >= scoring.start_s).astype(np.float64)[:, None] for scoring in scorings]),
        stack_runs([scoring.truth for scoring in scorings]),
        weights,
        outage if outage.any() else outage[:0],
        bool(first.moving.any()),
        first.consistency,
        first.limit_m * first.limit_m,
    )


def stack_runs(parts: Sequence[FloatArray]) -> FloatArray:
    """Stack the arrays of all runs along a new last axis, in contiguous memory, as compiled signatures require."""
    if len(parts) == 1:
        return np.require(parts[0][..., None], requirements=["C", "W", "A"])
    stacked = aligned_zeros(*parts[0].shape, len(parts))  # np.stack takes twice as long for small arrays
    for k, part in enumerate(parts):
        stacked[..., k] = part
    return stacked


def _at_updates(run: Run, updated: IntArray, rows: FloatArray, nothing: float) -> FloatArray:
    """Return the rows of a run at each update of its pack.

    If the run has no update at the time of an update of the pack, the row contains the value ``nothing``.
    """
    which = run.timeline.update[updated]
    found = np.full((len(which), *rows.shape[1:]), nothing)
    found[which >= 0] = rows[which[which >= 0]]
    return found


# The calls of the compiled loop.

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
        # A pack contains only runs with a rule, so the condition only narrows the type.
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
