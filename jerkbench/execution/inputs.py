"""The inputs that all filters of a sweep share: recording, attitude, timeline; made once for each process."""

import hashlib
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import cast

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.cells.data import require_data
from jerkbench.contracts import AttitudeFilter, Dataset, Disturbance, Metric
from jerkbench.estimate import Attitude, Estimate, no_attitude
from jerkbench.evaluation.batch_scoring import Scored, outlined, scored
from jerkbench.execution.simulation_cache import simulated
from jerkbench.optional import part_read
from jerkbench.recording import Recording
from jerkbench.timeline.timeline import Timeline, build_timeline

KEPT = 32
"""The number of each kind that is kept; a recording of 150 s at 100 Hz has some 2 MB."""


@lru_cache(maxsize=KEPT)
def disturbed(dataset: Dataset, disturbances: tuple[Disturbance, ...], fingerprint: str, seed: int) -> Recording:
    """The recording of ``seed`` after all disturbances, in order; ``fingerprint`` tells changed files apart."""
    recording = _loaded(dataset, dataset.fingerprint(), seed)
    for disturbance in disturbances:
        recording = disturbance.apply(recording, seed)
    require_data(dataset, disturbances, fingerprint)  # afterwards: what was read meanwhile is what the hash says
    return recording


@lru_cache(maxsize=KEPT)
def _loaded(dataset: Dataset, fingerprint: str, seed: int) -> Recording:
    in_tree = type(dataset).__module__.startswith("jerkbench.")  # what others simulate may depend on anything
    if in_tree and dataset.seeded and not fingerprint:
        return simulated(dataset, seed)
    recording = dataset.load(seed)
    require_data(dataset, (), fingerprint)  # as above
    return recording


@lru_cache(maxsize=KEPT)
def attitude_of(recording: Recording, attitude: AttitudeFilter) -> Attitude:
    """The attitude that ``attitude`` finds in ``recording``; none without an IMU."""
    if recording.imu is None:
        return no_attitude(recording.clock_s)
    return attitude.estimate(recording)


@lru_cache(maxsize=KEPT)
def timeline_of(recording: Recording, attitude: Attitude) -> Timeline:
    """The events of the run."""
    return build_timeline(recording, attitude)


@lru_cache(maxsize=KEPT)
def scored_of(recording: Recording, timeline: Timeline, burn_in_s: float) -> Scored | None:
    """Return the scoring of runs over the timeline without a trajectory."""
    return scored(recording, timeline, burn_in_s)


@lru_cache(maxsize=8 * KEPT)
def attitude_columns(metric: Hashable, scored: Scored, recording: Recording) -> Mapping[str, float]:
    """Return the columns of a metric that reads the attitude alone: the same for every filter."""
    return cached_values(cast("Metric", metric), scored.outline, recording, scored.counted)


def cached_values(metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray) -> Mapping[str, float]:
    """Return the columns of a metric; one that reads the attitude alone is evaluated once for each attitude."""
    if part_read(metric) != "attitude":
        return metric.evaluate(estimate, recording, counted)
    parts = (estimate.index, estimate.euler_rad, counted)
    content = hashlib.blake2b(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).digest()
    outline = outlined(estimate.index, estimate.euler_rad)
    return _of_attitude(cast("Hashable", metric), recording, _ScoredAttitude(content, outline, counted))


@dataclass(frozen=True)
class _ScoredAttitude:
    """An attitude, and which rows count; two of the same content are the same."""

    content: bytes
    estimate: Estimate = field(compare=False)
    counted: BoolArray = field(compare=False)


@lru_cache(maxsize=2 * KEPT)
def _of_attitude(metric: Hashable, recording: Recording, run: _ScoredAttitude) -> Mapping[str, float]:
    return cast("Metric", metric).evaluate(run.estimate, recording, run.counted)
