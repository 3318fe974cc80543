"""What runs are made of before they begin: models of all lengths of a step, and runs of the same steps in vectors."""

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from hashlib import blake2b
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, IntArray, Keyed, Same
from jerkbench.compilation.vectors import aligned_room
from jerkbench.contracts import Filter, axis_models
from jerkbench.kinematic.arguments import Model, Steps, TruthRows
from jerkbench.timeline import VARIANCE_FLOOR, Measurements, Run, ScaledMeasurements, Timeline, axes_apart


def model_of(models: Sequence[Filter], lengths_s: FloatArray, dt0_s: float) -> Model:
    """Ask the filter of each run for A, b, Q of each length, and for the start; all have as many states."""
    few = len(lengths_s) <= FEW_LENGTHS and all(map(_is_frozen, models))
    return (_known_of_several if few else _of_several)(tuple(models), lengths_s.tobytes(), dt0_s)


def _of_several(models: Sequence[Filter], lengths_s: bytes, dt0_s: float) -> Model:
    shared = all(model is models[0] or model == models[0] for model in models)
    own = [(_known if _is_frozen(of) else _asked)(of, lengths_s, dt0_s) for of in (models[:1] if shared else models)]
    if shared:
        return own[0]._replace(extra=np.repeat(own[0].extra, len(models), axis=1))
    A, b, Q, extra = (_stack([part[..., 0] for part in parts]) for parts in zip(*(of[:4] for of in own), strict=True))
    return Model(A, b, Q, extra, all(of.triangular for of in own))


def _is_frozen(model: Filter) -> bool:
    """Whether it cannot change, so that it is asked once."""
    return bool(getattr(getattr(model, "__dataclass_params__", None), "frozen", False))


def _asked(model: Filter, lengths_s: bytes, dt0_s: float) -> Model:
    """Ask for the arrays of each length; of one that is not positive A is the identity."""
    extra, lengths = np.array(model.initial_variances(), dtype=np.float64), np.frombuffer(lengths_s)
    A, b, Q = axis_models(model, lengths, dt0_s)
    k, n = b.shape
    own = [_stack([part]) for part in (A.reshape(k, n * n), b, Q.reshape(k, n * n), extra)]
    return Model(own[0], own[1], own[2], own[3], triangular(A))


FEW_LENGTHS = 64
"""So many lengths even steps have at most. They are the same for all packs; uneven ones each seed has of its own."""


_known: Callable[..., Model] = lru_cache(maxsize=32)(_asked)
_known_of_several: Callable[..., Model] = lru_cache(maxsize=256)(_of_several)
"""The settings of a search come together again for each seed."""


def triangular(A: FloatArray) -> bool:
    """Whether each of (k, n, n) is upper triangular with ones on its diagonal."""
    return bool((np.tril(A) == np.eye(A.shape[1])).all())


# Runs of the same steps, packed into vectors.


@dataclass(frozen=True, eq=False)
class Pack:
    """Up to WIDE runs.

    Attributes:
        members: their places in the batch.
        timelines: theirs.
        steps: all of them in vectors; a vector that is not full repeats its last run.
        scored: likewise.
        lengths_s: the lengths of steps that come, for the model.
        update_s: (m,) times of the updates, of any run.
        marks: for each run, the rows of the kept errors that are its own.
        apart: whether axes have nothing to do with each other, but for the adaptation, and errors alone are asked for.
    """

    members: tuple[int, ...]
    timelines: tuple[Timeline, ...]
    steps: Steps
    scored: TruthRows
    lengths_s: FloatArray
    update_s: FloatArray
    marks: tuple[IntArray, ...]
    apart: bool


def together(pack: Pack) -> Pack:
    """Return the same pack for a loop in which axes have to do with each other."""
    reported = np.zeros((len(pack.steps.z), 36, pack.steps.reported.shape[2]))
    reported[:, OF_AXES] = pack.steps.reported
    return replace(pack, steps=pack.steps._replace(reported=reported), apart=False)


class Kind(NamedTuple):
    """What runs of one pack have in common besides their steps.

    Attributes:
        size: of the state, and what else the loop is compiled for.
        wants_truth: whether the adaptation gets the true covariance as R.
        dense: whether it sees whole matrices.
        by_axes: whether each axis may be gone over by itself.
    """

    size: Hashable
    wants_truth: bool
    dense: bool
    by_axes: bool


