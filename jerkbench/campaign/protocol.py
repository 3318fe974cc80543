"""The protocols of suites and audits, which define the methods, the random drives and the tuning budgets."""

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.campaign.runs import FaultScenario, MethodSpec, Setting, Space, tried_settings, tunable_space
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.rows import Inputs
from jerkbench.parameters import Limit, Limited
from jerkbench.presets import preset
from jerkbench.recording import Recording

NO_DISTURBANCE = {"name": "none"}


def digest_of(stated: Mapping[str, Any]) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 hash of plain data."""
    return hashlib.sha256(json.dumps(stated, sort_keys=True, default=list).encode()).hexdigest()[:12]


def _fields(cls: type, stated: Mapping[str, Any], where: str | Path) -> dict[str, Any]:
    """Return the values of the fields of a protocol. Unknown keys, and missing keys without a default, are errors."""
    has_default = {field.name: field.default is not dataclasses.MISSING for field in dataclasses.fields(cls)}
    if wrong := sorted(name for name in has_default.keys() ^ stated.keys() if not has_default.get(name)):
        problem = f"does not have the key {wrong[0]}" if wrong[0] in has_default else f"has the unknown key {wrong[0]}"
        raise PluginError(f"{where} {problem}. The keys are {', '.join(sorted(has_default))}.")
    return {key: tuple(value) if isinstance(value, list) else value for key, value in stated.items()}


TEST_FROM = 1_000_000
"""Offset of the seeds of the test drives. A number that depends on the digest is added. The test drives are therefore
unknown until the protocol is fixed, so no one can tune on them."""


@dataclass(frozen=True, kw_only=True)
class SuiteProtocol:
    """The protocol of a suite of random drives. Methods are tuned on some drives and scored on other drives.

    Attributes:
        name: Name of the suite.
        dataset: Configuration of the data set that simulates a random drive for each seed.
        plain: Names of the filter and the adaptation with which every entry is compared (the plain filter).
        metrics: Names of the metrics of each run. The tuning minimises the first metric.
        burn_in_s: Time at the start of a drive in which errors are not counted [s].
        divergence_limit_m: Position error above which a run counts as diverged [m].
        duration_s: Duration of each simulated drive [s].
        trials: Number of settings that the tuning of each method evaluates, including the setting before tuning.
        tune_seeds: Number of drives for tuning.
        test_seeds: Number of drives for the test.
        margin: Two methods count as equal if the interval of their error ratio is between 1/(1 + margin) and 1 +
            margin.
        entries: Number of entries for which the verdicts hold simultaneously. The significance level of each interval
            is 5 % divided by the number of entries.
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

    @cached_property
    def digest(self) -> str:
        """Hash of the protocol. Two empty keys are hashed too, so that the hashes of the first suites remain valid."""
        return digest_of({**dataclasses.asdict(self), "fields": {}, "families": []})

    @property
    def plain_method(self) -> MethodSpec:
        """The filter without adaptation with which every entry is compared."""
        return MethodSpec.named(**self.plain)

    def job(self, method: MethodSpec, metrics: int | None = None) -> Job:
        """Return the job that runs a method on the random drives. ``metrics`` limits the number of computed metrics.

        Raises:
            PluginError: The method cannot be created.
        """
        limits = Protocol(burn_in_s=self.burn_in_s, divergence_limit_m=self.divergence_limit_m)
        scenario = FaultScenario("mixture", dict(self.dataset), "any", NO_DISTURBANCE)
        return method.job(scenario, limits, self.metrics[:metrics])

    @property
    def seeds_to_tune_on(self) -> range:
        """The seeds of the tuning drives, on which every candidate setting is evaluated."""
        return range(self.tune_seeds)

    @property
    def seeds_to_test_on(self) -> range:
        """The seeds of the test drives, on which the selected settings are scored."""
        first = TEST_FROM + int(self.digest[:6], 16)
        return range(first, first + self.test_seeds)


FROZEN: Mapping[str, Mapping[str, str]] = json.loads(Path(__file__).with_name("frozen.json").read_bytes())
"""Digests of the protocol and of the recordings of each suite. A changed suite needs a new name."""


def read_suite(scale: str) -> SuiteProtocol:
    """Read the protocol of a suite from conf/suite/``scale``.yaml.

    Raises:
        PluginError: The suite is unknown, or it was changed after it was frozen.
    """
    require_known("suite", scale, FROZEN)
    stated = preset("suite", scale)
    where = f"conf/suite/{scale}.yaml, with conf/dataset/{stated['dataset']}.yaml,"
    stated = {**stated, "dataset": preset("dataset", stated["dataset"])}
    protocol = SuiteProtocol(**_fields(SuiteProtocol, stated, where))
    if protocol.digest != FROZEN[scale]["protocol"]:
        raise PluginError(
            f"{where} differs from the frozen protocol of {protocol.name}: its digest is {protocol.digest}, and the"
            f" frozen digest is {FROZEN[scale]['protocol']}. Give a changed suite a new name."
        )
    return protocol


