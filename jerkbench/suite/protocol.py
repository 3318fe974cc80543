"""The protocol of a suite, read from conf/suite; refused if it is not what was frozen."""

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError, require_known, unknown
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.job import Protocol
from jerkbench.presets import preset
from jerkbench.recording import Recording
from jerkbench.tuning.entrant import Entrant, FaultScenario, RunRules

TUNED_ON = "drives"
"""The name of the one search of a suite, in settings and rows. Stored entries contain it."""

TEST_FROM = 1_000_000
"""The seeds to test on begin here, plus a number that only the protocol's digest tells: nobody has tuned on them."""


@dataclass(frozen=True, kw_only=True)
class SuiteProtocol:
    """What a suite of random drives states. Settings are tuned on some drives and scored on others.

    Attributes:
        name: of the suite.
        dataset: the data set that draws a drive from its seed, with all its laws.
        plain: names of the plugins that every entry is compared with, by their group.
        metrics: what is computed from each run; the first one is tuned for.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a lost run [m].
        duration_s: of each simulated drive [s].
        trials: settings that each method may try, the one that it comes with among them.
        tune_seeds: drives to try settings on.
        test_seeds: drives to score on.
        margin: a ratio within 1 + margin is equal.
        entries: verdicts hold for so many entries at once: each interval is at 5 % divided by this number.
    """

    name: str
    dataset: Mapping[str, Any]
    plain: Mapping[str, str]
    metrics: tuple[str, ...]
    burn_in_s: float
    divergence_limit_m: float
    duration_s: float
    trials: int
    tune_seeds: int
    test_seeds: int
    margin: float
    entries: int

    @property
    def digest(self) -> str:
        """The first 12 digits of the SHA-256 of all of it, with two empty parts that the first suites had."""
        stated = {**dataclasses.asdict(self), "fields": {}, "families": []}
        return hashlib.sha256(json.dumps(stated, sort_keys=True, default=list).encode()).hexdigest()[:12]

    @property
    def limits(self) -> Protocol:
        """How each run is judged."""
        return Protocol(burn_in_s=self.burn_in_s, divergence_limit_m=self.divergence_limit_m)

    @property
    def plain_entrant(self) -> Entrant:
        """The plain filter that every entry is compared with."""
        return Entrant.named(**self.plain)

    @property
    def scenario(self) -> FaultScenario:
        """The mixture."""
        return FaultScenario("mixture", dict(self.dataset), "any", "any", {"name": "none"})

    @property
    def seeds_to_tune_on(self) -> tuple[int, ...]:
        """The seeds on which every setting is tried."""
        return tuple(range(self.tune_seeds))

    @property
    def seeds_to_test_on(self) -> tuple[int, ...]:
        """The seeds on which the chosen settings are scored; they follow from the digest."""
        first = TEST_FROM + int(self.digest[:6], 16)
        return tuple(range(first, first + self.test_seeds))

    def rules(self, count: int | None = None) -> RunRules:
        """Return how runs are made, with the first ``count`` of the metrics."""
        return RunRules(self.metrics[:count], self.limits)


FROZEN_DRIVES = 40
"""So many recordings are frozen that every kind of fault is among them."""


def read_suite(scale: str) -> SuiteProtocol:
    """Return the suite conf/suite/``scale``.yaml.

    Raises:
        PluginError: there is none, or it is not what was frozen.
    """
    require_known("suite", scale, FROZEN)
    stated = preset("suite", scale)
    where = f"conf/suite/{scale}.yaml, with conf/dataset/{stated['dataset']}.yaml,"
    known = {known.name for known in dataclasses.fields(SuiteProtocol)}
    for key in stated:
        if key not in known:
            raise PluginError(f"{where}: " + unknown("parameter", key, known))
    values: dict[str, Any] = {k: tuple(value) if isinstance(value, list) else value for k, value in stated.items()}
    protocol = SuiteProtocol(**{**values, "dataset": preset("dataset", stated["dataset"])})
    if protocol.digest != FROZEN[scale].protocol:
        raise PluginError(
            f"{where} is not {protocol.name} any more: its digest is {protocol.digest}, the frozen one"
            f" {FROZEN[scale].protocol}. Take the change back; whatever differs is a new suite, in a file of its own."
        )
    return protocol


# The digests that are frozen of each suite: of its protocol and of its recordings.


class Frozen(NamedTuple):
    """A suite that does not change any more.

    Attributes:
        protocol: digest of its protocol.
        data: digest of the recordings of the first seeds to test on.
    """

    protocol: str
    data: str


FROZEN = {
    name: Frozen(**known)
    for name, known in json.loads(Path(__file__).with_name("frozen.json").read_text(encoding="utf-8")).items()
}
"""From frozen.json, which is never edited: what changes is a new suite with a name of its own."""


STRETCHES = 16
"""Each array is cut into so many; what is hashed is mean and mean square of each."""
_STEP = 1e-4
"""They are rounded to this, in their SI unit: what the last bits of another processor do does not count."""


def require_recordings(scale: str, protocol: SuiteProtocol) -> None:
    """Require that the recordings are the frozen ones.

    Raises:
        RecordingError: one is another.
    """
    if (own := data_digest(protocol)) != FROZEN[scale].data:
        raise RecordingError(
            f"The recordings are not those of {protocol.name}: their digest is {own}, the frozen one"
            f" {FROZEN[scale].data}. Other data are another suite; use a version of jerkbench that makes these."
        )


def data_digest(protocol: SuiteProtocol) -> str:
    """Return the digest of the recordings that are frozen."""
    job, inputs = protocol.plain_entrant.job(protocol.scenario, protocol.limits), Inputs()
    recordings = (inputs.recording(job.scenario, seed) for seed in protocol.seeds_to_test_on[:FROZEN_DRIVES])
    return arrays_digest(array for recording in recordings for array in _arrays(recording))


def arrays_digest(arrays: Iterator[FloatArray]) -> str:
    """Return the first 8 digits of the SHA-256 of rounded means of a recording's arrays."""
    sha = hashlib.sha256()
    for array in arrays:
        stretches = np.array_split(np.nan_to_num(array), STRETCHES)
        means = np.array([(stretch.mean(axis=0), np.square(stretch).mean(axis=0)) for stretch in stretches])
        sha.update(f"{array.shape}".encode() + np.rint(means / _STEP).astype("<i8").tobytes())
    return sha.hexdigest()[:8]


_STREAMS = {
    "imu": ("t_s", "accel_mps2", "gyro_radps"),
    "position": ("t_s", "enu_m", "covariance_m2"),
    "velocity": ("t_s", "mps"),
    "heading": ("t_s", "yaw_rad"),
    "reference": ("enu_m", "velocity_mps"),
}
"""The arrays of a recording that are hashed, by stream."""


def _arrays(recording: Recording) -> Iterator[FloatArray]:
    for name, fields in _STREAMS.items():
        stream = getattr(recording, name)
        arrays = (getattr(stream, field) for field in fields) if stream is not None else ()
        yield from (array for array in arrays if array is not None)
