"""The inputs that the filters of a sweep share: recording, attitude, timeline, scoring."""

import dataclasses
import hashlib
import json
import os
import zlib
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.contracts import AttitudeFilter, Dataset, Disturbance, Metric
from jerkbench.estimate import Attitude, Estimate, no_attitude
from jerkbench.evaluation.sums import outlined, scored
from jerkbench.files import cache_folder, forget_oldest, write_atomically
from jerkbench.jobs.job import Scenario
from jerkbench.jobs.key import code_digest, require_data, versions
from jerkbench.jobs.sources import plugin_digest
from jerkbench.optional import part_read
from jerkbench.recording import ErrorLaw, Heading, Imu, Origin, Position, Recording, Reference, Velocity
from jerkbench.timeline import build_timeline, with_r_scale

# Simulated recordings, kept in the user's cache: another sweep over the same seeds need not
# simulate them again.

RECORDING_PARTS = {
    "imu": Imu,
    "reference": Reference,
    "position": Position,
    "velocity": Velocity,
    "heading": Heading,
    "origin": Origin,
}
LAW = "drawn"
"""The law of the errors: numbers, besides three of the parts."""

SIMULATED = "simulated"
"""The kind of cache that holds simulated recordings."""

SIMULATED_PATTERN = "simulated_*"
MOST_CACHED_BYTES = 2_000_000_000
"""About 700 drives of 150 s; then the longest unused go."""

DAMAGED_ARRAYS = (OSError, ValueError, KeyError, TypeError)


def simulated(dataset: Dataset, seed: int) -> Recording:
    """Return the recording of ``seed``: the one that is kept, or a new one, which then is."""
    path = cache_folder(SIMULATED) / f"simulated_{_key(dataset, seed)}.arrays"
    kept = _read(path)
    if kept is not None:
        return kept
    recording = dataset.load(seed)
    with suppress(OSError):  # no room, or no right to write: then it is simulated again the next time
        _write(recording, path)
        if seed % 16 == 0:
            forget_oldest(path.parent, SIMULATED_PATTERN, MOST_CACHED_BYTES)
    return recording


def _key(dataset: Dataset, seed: int) -> str:
    """Name everything that decides on the recording: the data set, the code, the libraries, the seed."""
    parts = [repr(dataset), type(dataset).__qualname__, code_digest(), plugin_digest(type(dataset)), versions(), seed]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _write(recording: Recording, path: Path) -> None:
    arrays: dict[str, Any] = {}
    header: dict[str, Any] = {}
    for part in ("", LAW, *RECORDING_PARTS):
        owner = getattr(recording, part) if part else recording
        for each in dataclasses.fields(owner) if owner is not None else ():
            value = getattr(owner, each.name)
            if isinstance(value, np.ndarray):
                arrays[f"{part}.{each.name}"] = value
            elif each.name not in (*RECORDING_PARTS, LAW):
                header[f"{part}.{each.name}"] = value.isoformat() if isinstance(value, datetime) else value
    write_atomically(path, lambda partial: write_arrays(partial, arrays, header))


def _read(path: Path) -> Recording | None:
    """The recording at ``path``, or None where there is none that is whole."""
    try:
        arrays, header = read_arrays(path)
        values = arrays | header
        parts: dict[str, Any] = {
            name: RECORDING_PARTS[name](**own) for name in RECORDING_PARTS if (own := _of(name, values))
        }
        law = _of(LAW, values)
        drawn = ErrorLaw(parts["imu"], parts["position"], parts["velocity"], **law) if law else None
        own = _of("", values)
        start = own.pop("start_utc")
        own |= {"start_utc": None if start is None else datetime.fromisoformat(start), "notes": tuple(own["notes"])}
        with suppress(OSError):
            os.utime(path)  # used just now: others go first
        return Recording(**own, **parts, drawn=drawn)
    except DAMAGED_ARRAYS:
        return None


def _of(part: str, values: dict[str, Any]) -> dict[str, Any]:
    """The fields of one part, by name."""
    return {name.partition(".")[2]: value for name, value in values.items() if name.partition(".")[0] == part}


ARRAYS_MAGIC = b"jerkbench arrays 1\n"
ALIGNED = 64
"""Arrays begin at multiples of so many bytes."""


def write_arrays(path: Path, arrays: dict[str, Any], header: dict[str, Any]) -> None:
    """Write ``arrays`` and what JSON can say of the rest."""
    plain = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    listed = [(name, array.dtype.str, array.shape) for name, array in plain.items()]
    described = json.dumps({"header": header, "arrays": listed}).encode()
    content = bytearray(_padded(described))
    for array in plain.values():
        content += _padded(array.tobytes())
    sizes = np.array([len(described), zlib.crc32(content)], dtype="<u8").tobytes()
    path.write_bytes(_padded(ARRAYS_MAGIC + sizes) + content)


def read_arrays(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return arrays and header.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not what `write_arrays` has written.
    """
    content = np.fromfile(path, dtype=np.uint8)
    if content[: len(ARRAYS_MAGIC)].tobytes() != ARRAYS_MAGIC or len(content) < ALIGNED:
        raise ValueError(f"{path} holds no arrays.")
    length, checksum = np.frombuffer(
        content[len(ARRAYS_MAGIC) : len(ARRAYS_MAGIC) + 16].tobytes(), dtype="<u8"
    ).tolist()
    if zlib.crc32(content[ALIGNED:]) != checksum:  # type: ignore[arg-type]  # an array is a buffer
        raise ValueError(f"{path} is damaged.")
    described = json.loads(content[ALIGNED : ALIGNED + length].tobytes())
    arrays, at = {}, ALIGNED + _rounded(length)
    for name, dtype, shape in described["arrays"]:
        size = np.dtype(dtype).itemsize * int(np.prod(shape))
        arrays[name] = content[at : at + size].view(dtype).reshape(shape)
        at += _rounded(size)
    return arrays, described["header"]


def _padded(content: bytes) -> bytes:
    return content + bytes(_rounded(len(content)) - len(content))


def _rounded(size: int) -> int:
    """The next multiple of ALIGNED."""
    return -(-size // ALIGNED) * ALIGNED


KEPT_INPUTS = 32
"""The number of each kind that is kept; a recording of 150 s at 100 Hz has some 2 MB."""


class Inputs:
    """Recordings, attitudes, timelines and scorings, each made once and the latest `KEPT_INPUTS` of each kind kept.

    No cache holds the object that holds it, so that all of them go with the last reference, some 100 MB.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self._loaded = lru_cache(KEPT_INPUTS)(loaded)
        self._disturbed = lru_cache(KEPT_INPUTS)(partial(disturbed, self._loaded))
        self.attitude = lru_cache(KEPT_INPUTS)(attitude_of)
        self.told = lru_cache(KEPT_INPUTS)(with_r_scale)
        self.timeline = lru_cache(KEPT_INPUTS)(build_timeline)
        self.scored = lru_cache(KEPT_INPUTS)(scored)
        self._outline = lru_cache(KEPT_INPUTS)(_Outline.of)
        self._columns = lru_cache(8 * KEPT_INPUTS)(_columns)

    def recording(self, scenario: Scenario, draw: int) -> Recording:
        """Return the recording of ``draw`` after all disturbances; changed files are other data."""
        return self._disturbed(scenario.dataset, scenario.disturbances, scenario.data, draw)

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
    """Return the inputs that all jobs of this process share, where none are given."""
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
