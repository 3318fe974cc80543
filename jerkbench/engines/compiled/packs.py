"""Runs of the same steps, packed into vectors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.batch import Run
from jerkbench.compilation.vectors import WIDE
from jerkbench.engines.compiled.arguments import Score, Steps
from jerkbench.timeline.lengths import step_lengths
from jerkbench.timeline.timeline import Timeline


@dataclass(frozen=True, eq=False)
class Pack:
    """Up to WIDE runs.

    Attributes:
        members: their places in the batch.
        timelines: theirs.
        steps: all of them in vectors; a vector that is not full repeats its last run.
        score: likewise.
        lengths_s: the lengths of steps that come, for the model.
        update_s: (m,) times of the updates, of any run.
        marks: for each run, the rows of the kept errors that are its own.
    """

    members: tuple[int, ...]
    timelines: tuple[Timeline, ...]
    steps: Steps
    score: Score
    lengths_s: FloatArray
    update_s: FloatArray
    marks: tuple[IntArray, ...]


class Kind(NamedTuple):
    """What runs of one pack have in common besides their steps.

    Attributes:
        n: quantities on each axis.
        wants_truth: whether the adaptation gets the true covariance as R.
    """

    n: int
    wants_truth: bool


def pack_runs(runs: Sequence[Run], kinds: Sequence[Kind]) -> list[Pack]:
    """Pack runs of the same kind whose steps have the same lengths and meet the reference at the same places."""
    alike: dict[tuple[Kind, bytes], list[int]] = {}
    for place, (run, kind) in enumerate(zip(runs, kinds, strict=True)):
        alike.setdefault((kind, _structure(run)), []).append(place)
    return [
        _pack(runs, tuple(places[begin : begin + WIDE]), wants_truth=kind.wants_truth)
        for (kind, _), places in alike.items()
        for begin in range(0, len(places), WIDE)
    ]


def _structure(run: Run) -> bytes:
    """What runs of one pack have in common, as bytes."""
    t, s = run.timeline, run.scoring
    shared = (np.array([t.dt0_s]), t.dt_s, t.sample, t.reference, s.counted, s.whole, s.moving)
    return b"".join(np.ascontiguousarray(array).tobytes() for array in shared)


def _pack(runs: Sequence[Run], members: tuple[int, ...], *, wants_truth: bool) -> Pack:
    lanes = [runs[place] for place in members]
    lanes += [lanes[-1]] * (WIDE - len(lanes))
    first = lanes[0]
    lengths_s, model = step_lengths(first.timeline.dt_s)
    updated = np.flatnonzero(np.any([run.timeline.update >= 0 for run in lanes], axis=0))
    z, given, reported = zip(*[_measured(run, updated, wants_truth=wants_truth) for run in lanes], strict=True)
    steps = Steps(
        model,
        first.timeline.sample.astype(np.int64),
        _numbered(len(model), updated),
        _numbered(len(model), np.flatnonzero(first.timeline.reference >= 0)),
        _stacked(lanes, lambda run: run.timeline.accel_enu_mps2),
        _stack(z),
        _stack(given),
        _stack(reported),
        _stacked(lanes, lambda run: run.timeline.x0),
        _stacked(lanes, lambda run: run.timeline.P0.ravel()),
    )
    update_s = first.timeline.t_s[updated]
    marks = np.unique(np.concatenate([run.scoring.marks for run in lanes]))
    own = tuple(np.searchsorted(marks, run.scoring.marks) for run in lanes)
    score = _score(lanes, marks, update_s)
    return Pack(members, tuple(run.timeline for run in lanes), steps, score, lengths_s, update_s, own)


def _score(lanes: Sequence[Run], marks: IntArray, update_s: FloatArray) -> Score:
    first = lanes[0].scoring
    return Score(
        _numbered(len(first.truth), marks),
        _stacked(lanes, lambda run: (update_s >= run.scoring.start_s).astype(np.float64)),
        _stacked(lanes, lambda run: run.scoring.truth),
        np.column_stack([first.counted, first.whole, first.moving, first.counted * first.moving]),
        _outages(lanes),
    )


def _stacked(lanes: Sequence[Run], part: Callable[[Run], FloatArray]) -> FloatArray:
    return _stack([part(run) for run in lanes])


def _stack(parts: Sequence[FloatArray]) -> FloatArray:
    """One vector of each element; a compiled signature wants it contiguous."""
    return np.ascontiguousarray(np.stack(parts, axis=-1))


def _outages(lanes: Sequence[Run]) -> FloatArray:
    """(k, WIDE), or no row where no run has one."""
    outage = _stacked(lanes, lambda run: run.scoring.outage)
    return outage if outage.any() else outage[:0]


def _numbered(length: int, places: IntArray) -> IntArray:
    """(length,) 0, 1, 2, ... at ``places``, -1 elsewhere."""
    numbers = np.full(length, -1, dtype=np.int64)
    numbers[places] = np.arange(len(places))
    return numbers


def _measured(run: Run, updated: IntArray, *, wants_truth: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """z, R for the adaptation (no row where it is the reported one) and the reported R at the updates of the pack."""
    which, measured = run.timeline.update[updated], run.timeline.measurements
    there = which >= 0
    z, R = np.full((len(which), 6), np.nan), np.zeros((2, len(which), 36))
    z[there], R[0, there] = measured.z[which[there]], measured.R[which[there]].reshape(-1, 36)
    if wants_truth:
        R[1, there] = measured.R_true[which[there]].reshape(-1, 36)
    return z, R[1, : len(which) if wants_truth else 0], R[0]
