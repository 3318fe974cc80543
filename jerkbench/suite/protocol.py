"""The protocol of a suite, read from conf/suite; refused if it is not what was frozen."""

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError, require_known, unknown
from jerkbench.geometry import vertical_in_body
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.job import Protocol
from jerkbench.presets import preset
from jerkbench.recording import Recording
from jerkbench.tuning.entrant import NUMBERS, Entrant, FaultScenario, RunRules

HALVES = ("first", "second")
"""What is tuned on one is scored on the other."""

BOTH = "both"
"""Of what is tuned on with each half, and scored with each."""

TEST_FROM = 1_000_000
"""The seeds to test on begin here, plus a number that only the protocol's digest tells: nobody has tuned on them."""


def domain_of(half: str) -> str:
    """Return what stands before a half, "hand " of "hand first"; empty where there is one domain."""
    return half.removesuffix(half.rpartition(" ")[2])


@dataclass(frozen=True)
class FaultFamily:
    """Faults of one kind.

    Attributes:
        name: of the family.
        half: "first", "second", or "both" for what is tuned and scored everywhere.
        disturbance: a disturbance by its name.
        dataset: parameters of the simulated field that belong to it.
        severities: parameters by the name of a severity: of the disturbance, or of the data set where that has some.
    """

    name: str
    half: str
    disturbance: str
    severities: Mapping[str, Mapping[str, Any]]
    dataset: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SuiteProtocol:
    """What a suite states.

    Attributes:
        name: of the suite.
        plain: names of the plugins that every entry is compared with, by their group.
        metrics: what is computed from each run; the first one is tuned for.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a lost run [m].
        duration_s: of each simulated drive [s].
        fields: data sets by the kind of their GNSS noise.
        trials: settings that each method may try, the one that it comes with among them.
        tune_seeds: seeds of a scenario to try settings on.
        test_seeds: seeds of a scenario to score on.
        margin: a ratio within 1 + margin is equal.
        families: the faults.
    """

    numbers: ClassVar[tuple[str, ...]] = NUMBERS
    """Columns of a run's row that are kept; the first is the error."""

    level_of: ClassVar[str] = "scenario"
    """What has a level of its own: the error of the plain filter as it comes, of which a lost run counts a hundred."""

    name: str
    plain: Mapping[str, str]
    metrics: tuple[str, ...]
    burn_in_s: float
    divergence_limit_m: float
    duration_s: float
    fields: Mapping[str, str]
    trials: int
    tune_seeds: int
    test_seeds: int
    margin: float
    families: tuple[FaultFamily, ...]

    @property
    def digest(self) -> str:
        """The first 12 digits of the SHA-256 of all of it."""
        stated = dataclasses.asdict(self)
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
    def searches(self) -> tuple[str, ...]:
        """What a method is tuned on, search by search."""
        return HALVES

    def seeds_of(self, scenario: FaultScenario, seeds: tuple[int, ...]) -> tuple[int, ...]:
        """Return those of ``seeds`` that a scenario has: all, where it is simulated."""
        del scenario
        return seeds

    def recordings_of(self, scenario: FaultScenario) -> tuple[int, ...]:
        """Return the seeds whose recordings are frozen: the first to score on."""
        return self.seeds_of(scenario, self.seeds_to_test_on[:1])

    def rules(self, count: int | None = None) -> RunRules:
        """Return how runs are made, with the first ``count`` of the metrics."""
        return RunRules(self.metrics[:count], self.limits, numbers=self.numbers)

    @property
    def seeds_to_tune_on(self) -> tuple[int, ...]:
        """The seeds on which every setting is tried."""
        return tuple(range(self.tune_seeds))

    @property
    def seeds_to_test_on(self) -> tuple[int, ...]:
        """The seeds on which the chosen settings are scored; they follow from the digest."""
        first = TEST_FROM + int(self.digest[:6], 16)
        return tuple(range(first, first + self.test_seeds))

    @property
    def scenarios(self) -> tuple[FaultScenario, ...]:
        """Every family at every severity, on every field, in order."""
        return tuple(
            self._scenario(noise, dataset, family, severity)
            for noise, dataset in self.fields.items()
            for family in self.families
            for severity in family.severities
        )

    def _scenario(self, noise: str, dataset: str, family: FaultFamily, severity: str) -> FaultScenario:
        """Put the severity's parameters where they belong: into what makes the fault, data set or disturbance."""
        parameters = dict(family.severities[severity])
        of_field = {**family.dataset, **parameters} if family.dataset else {}
        drive = {"name": dataset, "duration_s": self.duration_s, **of_field}
        disturbance = {"name": family.disturbance, **({} if family.dataset else parameters)}
        return FaultScenario(noise, drive, family.name, severity, family.half, disturbance)


