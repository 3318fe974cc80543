"""Runs of the same steps, packed into vectors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.batch import Run
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.lanes.arguments import LaneSteps
from jerkbench.engines.compiled.models import step_lengths
from jerkbench.timeline.timeline import Timeline

LOWER = np.tril_indices(6)


@dataclass(frozen=True, eq=False)
class Pack:
    """Up to WIDTH runs.

    Attributes:
        members: their places in the batch.
        timelines: theirs.
        steps: all of them in vectors; a vector that is not full repeats its last run.
        lengths_s: the lengths of steps that come, for the model.
        update_s: (m,) times of the updates, of any run.
        marks: for each run, the rows of the kept errors that are its own.
    """

    members: tuple[int, ...]
    timelines: tuple[Timeline, ...]
    steps: LaneSteps
    lengths_s: FloatArray
    update_s: FloatArray
    marks: tuple[IntArray, ...]


def pack_runs(runs: Sequence[Run], truth: bool) -> list[Pack]:
    """Pack runs whose steps have the same lengths and meet the reference at the same places.

    Args:
        runs: in any order; one whose R is not symmetric is in no pack, because a pack keeps half of it.
        truth: whether the adaptation gets the true covariance as R.
    """
    alike: dict[bytes, list[int]] = {}
    for place, run in enumerate(runs):
        if _symmetric(run, truth=truth):
            alike.setdefault(_structure(run), []).append(place)
    return [
        _pack(runs, tuple(places[begin : begin + WIDTH]), truth=truth)
        for places in alike.values()
        for begin in range(0, len(places), WIDTH)
    ]


def _symmetric(run: Run, *, truth: bool) -> bool:
    measured = run.timeline.measurements
    covariances = [measured.R, measured.R_true] if truth else [measured.R]
    both = [(R, R.swapaxes(1, 2)) for R in covariances]
    return all(np.array_equal(*two) or np.isclose(*two, rtol=1e-12, atol=0.0, equal_nan=True).all() for two in both)


def _structure(run: Run) -> bytes:
    """What runs of one pack have in common, as bytes."""
    t, s = run.timeline, run.scoring
    shared = (t.dt_s, t.sample, t.reference, s.counted, s.whole, s.moving)
    return b"".join(np.ascontiguousarray(array).tobytes() for array in shared)


def _pack(runs: Sequence[Run], members: tuple[int, ...], *, truth: bool) -> Pack:
    lanes = [runs[place] for place in members]
    lanes += [lanes[-1]] * (WIDTH - len(lanes))
    first = lanes[0]
    lengths_s, model = step_lengths(first.timeline.dt_s)
    updated = np.flatnonzero(np.any([run.timeline.update >= 0 for run in lanes], axis=0))
    update, reference, visited = _numbered(len(model), updated), *_visited(first.timeline.reference)
    marks = np.unique(np.concatenate([run.scoring.marks for run in lanes]))
    measured = [_measured(run, updated, truth=truth) for run in lanes]
    z, kept, given, reported = zip(*measured, strict=True)
    update_s = first.timeline.t_s[updated]
    steps = LaneSteps(
        model,
        first.timeline.sample.astype(np.int64),
        update,
        reference,
        _numbered(visited, marks),
        np.all(kept, axis=(0, 2)).astype(np.int64),
        _stacked(lanes, lambda run: run.timeline.accel_enu_mps2),
        _stack(z),
        _stack(kept),
        _stack(given) if truth else np.empty((0, 21, WIDTH)),
        _stack(reported),
        _stacked(lanes, lambda run: (update_s >= run.scoring.start_s).astype(np.float64)),
        _stacked(lanes, lambda run: run.scoring.truth),
        np.column_stack([first.scoring.counted, first.scoring.whole, first.scoring.moving, _both(first)]),
        _outages(lanes),
        _stacked(lanes, lambda run: run.timeline.x0),
        _stacked(lanes, lambda run: run.timeline.P0.ravel()),
    )
    own = tuple(np.searchsorted(marks, run.scoring.marks) for run in lanes)
    return Pack(members, tuple(run.timeline for run in lanes), steps, lengths_s, update_s, own)


def _stacked(lanes: Sequence[Run], part: Callable[[Run], FloatArray]) -> FloatArray:
    return _stack([part(run) for run in lanes])


def _stack(parts: Sequence[FloatArray]) -> FloatArray:
    """One vector of each element; a compiled signature wants it contiguous."""
    return np.ascontiguousarray(np.stack(parts, axis=-1))


def _both(run: Run) -> FloatArray:
    return run.scoring.counted * run.scoring.moving


def _outages(lanes: Sequence[Run]) -> FloatArray:
    """(k, WIDTH), or no row where no run has one."""
    outage = _stacked(lanes, lambda run: run.scoring.outage)
    return outage if outage.any() else outage[:0]


def _numbered(length: int, places: IntArray) -> IntArray:
    """(length,) 0, 1, 2, ... at ``places``, -1 elsewhere."""
    numbers = np.full(length, -1, dtype=np.int64)
    numbers[places] = np.arange(len(places))
    return numbers


def _visited(reference: IntArray) -> tuple[IntArray, int]:
    """Number the visited rows of the reference; returns the steps' numbers, and how many there are."""
    there = reference >= 0
    return np.where(there, np.cumsum(there) - 1, -1).astype(np.int64), int(there.sum())


def _measured(run: Run, updated: IntArray, *, truth: bool) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """z, kept, R and the reported R at the updates of any run of the pack."""
    which = run.timeline.update[updated]
    there, measured = which >= 0, run.timeline.measurements
    if not there.any():
        nothing, no_covariance = np.zeros((len(which), 6)), np.zeros((len(which), len(LOWER[0])))
        return nothing, nothing, no_covariance, no_covariance
    z = np.where(there[:, None], measured.z[which], np.nan)
    kept = np.isfinite(z)
    reported = measured.R[which][:, LOWER[0], LOWER[1]]
    given = measured.R_true[which][:, LOWER[0], LOWER[1]] if truth else reported
    return np.where(kept, z, 0.0), kept.astype(np.float64), given, reported
