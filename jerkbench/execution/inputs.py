"""The inputs that the filters of a sweep share: recording, attitude, timeline, scoring."""

import hashlib
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial
from typing import cast

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.cells.cell import Cell
from jerkbench.cells.data import require_data
from jerkbench.contracts import AttitudeFilter, Dataset, Disturbance, Metric
from jerkbench.estimate import Attitude, Estimate, no_attitude
from jerkbench.evaluation.batch_scoring import outlined, scored
from jerkbench.execution.simulation_cache import simulated
from jerkbench.optional import part_read
from jerkbench.recording import Recording
from jerkbench.timeline.reported_noise import told
from jerkbench.timeline.timeline import build_timeline

KEPT = 32
"""The number of each kind that is kept; a recording of 150 s at 100 Hz has some 2 MB."""


class Inputs:
    """Recordings, attitudes, timelines and scorings, each made once and the latest `KEPT` of each kind kept.

    No cache holds the object that holds it, so that all of them go with the last reference, some 100 MB.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self._loaded = lru_cache(KEPT)(load)
        self._disturbed = lru_cache(KEPT)(partial(disturbed, self._loaded))
        self.attitude = lru_cache(KEPT)(attitude_of)
        self.told = lru_cache(KEPT)(told)
        self.timeline = lru_cache(KEPT)(build_timeline)
        self.scored = lru_cache(KEPT)(scored)
        self._outline = lru_cache(KEPT)(_Outline.of)
        self._columns = lru_cache(8 * KEPT)(_columns)

    def recording(self, cell: Cell, fingerprint: str, draw: int) -> Recording:
        """Return the recording of ``draw`` after all disturbances; ``fingerprint`` tells changed files apart."""
        return self._disturbed(cell.dataset, cell.disturbances, fingerprint, draw)

    def undisturbed(self, dataset: Dataset, draw: int) -> Recording:
        """Return the recording of ``draw`` as it was loaded."""
        return undisturbed(self._loaded, dataset, draw)

    def columns(
        self, metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray
    ) -> Mapping[str, float]:
        """Return the columns of a metric; one that reads the attitude alone is asked once for each attitude."""
        if part_read(metric) != "attitude":
            return metric.evaluate(estimate, recording, counted)
        outline = self._outline(_Arrays(estimate.index, estimate.euler_rad, counted))
        return self._columns(cast("Hashable", metric), recording, outline)


@cache
def shared_inputs() -> Inputs:
    """Return the inputs that all cells of this process share, where none are given."""
    return Inputs()


Load = Callable[[Dataset, str, int], Recording]


def undisturbed(load: Load, dataset: Dataset, draw: int) -> Recording:
    """Return the recording of ``draw`` as it was loaded."""
    return load(dataset, dataset.fingerprint(), draw)


def disturbed(
    load: Load, dataset: Dataset, disturbances: tuple[Disturbance, ...], fingerprint: str, draw: int
) -> Recording:
    """Return the recording of ``draw`` after all ``disturbances``."""
    recording = undisturbed(load, dataset, draw)
    for disturbance in disturbances:
        recording = disturbance.apply(recording, draw)
    require_data(dataset, disturbances, fingerprint)  # afterwards: what was read meanwhile is what the hash says
    return recording


def load(dataset: Dataset, fingerprint: str, seed: int) -> Recording:
    """Load a recording, or take it from the cache of simulated ones; its data are those of ``fingerprint``."""
    in_tree = type(dataset).__module__.startswith("jerkbench.")  # what others simulate may depend on anything
    if in_tree and dataset.seeded and not fingerprint:
        return simulated(dataset, seed)
    recording = dataset.load(seed)
    require_data(dataset, (), fingerprint)  # as above
    return recording


def attitude_of(recording: Recording, attitude: AttitudeFilter) -> Attitude:
    """Return the attitude that ``attitude`` estimates over ``recording``; none without an IMU."""
    if recording.imu is None:
        return no_attitude(recording.clock_s)
    return attitude.estimate(recording)


class _Arrays:
    """Rows, attitude and counted rows of a run; the same if they are the same objects."""

    def __init__(self, index: IntArray, euler_rad: FloatArray, counted: BoolArray) -> None:
        self.arrays = index, euler_rad, counted

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.arrays)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Arrays) and all(a is b for a, b in zip(self.arrays, other.arrays, strict=True))


@dataclass(frozen=True)
class _Outline:
    """An attitude, and which rows count; two of the same content are the same."""

    content: bytes
    estimate: Estimate = field(compare=False)
    counted: BoolArray = field(compare=False)

    @classmethod
    def of(cls, arrays: _Arrays) -> "_Outline":
        """Return the outline of an attitude, with a hash of its arrays."""
        index, euler_rad, counted = arrays.arrays
        content = hashlib.blake2b(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays.arrays))
        return cls(content.digest(), outlined(index, euler_rad), counted)


def _columns(metric: Hashable, recording: Recording, outline: _Outline) -> Mapping[str, float]:
    return cast("Metric", metric).evaluate(outline.estimate, recording, outline.counted)