HAND = "hand"
"""The domain of the recorded trials."""


@dataclass(frozen=True, kw_only=True)
class AttitudeSuite(SuiteProtocol):
    """A suite of attitude filters: recorded trials of a hand (BROAD) and simulated drives, tuned and scored apart.

    Attributes:
        hand: numbers of the trials in each half.
    """

    numbers: ClassVar[tuple[str, ...]] = ("inclination_rmse_deg",)

    hand: Mapping[str, tuple[int, ...]]

    @property
    def trial_count(self) -> int:
        """How many trials there are."""
        return sum(map(len, self.hand.values()))

    @property
    def domains(self) -> tuple[str, ...]:
        """The domains: the trials, where there are any, and the simulated fields."""
        return (*([HAND] if self.trial_count else []), *self.fields)

    @property
    def searches(self) -> tuple[str, ...]:
        """Each half of each domain."""
        return tuple(f"{domain} {half}" for domain in self.domains for half in HALVES)

    @property
    def scenarios(self) -> tuple[FaultScenario, ...]:
        """Every trial, and every family on every simulated field."""
        trials = tuple(
            FaultScenario(
                noise=HAND,
                dataset={"name": "broad", "trial": number},
                family=f"trial {number}",
                severity=f"trial {number}",
                half=f"{HAND} {half}",
                disturbance={"name": "none"},
            )
            for half, numbers in self.hand.items()
            for number in numbers
        )
        return (*trials, *(replace(drive, half=f"{drive.noise} {drive.half}") for drive in super().scenarios))

    def seeds_of(self, scenario: FaultScenario, seeds: tuple[int, ...]) -> tuple[int, ...]:
        """A recorded trial is one run."""
        return (0,) if scenario.noise == HAND else seeds


@dataclass(frozen=True, kw_only=True)
class DriveSuite(SuiteProtocol):
    """A suite of random drives: each seed is another drive; what is tuned on one set of them is scored on others.

    Attributes:
        dataset: the data set that draws a drive from its seed, with all its laws.
        entries: verdicts hold for so many entries at once: each interval is at 5 % of as many.
    """

    level_of: ClassVar[str] = "seed"

    dataset: Mapping[str, Any]
    entries: int

    @property
    def searches(self) -> tuple[str, ...]:
        """The one set of drives to tune on."""
        return ("drives",)

    @property
    def scenarios(self) -> tuple[FaultScenario, ...]:
        """The mixture."""
        return (FaultScenario("mixture", dict(self.dataset), "any", "any", BOTH, {"name": "none"}),)

    def recordings_of(self, scenario: FaultScenario) -> tuple[int, ...]:
        """Return the seeds whose recordings are frozen: so many that every kind of fault is among them."""
        return self.seeds_of(scenario, self.seeds_to_test_on[:FROZEN_DRIVES])


FROZEN_DRIVES = 40


def read_suite(scale: str) -> SuiteProtocol:
    """Return the suite conf/suite/``scale``.yaml.

    Raises:
        PluginError: there is none, or it is not what was frozen.
    """
    require_known("suite", scale, FROZEN)
    stated, where = preset("suite", scale), f"conf/suite/{scale}.yaml"
    if FROZEN[scale].kind is DriveSuite:  # the laws are part of the digest
        where = f"{where}, with conf/dataset/{stated['dataset']}.yaml,"
        stated["dataset"] = preset("dataset", stated["dataset"])
    known = {known.name for known in dataclasses.fields(FROZEN[scale].kind)}
    for key in stated:
        if key not in (*known, "only"):
            raise PluginError(f"{where}: " + unknown("parameter", key, known))
    values: dict[str, Any] = {k: tuple(value) if isinstance(value, list) else value for k, value in stated.items()}
    only = values.pop("only", ()) or tuple(stated["families"])
    families = (FaultFamily(name=name, **own) for name, own in stated["families"].items() if name in only)
    protocol = FROZEN[scale].kind(**{**values, "families": tuple(families)})
    if protocol.digest != FROZEN[scale].protocol:
        raise PluginError(
            f"{where} is not {protocol.name} any more: its digest is {protocol.digest}, the frozen one"
            f" {FROZEN[scale].protocol}. Take the change back; whatever differs is a new suite, in a file of its own."
        )
    return protocol


