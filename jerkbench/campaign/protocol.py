"""The protocols of the suite and the audit: methods, random drives and budgets, read from conf/suite and conf/audit."""

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.campaign.runs import FaultScenario, MethodSpec, tried_settings, tunable_space
from jerkbench.campaign.space import Setting, Space
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.job import Job, Protocol
from jerkbench.presets import preset
from jerkbench.recording import Recording

NO_DISTURBANCE = {"name": "none"}


def digest_of(stated: Mapping[str, Any]) -> str:
    """Return the first 12 digits of the SHA-256 of plain data."""
    return hashlib.sha256(json.dumps(stated, sort_keys=True, default=list).encode()).hexdigest()[:12]


def _fields(cls: type, stated: Mapping[str, Any], where: str | Path, optional: str = "") -> dict[str, Any]:
    """Return the values of a protocol. Each has to be there, except ``optional``."""
    known = {field.name for field in dataclasses.fields(cls)}
    if wrong := sorted(known ^ {*stated, *filter(None, [optional])}):
        raise PluginError(f"{where} lacks {wrong[0]}, or has it and may not; give all of {', '.join(sorted(known))}.")
    return {key: tuple(value) if isinstance(value, list) else value for key, value in stated.items()}


TEST_FROM = 1_000_000
"""The seeds to test on start here, plus a number that follows from the digest: no one has tuned on them."""


