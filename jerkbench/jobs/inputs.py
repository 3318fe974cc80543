"""The inputs that the filters of a sweep share: recording, attitude, timeline, prepared reference."""

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

# Simulated recordings, kept in the user's cache: another sweep over the same seeds need not
# simulate them again.

SIMULATED = "simulated"
"""The kind of cache that holds simulated recordings."""

SIMULATED_PATTERN = "simulated_*"
MAX_DRIVE_BYTES = 2_000_000_000
"""About 700 drives of 150 s; then the longest unused go."""


def simulated(dataset: Dataset, seed: int) -> Recording:
    """Return the recording of ``seed``: the one that is kept, or a new one, which then is."""
    path = cache_folder(SIMULATED) / f"simulated_{_key(dataset, seed)}.recording"
    kept = _read(path)
    if kept is not None:
        return kept
    recording = dataset.load(seed)
    with suppress(OSError):  # no room, or no right to write: then it is simulated again the next time
        write_trusted(path, pickle.dumps(recording, 5))
        if seed % 16 == 0:
            forget_oldest(path.parent, SIMULATED_PATTERN, MAX_DRIVE_BYTES)
    return recording


def _key(dataset: Dataset, seed: int) -> str:
    """Name everything that decides on the recording: the data set, the code, the libraries, the seed."""
    parts = [repr(dataset), type(dataset).__qualname__, code_digest(), plugin_digest(type(dataset)), versions(), seed]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _read(path: Path) -> Recording | None:
    """The recording at ``path``, or None where there is none that is whole, and this user's."""
    try:
        content = read_trusted(path)
    except Distrusted as reason:
        notify(f"{path} is not used, the drive is simulated again: {reason}")
        return None
    if content is None:
        return None
    with suppress(OSError):
        os.utime(path)  # used just now: others go first
    recording: Recording = pickle.loads(content)  # noqa: S301 - only this user can have written it
    return recording


KEPT_INPUTS = 32
"""The number of each kind that is kept; a recording of 150 s at 100 Hz has some 2 MB."""


class Inputs:
    """Recordings, attitudes, timelines and prepared references, each made once; `KEPT_INPUTS` of each kind are kept.

    No cache holds the object that holds it, so that all of them go with the last reference, some 100 MB.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self._loaded = lru_cache(KEPT_INPUTS)(loaded)
        self._disturbed = lru_cache(KEPT_INPUTS)(partial(disturbed, self._loaded))
        self.attitude = lru_cache(KEPT_INPUTS)(attitude_of)
        self.told = lru_cache(KEPT_INPUTS)(with_r_scale)
        self.timeline = lru_cache(KEPT_INPUTS)(build_timeline)
        self.prepared = lru_cache(KEPT_INPUTS)(prepare_reference)
        self._outline = lru_cache(KEPT_INPUTS)(_Outline.of)
        self._columns = lru_cache(8 * KEPT_INPUTS)(_columns)

    def recording(self, scenario: Scenario, draw: int) -> Recording:
        """Return the recording of ``draw`` after all disturbances; changed files are other data."""
        return self._disturbed(scenario.dataset, scenario.disturbances, scenario.data, draw)

    def undisturbed(self, dataset: Dataset, draw: int) -> Recording:
        """Return the recording of ``draw`` as it was loaded."""
        return self._loaded(dataset, dataset.fingerprint(), draw)

    def columns(
        self, metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray
    ) -> Mapping[str, float]:
        """Return the columns of a metric; one that reads the attitude alone is asked once for each attitude."""
        if part_read(metric) != "attitude":
            return metric.evaluate(estimate, recording, counted)
        outline = self._outline(Same(estimate.index, estimate.euler_rad, counted))
        return self._columns(cast("Hashable", metric), recording, outline)


@cache
def shared_inputs() -> Inputs:
    """Return the inputs that all jobs of this process share, where none are given."""
    return Inputs()


Load = Callable[[Dataset, str, int], Recording]


def disturbed(
    load: Load, dataset: Dataset, disturbances: tuple[Disturbance, ...], fingerprint: str, draw: int
) -> Recording:
    """Return the recording of ``draw`` after all ``disturbances``."""
    recording = load(dataset, dataset.fingerprint(), draw)
    for disturbance in disturbances:
        recording = disturbance.apply(recording, draw)
    require_data(dataset, disturbances, fingerprint)  # afterwards: what was read meanwhile is what the hash says
    return recording


def loaded(dataset: Dataset, fingerprint: str, seed: int) -> Recording:
    """Load a recording, or take it from the cache of simulated ones; its data are those of ``fingerprint``."""
    in_tree = type(dataset).__module__.startswith("jerkbench.")  # what others simulate may depend on anything
    if in_tree and dataset.seeded and not fingerprint:
        return simulated(dataset, seed)
    recording = dataset.load(seed)
    require_data(dataset, (), fingerprint)  # as above
    return recording


def attitude_of(recording: Recording, attitude: AttitudeFilter) -> Attitude:
    """Return the attitude that ``attitude`` estimates over ``recording``; none without an IMU."""
    return no_attitude(recording.clock_s) if recording.imu is None else attitude.estimate(recording)


@dataclass(frozen=True)
class _Outline:
    """An attitude, and which rows count; two of the same content are the same."""

    content: bytes
    estimate: Estimate = field(compare=False)
    counted: BoolArray = field(compare=False)

    @classmethod
    def of(cls, same: Same) -> "_Outline":
        """Return the outline of an attitude: rows, angles and counted rows, with a hash of them."""
        index, euler_rad, counted = same.objects
        content = hashlib.blake2b(b"".join(np.ascontiguousarray(array).tobytes() for array in same.objects))
        return cls(content.digest(), outlined(index, euler_rad), counted)


def _columns(metric: Hashable, recording: Recording, outline: _Outline) -> Mapping[str, float]:
    return cast("Metric", metric).evaluate(outline.estimate, recording, outline.counted)
