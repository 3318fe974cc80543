"""Conversion of filters and runs to arrays for the compiled loop, in packs of up to eight runs with equal steps."""

import math
from collections.abc import Callable, Hashable, Sequence
from functools import cached_property, lru_cache
from hashlib import blake2b
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, IntArray, Keyed, Same
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.contracts import Filter, axis_models
from jerkbench.kinematic.arguments import Model, Scoring, Steps
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