# What is frozen of each suite: the digests of its protocol and of its recordings.


@dataclass(frozen=True)
class Frozen:
    """A suite that does not change any more.

    Attributes:
        protocol: digest of its protocol.
        data: of each scenario: digest of the recording of the first seed to test on.
        kind: what its file is read as.
        searches: those of its protocol.
    """

    protocol: str
    data: tuple[str, ...]
    kind: type[SuiteProtocol] = SuiteProtocol
    searches: tuple[str, ...] = HALVES


_KINDS = {"faults": SuiteProtocol, "drives": DriveSuite, "attitude": AttitudeSuite}

FROZEN = {
    name: Frozen(known["protocol"], tuple(known["data"]), _KINDS[known["kind"]], tuple(known["searches"]))
    for name, known in json.loads(Path(__file__).with_name("frozen.json").read_text(encoding="utf-8")).items()
}
"""From frozen.json, which is never edited: what changes is a new suite with a name of its own."""


# The digests of the recordings of a suite: whether they are those on which the others were scored.

STRETCHES = 16
"""Each array is cut into so many; what is hashed is mean and mean square of each."""
_STEP = 1e-4
"""They are rounded to this, in their SI unit: what the last bits of another processor do does not count."""


def require_recordings(scale: str, protocol: SuiteProtocol) -> None:
    """Require that the recordings are the frozen ones.

    Raises:
        RecordingError: one is another.
    """
    for scenario, frozen, own in zip(protocol.scenarios, FROZEN[scale].data, data_digests(protocol), strict=True):
        if own != frozen:
            raise RecordingError(
                f"The recordings of {scenario.name} are not those of {protocol.name}: their digest is {own}, the frozen"
                f" one {frozen}. Other data are another suite; use a version of jerkbench that makes these."
            )


def data_digests(protocol: SuiteProtocol) -> Iterator[str]:
    """Yield the digest of the recordings of each scenario that are frozen."""
    plain, inputs = protocol.plain_entrant, Inputs()
    arrays = _of_tilt if isinstance(protocol, AttitudeSuite) else _arrays
    for scenario in protocol.scenarios:
        job = plain.job(scenario, protocol.limits)
        recordings = (inputs.recording(job.scenario, seed) for seed in protocol.recordings_of(scenario))
        yield arrays_digest(array for recording in recordings for array in arrays(recording))


def arrays_digest(arrays: Iterator[FloatArray]) -> str:
    """Return the first 8 digits of the SHA-256 of rounded means of a recording's arrays."""
    sha = hashlib.sha256()
    for array in arrays:
        stretches = np.array_split(np.nan_to_num(array), STRETCHES)
        means = np.array([(stretch.mean(axis=0), np.square(stretch).mean(axis=0)) for stretch in stretches])
        sha.update(f"{array.shape}".encode() + np.rint(means / _STEP).astype("<i8").tobytes())
    return sha.hexdigest()[:8]


TILT_STREAMS = {"inertial": ("t_s", "accel_mps2", "gyro_radps")}
_STREAMS = {
    "imu": ("t_s", "accel_mps2", "gyro_radps"),
    "position": ("t_s", "enu_m", "covariance_m2"),
    "velocity": ("t_s", "mps"),
    "heading": ("t_s", "yaw_rad"),
    "reference": ("enu_m", "velocity_mps"),
}
"""The arrays of a recording that are hashed, by stream."""


def _of_tilt(recording: Recording) -> Iterator[FloatArray]:
    """What an attitude filter sees, the true vertical, and where it counts."""
    yield from _arrays(recording, TILT_STREAMS)
    yield recording.reference.scored.astype(np.float64)
    if recording.reference.euler_rad is not None:
        yield vertical_in_body(np.nan_to_num(recording.reference.euler_rad))


def _arrays(recording: Recording, streams: Mapping[str, tuple[str, ...]] = _STREAMS) -> Iterator[FloatArray]:
    for name, fields in streams.items():
        stream = getattr(recording, name)
        arrays = (getattr(stream, field) for field in fields) if stream is not None else ()
        yield from (array for array in arrays if array is not None)