FROZEN_DRIVES = 40
"""Number of recordings whose digest is frozen. All kinds of fault occur in these recordings."""
PARTS = 16
"""Number of parts into which an array is divided. The mean and the mean square of each part are hashed."""
ROUNDED_TO = 1e-4
"""Resolution of the hashed means in SI units, which is coarse so that rounding errors do not change the digest."""
HASHED_ARRAYS = {
    "imu": ("t_s", "accel_mps2", "gyro_radps"),
    "position": ("t_s", "enu_m", "covariance_m2"),
    "velocity": ("t_s", "mps"),
    "heading": ("t_s", "yaw_rad"),
    "reference": ("enu_m", "velocity_mps"),
}
"""Arrays of a recording that are hashed, by stream."""


def require_recordings(scale: str, protocol: SuiteProtocol) -> None:
    """Raise an exception if the simulated recordings differ from the frozen recordings of the suite.

    Raises:
        RecordingError: The digest of the simulated recordings differs from the frozen digest.
    """
    if (digest := data_digest(protocol)) != FROZEN[scale]["data"]:
        raise RecordingError(
            f"The recordings differ from the frozen recordings of {protocol.name}: their digest is {digest}, and"
            f" the frozen digest is {FROZEN[scale]['data']}. Use the version of jerkbench that froze {protocol.name}."
        )


def data_digest(protocol: SuiteProtocol) -> str:
    """Return a hash of the recordings of the first `FROZEN_DRIVES` test drives, from rounded means of the arrays."""
    scenario, inputs, sha = protocol.job(protocol.plain_method).scenario, Inputs(), hashlib.sha256()
    for seed in protocol.seeds_to_test_on[:FROZEN_DRIVES]:
        for array in _hashed_arrays(inputs.recording(scenario, seed)):
            parts = np.array_split(np.nan_to_num(array), PARTS)
            means = np.array([(part.mean(axis=0), np.square(part).mean(axis=0)) for part in parts])
            sha.update(f"{array.shape}".encode() + np.rint(means / ROUNDED_TO).astype("<i8").tobytes())
    return sha.hexdigest()[:8]


def _hashed_arrays(recording: Recording) -> Iterator[FloatArray]:
    for name, fields in HASHED_ARRAYS.items():
        arrays = (getattr(getattr(recording, name), field, None) for field in fields)
        yield from (array for array in arrays if array is not None)


PUBLISHED = ("published", "simplified")
"""Kinds of provenance of the adaptations over which hypothesis H1 averages, and from which hypothesis H2 selects."""
MAX_DRIVES = 10_000
"""Number of seeds that are reserved for an audit, which is the maximum number of drives of the audit."""
_INTERVALS = "so that an interval can be computed for each kind of fault"
_SPREAD = "so that the spread between tunings can be estimated"


class AuditMethod(NamedTuple):
    """A method of an audit: the names of its filter and its adaptation."""

    filter: str
    adaptation: str

    @property
    def name(self) -> str:
        """Name of the method in tables."""
        return f"{self.filter} + {self.adaptation}"