def pack_runs(runs: Sequence[Run], kinds: Sequence[Kind]) -> list[Pack]:
    """Pack runs of the same kind whose steps have the same lengths and meet the reference at the same places."""
    alike: dict[tuple[Kind, _Ground, bool], list[int]] = {}
    lanes = [_Lane(_Course(run), *_told(run)) for run in runs]
    starts = axes_apart(np.reshape([run.timeline.P0 for run in runs], (-1, 6, 6))).tolist()
    for place, (run, lane, kind, start) in enumerate(zip(runs, lanes, kinds, starts, strict=True)):
        errors_alone = kind.by_axes and not kind.wants_truth and not run.scoring.consistency
        apart = errors_alone and start and lane.reported.apart
        alike.setdefault((kind, _ground(lane.course), apart), []).append(place)
    return [
        _pack(lanes, members, wants_truth=kind.wants_truth, apart=apart)
        for (kind, _, apart), places in alike.items()
        for members in _members(lanes, places)
    ]


SPARE = 2
"""So many lanes may stay empty: to stack other recordings takes longer."""


def _members(lanes: Sequence["_Lane"], places: Sequence[int]) -> list[tuple[int, ...]]:
    """The places by WIDE: vectors of one recording, which their lanes share, then what is left of each recording.

    Of WIDE recordings one each, so that the next ones meet the same in the same lanes, whose streams are stacked then.
    """
    of_course: dict[_Course, list[int]] = {}
    for place in places:
        of_course.setdefault(lanes[place].course, []).append(place)
    cut = [(own, len(own) if -len(own) % WIDE <= SPARE else len(own) // WIDE * WIDE) for own in of_course.values()]
    whole = [own[:end] for own, end in cut]
    left = [own[end:] for own, end in cut if end < len(own)]
    rest: list[int] = []
    for some in (left[k : k + WIDE] for k in range(0, len(left), WIDE)):
        turns = zip_longest(*some) if len(some) == WIDE else some
        rest += [place for turn in turns for place in turn if place is not None]
    return [tuple(own[begin : begin + WIDE]) for own in (*whole, rest) for begin in range(0, len(own), WIDE)]


class _Course(Same):
    """A run without its covariances; the same as another if it has the same arrays, not only the same numbers.

    Settings that are told another R of one recording have one course; to stack it takes longer than to run over it.
    """

    def __init__(self, run: Run) -> None:
        t, self.run = run.timeline, run
        super().__init__(t.dt_s, t.sample, t.update, t.reference, t.accel_enu_mps2, t.measurements.z, run.scoring)


class _Lane(NamedTuple):
    """A run, what was reported to it, and what of `Steps.told` it makes of that."""

    course: _Course
    reported: Measurements
    told: FloatArray


class _Ground(Keyed):
    """What runs of one pack have in common: their steps, and which of them count; the same as another's by its hash.

    Its arrays are as in `Steps` and `TruthRows`. All packs on one ground share them, so that they stay in the cache.
    """

    def __init__(self, course: _Course) -> None:
        t, s = self.timeline, self.scoring = course.run.timeline, course.run.scoring
        numbers = np.array([t.dt0_s, s.consistency, s.limit_m])
        shared = (numbers, t.dt_s, t.sample, t.reference, s.counted, s.whole, s.moving)
        super().__init__(blake2b(b"|".join(np.ascontiguousarray(array).tobytes() for array in shared)).digest())

    @cached_property
    def reference(self) -> IntArray:
        return _numbered(len(self.timeline.reference), np.flatnonzero(self.timeline.reference >= 0).tobytes())

    @cached_property
    def weights(self) -> FloatArray:
        s = self.scoring
        return np.column_stack([s.counted, s.whole, s.moving, s.counted * s.moving])


_same_ground: Callable[[_Ground], _Ground] = lru_cache(maxsize=64)(lambda ground: ground)


@lru_cache(maxsize=64)  # with what is cached of it up to a MB each, of equal ones once
def _ground(course: _Course) -> _Ground:
    """Return the ground of a run: the one that is known, if there is an equal one."""
    return _same_ground(_Ground(course))


@lru_cache(maxsize=32)
def _numbered(length: int, places: bytes) -> IntArray:
    """(length,) 0, 1, 2, ... at ``places`` (int64), -1 elsewhere."""
    numbers, at = np.full(length, -1, dtype=np.int64), np.frombuffer(places, dtype=np.int64)
    numbers[at] = np.arange(len(at))
    return numbers


class _Stacked(NamedTuple):
    """What the lanes of a pack have, whatever they start from and make of R; as in `Pack` and `Steps`."""

    model: IntArray
    sample: IntArray
    update: IntArray
    reference: IntArray
    u: FloatArray
    z: FloatArray
    R: FloatArray
    reported: FloatArray
    scored: TruthRows
    lengths_s: FloatArray
    updated: IntArray
    marks: tuple[IntArray, ...]


def _pack(of_runs: Sequence["_Lane"], members: tuple[int, ...], *, wants_truth: bool, apart: bool) -> Pack:
    lanes = [of_runs[place] for place in members]
    lanes += [lanes[-1]] * (WIDE - len(lanes))
    streams = tuple((lane.course, lane.reported) for lane in lanes)
    alike = tuple(dict.fromkeys(streams))
    shared = _one_stream(alike, wants_truth, apart) if len(alike) == 1 else _streams(streams, wants_truth, apart)
    timelines = tuple(lane.course.run.timeline for lane in lanes)
    steps = Steps(
        *shared[:8],
        _stack([lane.told for lane in lanes]),
        _stack([timeline.x0 for timeline in timelines]),
        _stack([timeline.P0.ravel() for timeline in timelines]),
    )
    update_s = timelines[0].t_s[shared.updated]
    marks = shared.marks * (WIDE // len(shared.marks))
    return Pack(members, timelines, steps, shared.scored, shared.lengths_s, update_s, marks, apart)


def _stacked_streams(streams: tuple[tuple[_Course, Measurements], ...], wants_truth: bool, apart: bool) -> _Stacked:
    lanes = [course.run for course, _ in streams]
    first, ground = lanes[0].timeline, _ground(streams[0][0])
    lengths_s, model = ground.timeline.lengths
    updated = np.flatnonzero(np.any([run.timeline.update >= 0 for run in lanes], axis=0))
    marks = np.unique(np.concatenate([run.scoring.marks for run in lanes]))
    columns = OF_AXES if apart else slice(None)

    def covariances(of: Callable[[Measurements], FloatArray]) -> FloatArray:
        rows = ((course.run, of(measured).reshape(-1, 36)[:, columns]) for course, measured in streams)
        return _stack([_at_updates(run, updated, R, 0.0) for run, R in rows])

    return _Stacked(
        model,
        np.require(ground.timeline.sample, np.int64, ["C", "W", "A"]),
        _numbered(len(model), updated.tobytes()),
        ground.reference,
        _stacked(lanes, lambda run: run.timeline.accel_enu_mps2),
        _stacked(lanes, lambda run: _at_updates(run, updated, run.timeline.measurements.z, math.nan)),
        covariances(lambda measured: measured.R_true) if wants_truth else np.empty((0, 36, 1)),
        covariances(lambda measured: measured.as_reported),
        _truth_rows(lanes, marks, first.t_s[updated], ground.weights),
        lengths_s,
        updated,
        tuple(np.searchsorted(marks, run.scoring.marks) for run in lanes),
    )


_streams = lru_cache(maxsize=16)(_stacked_streams)  # some 10 MB each
_one_stream = lru_cache(maxsize=128)(_stacked_streams)  # a tenth of that


def _truth_rows(lanes: Sequence[Run], marks: IntArray, update_s: FloatArray, weights: FloatArray) -> TruthRows:
    first, outage = lanes[0].scoring, _stacked(lanes, lambda run: run.scoring.outage)
    return TruthRows(
        _numbered(len(first.truth), marks.tobytes()),
        _stacked(lanes, lambda run: (update_s >= run.scoring.start_s).astype(np.float64)),
        _stacked(lanes, lambda run: run.scoring.truth),
        weights,
        outage if outage.any() else outage[:0],
        bool(first.moving.any()),
        first.consistency,
        first.limit_m * first.limit_m,
    )


def _stacked(lanes: Sequence[Run], part: Callable[[Run], FloatArray]) -> FloatArray:
    return _stack([part(run) for run in lanes])


def _stack(parts: Sequence[FloatArray]) -> FloatArray:
    """One vector of each element; a compiled signature is exact, so it is contiguous and may be written."""
    if len(parts) == 1:
        return np.require(parts[0][..., None], requirements=["C", "W", "A"])
    stacked = aligned_room(*parts[0].shape, len(parts))  # `np.stack` takes twice as long for a few numbers
    for k, part in enumerate(parts):
        stacked[..., k] = part
    return stacked


def _at_updates(run: Run, updated: IntArray, rows: FloatArray, nothing: float) -> FloatArray:
    """Return one of the ``rows`` for each update of the pack, ``nothing`` where the run has none."""
    which = run.timeline.update[updated]
    found = np.full((len(which), rows.shape[1]), nothing)
    found[which >= 0] = rows[which[which >= 0]]
    return found


OF_AXES = [6 * r + c for r in range(6) for c in (r % 3, r % 3 + 3)]
"""Which elements of R are of one axis."""

_AS_REPORTED, FLOORED = np.array([1.0, 1.0, -np.inf]), np.array([1.0, 1.0, VARIANCE_FLOOR])


def _told(run: Run) -> tuple[Measurements, FloatArray]:
    """What was reported to a run, and what of `Steps.told` it makes of it."""
    measured = run.timeline.measurements
    if isinstance(measured, ScaledMeasurements):
        return measured.reported, np.array([measured.position, measured.velocity, VARIANCE_FLOOR])
    return measured, _AS_REPORTED if measured.unfloored is None else FLOORED
