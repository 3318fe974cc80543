"""Caches of the inputs that several runs of a sweep use: recordings, attitudes, timelines and prepared references."""

import hashlib
import os
import pickle
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import cast

from jerkbench.arrays import BoolArray, Same
from jerkbench.contracts import AttitudeFilter, Dataset, Disturbance, Metric, part_read
from jerkbench.estimate import Attitude, Estimate, no_attitude
from jerkbench.evaluation.evaluated_run import outlined, prepare_reference
from jerkbench.files import Distrusted, cache_folder, forget_oldest, read_trusted, write_trusted
from jerkbench.jobs.job import Scenario
from jerkbench.jobs.key import code_digest, plugin_digest, require_data, versions
from jerkbench.notices import notify
from jerkbench.recording import Recording
from jerkbench.timeline import build_timeline, with_r_scale

# Simulated recordings are stored in the cache folder of the user, so that later sweeps do not simulate them again.

SIMULATED = "simulated"
"""The kind of cache folder that contains simulated recordings."""

SIMULATED_PATTERN = "simulated_*"
MAX_DRIVE_BYTES = 2_000_000_000
"""Maximum size of the cache (about 700 drives of 150 s). The least recently used drives are deleted first."""


def simulated(dataset: Dataset, seed: int) -> Recording:
    """Return the recording of a seed from the disk cache. A missing recording is simulated and stored in the cache."""
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
    """Return a hash of all inputs of a simulation: the data set, the code, the library versions and the seed."""
    parts = [repr(dataset), type(dataset).__qualname__, code_digest(), plugin_digest(type(dataset)), versions(), seed]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _read(path: Path) -> Recording | None:
    """Read a recording from a cache file. Return None if the cache file is missing, incomplete or from another user."""
    try:
        content = read_trusted(path)
    except Distrusted as reason:
        notify(f"The cached drive {path} is ignored, because {reason}. The drive is simulated again.")
        return None
    if content is None:
        return None
    with suppress(OSError):
        os.utime(path)  # `forget_oldest` deletes the least recently used files first
    recording: Recording = pickle.loads(content)  # noqa: S301 - only this user can have written it
    return recording


MetricValues = Mapping[str, float]
"""The value of each column of a metric."""

MAX_CACHED_INPUTS = 32
"""Maximum number of cached objects of each kind. A recording of 150 s at 100 Hz needs about 2 MB."""


class Inputs:
    """Caches of recordings, attitudes, timelines and prepared references, up to `MAX_CACHED_INPUTS` of each kind.

    The caches contain no reference to the `Inputs` object. Therefore, Python frees the memory of the caches (about 100
    MB) as soon as the program no longer uses the `Inputs` object.
    """

    def __init__(self) -> None:
        self._loaded = lru_cache(MAX_CACHED_INPUTS)(loaded)
        self._disturbed = lru_cache(MAX_CACHED_INPUTS)(partial(disturbed, self._loaded))
        self.attitude = lru_cache(MAX_CACHED_INPUTS)(attitude_of)
        self.scaled = lru_cache(MAX_CACHED_INPUTS)(with_r_scale)
        self.timeline = lru_cache(MAX_CACHED_INPUTS)(build_timeline)
        self.prepared = lru_cache(MAX_CACHED_INPUTS)(prepare_reference)
        self._attitude_columns = lru_cache(8 * MAX_CACHED_INPUTS)(_attitude_columns)

    def recording(self, scenario: Scenario, draw: int) -> Recording:
        """Return the disturbed recording of a seed.

        The cache key contains the hash of the data, so changed data are reloaded.
        """
        return self._disturbed(scenario.dataset, scenario.disturbances, scenario.data, draw)

    def undisturbed(self, dataset: Dataset, draw: int) -> Recording:
        """Return the recording of a seed without disturbances."""
        return self._loaded(dataset, dataset.fingerprint(), draw)

    def columns(self, metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray) -> MetricValues:
        """Return the value of each column of a metric for one run.

        If the metric reads only the attitude, its values are cached for the other methods of a batch, whose runs have
        the same attitude object.
        """
        if part_read(metric) != "attitude":
            return metric.evaluate(estimate, recording, counted)
        attitude = Same(estimate.index, estimate.euler_rad, counted)
        return self._attitude_columns(cast("Hashable", metric), recording, attitude)


@cache
def shared_inputs() -> Inputs:
    """Return the input caches that all jobs in this process use."""
    return Inputs()


Load = Callable[[Dataset, str, int], Recording]


def disturbed(
    load: Load, dataset: Dataset, disturbances: tuple[Disturbance, ...], fingerprint: str, draw: int
) -> Recording:
    """Load the recording of a seed and apply the disturbances."""
    recording = load(dataset, dataset.fingerprint(), draw)
    for disturbance in disturbances:
        recording = disturbance.apply(recording, draw)
    require_data(dataset, disturbances, fingerprint)  # detects changes of the data while they were read
    return recording


def loaded(dataset: Dataset, fingerprint: str, seed: int) -> Recording:
    """Load the recording of a seed, and check that the data have not changed since ``fingerprint`` was computed.

    Recordings that a built-in data set simulates are cached on disk (`simulated`).
    """
    in_tree = type(dataset).__module__.startswith("jerkbench.")  # other data sets may read unhashed inputs
    if in_tree and dataset.seeded and not fingerprint:
        return simulated(dataset, seed)
    recording = dataset.load(seed)
    require_data(dataset, (), fingerprint)  # detects changes of the data while they were read
    return recording


def attitude_of(recording: Recording, attitude: AttitudeFilter) -> Attitude:
    """Estimate the attitude of a recording. Without an IMU, return the undefined attitude of `no_attitude`."""
    return no_attitude(recording.clock_s) if recording.imu is None else attitude.estimate(recording)


def _attitude_columns(metric: Hashable, recording: Recording, attitude: Same) -> MetricValues:
    index, euler_rad, counted = attitude.objects
    return cast("Metric", metric).evaluate(outlined(index, euler_rad), recording, counted)