@dataclass(frozen=True, kw_only=True)
class AuditProtocol(Limited):
    """The protocol of an audit. Comments in conf/audit/full.yaml describe the attributes that are not listed here.

    Attributes:
        laws: Configuration of the data set, which defines the distributions of the random drives.
        only: Names of the adaptations to compare. An empty tuple selects all adaptations.
    """

    version: int
    repeat: int
    dataset: str
    laws: Mapping[str, Any]
    tunings: Annotated[int, Limit(lambda count: count >= 3, f"give 3 or more, {_SPREAD}.")]
    tune_drives: int
    judged_drives: Annotated[int, Limit(lambda count: count >= 64, f"give 64 or more, {_INTERVALS}.")]
    trials: int
    plain_trials: int
    filters: tuple[str, ...]
    plain: str
    references: tuple[str, ...]
    apart: tuple[str, ...]
    apart_with_adaptations: tuple[str, ...]
    apart_tunings: int
    apart_drives: int
    margin: float
    lost_costs: float
    lost_costs_shown: tuple[float, ...]
    resampled_audits: int
    adaptations: Mapping[str, str]
    only: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in (*self.adaptations, *self.only, self.plain, *self.references):
            plugins.get("adaptation", name)
        for name in (*self.filters, *self.apart, *self.apart_with_adaptations):
            plugins.get("filter", name)
        if (drives := self.tunings * self.tune_drives + self.judged_drives) > MAX_DRIVES:
            raise PluginError(f"The audit has {drives} drives for tuning and judging; the maximum is {MAX_DRIVES}.")

    @cached_property
    def digest(self) -> str:
        """Hash of the protocol and of the distributions of the drives."""
        return digest_of(dataclasses.asdict(self))

    def job(self, method: AuditMethod) -> Job:
        """Return the job that runs a method with its default parameters on the random drives."""
        scenario = FaultScenario(self.dataset, dict(self.laws), "any", NO_DISTURBANCE)
        return MethodSpec.named(*method).job(scenario)

    @cached_property
    def jobs(self) -> dict[AuditMethod, tuple[Job, Space]]:
        """The job and the search space of each method of the audit."""
        jobs = {method: self.job(method) for method in (*self.competing, *self.separate)}
        return {method: (job, tunable_space(job)) for method, job in jobs.items()}

    def seeds_to_tune_on(self, tuning: int) -> range:
        """Return the seeds of the drives of a tuning. The first seed also scrambles the Sobol sequence of settings."""
        first = int(self.digest[:8], 16) * MAX_DRIVES + tuning * self.tune_drives
        return range(first, first + self.tune_drives)

    @property
    def seeds_to_judge_on(self) -> range:
        """The seeds of the evaluation drives, which no tuning uses."""
        first = self.seeds_to_tune_on(self.tunings)[0]
        return range(first, first + self.judged_drives)

    @property
    def compared(self) -> tuple[str, ...]:
        """The names of the adaptations that are compared with the plain filter."""
        return tuple(name for name in self.adaptations if not self.only or name in self.only)

    @property
    def plains(self) -> list[AuditMethod]:
        """The plain filters: each filter of the protocol without adaptation."""
        return [AuditMethod(model, self.plain) for model in self.filters]

    @property
    def methods(self) -> list[AuditMethod]:
        """The compared methods: each filter of the protocol with each compared adaptation."""
        return [AuditMethod(model, name) for model in self.filters for name in self.compared]

    @property
    def competing(self) -> list[AuditMethod]:
        """The plain filters, the methods that are compared with the plain filters, and the reference methods."""
        references = [AuditMethod(model, name) for model in self.filters for name in self.references]
        return [*self.plains, *self.methods, *references]

    @property
    def separate(self) -> list[AuditMethod]:
        """The estimators that the audit evaluates separately, some of them with each adaptation that they support."""
        without_adaptation = [AuditMethod(name, self.plain) for name in self.apart]
        taken = {name: plugins.create("filter", {"name": name}).adaptations for name in self.apart_with_adaptations}
        adapted = [AuditMethod(name, rule) for name in taken for rule in self.compared if rule in taken[name]]
        return [*without_adaptation, *adapted]

    def searches(self, method: AuditMethod) -> tuple[int, ...]:
        """Return the number of settings of each search of a method. A plain filter has a short and a long search."""
        return (self.trials, self.plain_trials) if method in self.plains else (self.trials,)

    def tunings_of(self, method: AuditMethod) -> range:
        """Return the indices of the tunings of a method. Separately evaluated estimators may have fewer tunings."""
        return range(self.tunings if method.filter in self.filters else min(self.apart_tunings, self.tunings))

    def settings_of(self, method: AuditMethod, tuning: int) -> tuple[Setting, ...]:
        """Return the candidate settings of a method in a tuning. The first candidate is the default setting."""
        return _settings(max(self.searches(method)), self.jobs[method][1], self.seeds_to_tune_on(tuning)[0])

    def judges(self, method: AuditMethod) -> range:
        """Return the seeds of the drives on which a tuned method is evaluated."""
        return self.seeds_to_judge_on[: None if method.filter in self.filters else self.apart_drives]


_settings = lru_cache(maxsize=8192)(tried_settings)


def read_protocol(scale: str) -> AuditProtocol:
    """Read the protocol of an audit from conf/audit/``scale``.yaml.

    Raises:
        PluginError: The protocol is unknown or inconsistent.
    """
    stated = preset("audit", scale)
    return audit_protocol({**stated, "laws": preset("dataset", str(stated.get("dataset")))}, f"conf/audit/{scale}.yaml")


def audit_protocol(stated: Mapping[str, Any], where: str | Path) -> AuditProtocol:
    """Create an audit protocol from the values ``stated``. Error messages contain the file name ``where``.

    Raises:
        PluginError: A parameter is missing or unknown, or the protocol is inconsistent.
    """
    return AuditProtocol(**_fields(AuditProtocol, stated, where))
