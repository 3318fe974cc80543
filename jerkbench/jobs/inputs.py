"""The inputs that the runs of a sweep share: recordings, attitudes, timelines and prepared references."""

import hashlib
import os
import pickle
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import cast

import numpy as np

from jerkbench.arrays import BoolArray, Same
from jerkbench.contracts import AttitudeFilter, Dataset, Disturbance, Metric, part_read
from jerkbench.estimate import Attitude, Estimate, no_attitude
from jerkbench.evaluation.evaluated_run import outlined, prepare_reference
from jerkbench.files import Distrusted, cache_folder, forget_oldest, read_trusted, write_trusted
from jerkbench.jobs.job import Scenario
from jerkbench.jobs.key import code_digest, plugin_digest, require_data, versions
from jerkbench.notices import notify
from jerkbench.r_scale import with_r_scale
from jerkbench.recording import Recording
from jerkbench.timeline import build_timeline

# Simulated recordings are stored in the cache folder of the user, so that other sweeps can use them.

SIMULATED = "simulated"
"""The kind of cache folder that contains simulated recordings."""

SIMULATED_PATTERN = "simulated_*"
MAX_DRIVE_BYTES = 2_000_000_000
"""Maximum size of the cache (about 700 drives of 150 s). The least recently used drives are deleted first."""


def simulated(dataset: Dataset, seed: int) -> Recording:
    """Return the recording of a seed from the cache, or simulate it and store it in the cache."""
    path = cache_folder(SIMULATED) / f"simulated_{_key(dataset, seed)}.recording"
    stored = _read(path)
    if stored is not None:
        return stored
    recording = dataset.load(seed)
    with suppress(OSError):  # if the disk is full or not writable, the next call simulates the recording again
        write_trusted(path, pickle.dumps(recording, 5))
        if seed % 16 == 0:
            forget_oldest(path.parent, SIMULATED_PATTERN, MAX_DRIVE_BYTES)
    return recording


def _key(dataset: Dataset, seed: int) -> str:
    """Return a hash of everything that determines a recording: the data set, the code, the libraries and the seed."""
    parts = [repr(dataset), type(dataset).__qualname__, code_digest(), plugin_digest(type(dataset)), versions(), seed]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _read(path: Path) -> Recording | None:
    """Read a recording from a cache file. Return None if the file is missing, incomplete or from another user."""
    try:
        content = read_trusted(path)
    except Distrusted as reason:
        notify(f"The cached drive {path} is ignored, because {reason}. The drive is simulated again.")
        return None
    if content is None:
        return None
    with suppress(OSError):
        os.utime(path)  # the least recently used files are deleted first
    recording: Recording = pickle.loads(content)  # noqa: S301 - only this user can have written it
    return recording


MetricValues = Mapping[str, float]
"""The value of each column of a metric."""

MAX_CACHED_INPUTS = 32
"""Maximum number of cached objects of each kind. A recording of 150 s at 100 Hz needs about 2 MB."""


class Inputs:
    """Caches of recordings, attitudes, timelines and prepared references, up to `MAX_CACHED_INPUTS` of each kind.

    The caches do not refer to the `Inputs` object, so that their memory (about 100 MB) is freed as soon as the object
    is no longer referenced.
    """

    def __init__(self) -> None:
        self._loaded = lru_cache(MAX_CACHED_INPUTS)(loaded)
        self._disturbed = lru_cache(MAX_CACHED_INPUTS)(partial(disturbed, self._loaded))
        self.attitude = lru_cache(MAX_CACHED_INPUTS)(attitude_of)
        self.scaled = lru_cache(MAX_CACHED_INPUTS)(with_r_scale)
        self.timeline = lru_cache(MAX_CACHED_INPUTS)(build_timeline)
        self.prepared = lru_cache(MAX_CACHED_INPUTS)(prepare_reference)
        self._outline = lru_cache(MAX_CACHED_INPUTS)(_Outline.of)
        self._columns = lru_cache(8 * MAX_CACHED_INPUTS)(_columns)

    def recording(self, scenario: Scenario, draw: int) -> Recording:
        """Return the recording of a seed after all disturbances. The hash of the data is part of the cache key."""
        return self._disturbed(scenario.dataset, scenario.disturbances, scenario.data, draw)

    def undisturbed(self, dataset: Dataset, draw: int) -> Recording:
        """Return the recording of a seed without disturbances."""
        return self._loaded(dataset, dataset.fingerprint(), draw)

    def columns(self, metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray) -> MetricValues:
        """Return the values of a metric.

        If the metric reads only the attitude, runs with equal attitudes share the values.
        """
        if part_read(metric) != "attitude":
            return metric.evaluate(estimate, recording, counted)
        outline = self._outline(Same(estimate.index, estimate.euler_rad, counted))
        return self._columns(cast("Hashable", metric), recording, outline)


@cache
def shared_inputs() -> Inputs:
    """Return the input caches that all jobs of this process share by default."""
    return Inputs()


Load = Callable[[Dataset, str, int], Recording]


def disturbed(
    load: Load, dataset: Dataset, disturbances: tuple[Disturbance, ...], fingerprint: str, draw: int
) -> Recording:
    """Load the recording of a seed and apply the disturbances."""
    recording = load(dataset, dataset.fingerprint(), draw)
    for disturbance in disturbances:
        recording = disturbance.apply(recording, draw)
    require_data(
        dataset, disturbances, fingerprint
    )  # the hash is checked after loading, so that it is valid for the data that were read
    return recording


def loaded(dataset: Dataset, fingerprint: str, seed: int) -> Recording:
    """Load the recording of a seed, and check that the data of the recording have the given fingerprint.

    Recordings that a built-in data set simulates are cached on disk (`simulated`).
    """
    in_tree = type(dataset).__module__.startswith("jerkbench.")  # other packages may use inputs that are not hashed
    if in_tree and dataset.seeded and not fingerprint:
        return simulated(dataset, seed)
    recording = dataset.load(seed)
    require_data(dataset, (), fingerprint)  # the hash is checked after loading, as in `disturbed`
    return recording


def attitude_of(recording: Recording, attitude: AttitudeFilter) -> Attitude:
    """Estimate the attitude of a recording. If the recording has no IMU, the attitude is undefined (`no_attitude`)."""
    return no_attitude(recording.clock_s) if recording.imu is None else attitude.estimate(recording)


@dataclass(frozen=True)
class _Outline:
    """An attitude with a mask of the scored rows. Two objects of this class are equal if their content is equal."""

    content: bytes
    estimate: Estimate = field(compare=False)
    counted: BoolArray = field(compare=False)

    @classmethod
    def of(cls, same: Same) -> "_Outline":
        """Create an object from arrays of row indices, Euler angles and scored rows, and hash the arrays."""
        index, euler_rad, counted = same.objects
        content = hashlib.blake2b(b"".join(np.ascontiguousarray(array).tobytes() for array in same.objects))
        return cls(content.digest(), outlined(index, euler_rad), counted)


def _columns(metric: Hashable, recording: Recording, outline: _Outline) -> MetricValues:
    return cast("Metric", metric).evaluate(outline.estimate, recording, outline.counted)