@dataclass(frozen=True, kw_only=True)
class SuiteProtocol:
    """The protocol of a suite of random drives. Settings are tuned on some drives and scored on others.

    Attributes:
        name: name of the suite.
        dataset: data set that draws a drive from its seed, with all its distributions.
        plain: names of the filter and the adaptation that every entry is compared with.
        metrics: metrics of each run; the first one is tuned for.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a run with a larger position error failed [m].
        duration_s: duration of each simulated drive [s].
        trials: settings that each method may try, the given one among them.
        tune_seeds: number of drives to tune on.
        test_seeds: number of drives to score on.
        margin: a ratio within 1 + margin is equal.
        entries: number of entries for which the verdicts hold together: each interval is at 5 % divided by it.
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
        """Digest of the protocol, with two empty parts that the first suites had."""
        return digest_of({**dataclasses.asdict(self), "fields": {}, "families": []})

    @property
    def plain_method(self) -> MethodSpec:
        """The plain filter that every entry is compared with."""
        return MethodSpec.named(**self.plain)

    def job(self, method: MethodSpec, metrics: int | None = None) -> Job:
        """Return the job of a method on the drives, with the first ``metrics`` metrics.

        Raises:
            PluginError: The method cannot be made.
        """
        limits = Protocol(burn_in_s=self.burn_in_s, divergence_limit_m=self.divergence_limit_m)
        scenario = FaultScenario("mixture", dict(self.dataset), "any", NO_DISTURBANCE)
        return method.job(scenario, limits, self.metrics[:metrics])

    @property
    def seeds_to_tune_on(self) -> range:
        """The drives on which every setting is tried."""
        return range(self.tune_seeds)

    @property
    def seeds_to_test_on(self) -> range:
        """The drives on which the chosen settings are scored."""
        first = TEST_FROM + int(self.digest[:6], 16)
        return range(first, first + self.test_seeds)


FROZEN: Mapping[str, Mapping[str, str]] = json.loads(
    Path(__file__).with_name("frozen.json").read_text(encoding="utf-8")
)
"""The digests of the protocol and the recordings of each suite. A change is a new suite with a new name."""


def read_suite(scale: str) -> SuiteProtocol:
    """Return the suite conf/suite/``scale``.yaml.

    Raises:
        PluginError: There is none, or it was changed after it was frozen.
    """
    require_known("suite", scale, FROZEN)
    stated = preset("suite", scale)
    where = f"conf/suite/{scale}.yaml, with conf/dataset/{stated['dataset']}.yaml,"
    stated = {**stated, "dataset": preset("dataset", stated["dataset"])}
    protocol = SuiteProtocol(**_fields(SuiteProtocol, stated, where))
    if protocol.digest != FROZEN[scale]["protocol"]:
        raise PluginError(
            f"{where} is not {protocol.name} any more: its digest is {protocol.digest}, the frozen one"
            f" {FROZEN[scale]['protocol']}. Take the change back; a changed suite needs a new file with a new name."
        )
    return protocol


FROZEN_DRIVES = 40
"""Number of frozen recordings. All kinds of faults occur in them."""
PARTS = 16
"""Parts of an array. The mean and the mean square of each part are hashed."""
ROUNDED_TO = 1e-4
"""They are rounded to this step, in SI units, so that rounding errors of another processor do not count."""
HASHED_ARRAYS = {
    "imu": ("t_s", "accel_mps2", "gyro_radps"),
    "position": ("t_s", "enu_m", "covariance_m2"),
    "velocity": ("t_s", "mps"),
    "heading": ("t_s", "yaw_rad"),
    "reference": ("enu_m", "velocity_mps"),
}
"""Arrays of a recording that are hashed, by stream."""


def require_recordings(scale: str, protocol: SuiteProtocol) -> None:
    """Check that the recordings are the frozen ones.

    Raises:
        RecordingError: A recording differs.
    """
    if (own := data_digest(protocol)) != FROZEN[scale]["data"]:
        raise RecordingError(
            f"The recordings are not those of {protocol.name}: their digest is {own}, the frozen one"
            f" {FROZEN[scale]['data']}. Other data are another suite; use a version of jerkbench that makes these."
        )


def data_digest(protocol: SuiteProtocol) -> str:
    """Return the first 8 digits of the SHA-256 of rounded means of the arrays of the frozen recordings."""
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
"""Kinds of adaptations that H1 averages and H2 picks from."""
MAX_DRIVES = 10_000
"""Number of seeds that are reserved for an audit."""
MIN_JUDGED = 64
"""Drives to judge on: with fewer, hardly any kind of fault has enough drives for an interval."""
MIN_TUNINGS = 3
"""Independent tunings: with fewer there is no third moment, which the intervals need."""


class AuditMethod(NamedTuple):
    """Names of a filter and an adaptation."""

    filter: str
    adaptation: str

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.filter} + {self.adaptation}"


@dataclass(frozen=True, kw_only=True)
class AuditProtocol:
    """The methods, drives and budgets of an audit. conf/audit/full.yaml explains the other attributes.

    Attributes:
        laws: the preset of the drives.
        only: names of the adaptations to take; empty: all.
    """

    version: int
    repeat: int
    dataset: str
    laws: Mapping[str, Any]
    tunings: int
    tune_drives: int
    judged_drives: int
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
        """Check that every name exists, and the numbers."""
        for name in (*self.adaptations, *self.only, self.plain, *self.references):
            plugins.get("adaptation", name)
        for name in (*self.filters, *self.apart, *self.apart_with_adaptations):
            plugins.get("filter", name)
        if (drives := self.tunings * self.tune_drives + self.judged_drives) > MAX_DRIVES:
            raise PluginError(
                f"An audit of {drives} drives is too large; {MAX_DRIVES} of all tunings together are allowed."
            )
        for name, least, reason in (
            ("judged_drives", MIN_JUDGED, "so that kinds of faults have intervals"),
            ("tunings", MIN_TUNINGS, "so that their spread can be estimated"),
        ):
            if getattr(self, name) < least:
                raise PluginError(f"{name} is {getattr(self, name)}; give {least} or more, {reason}.")

    @cached_property
    def digest(self) -> str:
        """Digest of the protocol with the distributions of the drives."""
        return digest_of(dataclasses.asdict(self))

    def job(self, method: AuditMethod) -> Job:
        """Return the job of a method with its default parameters."""
        scenario = FaultScenario(self.dataset, dict(self.laws), "any", NO_DISTURBANCE)
        return MethodSpec.named(*method).job(scenario)

    @cached_property
    def jobs(self) -> dict[AuditMethod, tuple[Job, Space]]:
        """The job and the search space of each method."""
        jobs = {method: self.job(method) for method in (*self.competing, *self.beside)}
        return {method: (job, tunable_space(job)) for method, job in jobs.items()}

    def seeds_to_tune_on(self, tuning: int) -> range:
        """The drives of a tuning. The first one is the seed of its scramble, too."""
        first = int(self.digest[:8], 16) * MAX_DRIVES + tuning * self.tune_drives
        return range(first, first + self.tune_drives)

    @property
    def seeds_to_judge_on(self) -> range:
        """The drives that no tuning has used."""
        first = self.seeds_to_tune_on(self.tunings)[0]
        return range(first, first + self.judged_drives)

    @property
    def compared(self) -> tuple[str, ...]:
        """The adaptations that are compared with the plain filter."""
        return tuple(name for name in self.adaptations if not self.only or name in self.only)

    @property
    def plains(self) -> list[AuditMethod]:
        """The plain filters."""
        return [AuditMethod(model, self.plain) for model in self.filters]

    @property
    def methods(self) -> list[AuditMethod]:
        """The methods that are compared."""
        return [AuditMethod(model, name) for model in self.filters for name in self.compared]

    @property
    def competing(self) -> list[AuditMethod]:
        """The plain filters, the methods that are compared with them, and the references."""
        references = [AuditMethod(model, name) for model in self.filters for name in self.references]
        return [*self.plains, *self.methods, *references]

    @property
    def beside(self) -> list[AuditMethod]:
        """The estimators in a table of their own, with the adaptations that they support."""
        own = [AuditMethod(name, self.plain) for name in self.apart]
        taken = {name: plugins.create("filter", {"name": name}).adaptations for name in self.apart_with_adaptations}
        return [*own, *(AuditMethod(name, rule) for name in taken for rule in self.compared if rule in taken[name])]

    def searches(self, method: AuditMethod) -> tuple[int, ...]:
        """The number of settings of each search of a method. The shorter search is the start of the longer one."""
        return (self.trials, self.plain_trials) if method in self.plains else (self.trials,)

    def tunings_of(self, method: AuditMethod) -> range:
        """The tunings of a method."""
        return range(self.tunings if method.filter in self.filters else min(self.apart_tunings, self.tunings))

    def settings_of(self, method: AuditMethod, tuning: int) -> tuple[Setting, ...]:
        """The settings that a tuning of a method tries, its default setting first."""
        return _settings(max(self.searches(method)), self.jobs[method][1], self.seeds_to_tune_on(tuning)[0])

    def judges(self, method: AuditMethod) -> range:
        """The drives that a method is judged on."""
        return self.seeds_to_judge_on[: None if method.filter in self.filters else self.apart_drives]


_settings = lru_cache(maxsize=8192)(tried_settings)


def read_protocol(scale: str) -> AuditProtocol:
    """Return the protocol conf/audit/``scale``.yaml.

    Raises:
        PluginError: There is none, or it is inconsistent.
    """
    stated = preset("audit", scale)
    return audit_protocol({**stated, "laws": preset("dataset", str(stated.get("dataset")))}, f"conf/audit/{scale}.yaml")


def audit_protocol(stated: Mapping[str, Any], where: str | Path) -> AuditProtocol:
    """Return the protocol that the file ``where`` states.

    Raises:
        PluginError: A parameter is missing or unknown, or the protocol is inconsistent.
    """
    return AuditProtocol(**_fields(AuditProtocol, stated, where, optional="" if "only" in stated else "only"))
