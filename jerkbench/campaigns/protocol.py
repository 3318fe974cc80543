"""The protocol of a campaign: on which drives, under which faults, on which seeds, with which budget."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from jerkbench.errors import PluginError, unknown
from jerkbench.jobs.job import Protocol

HALVES = ("first", "second")
"""What is tuned on one is scored on the other."""

BOTH = "both"
"""Of what is tuned on with each half, and scored with each."""

TEST_FROM = 1_000_000
"""The seeds to test on begin here, plus a number that only the protocol's digest tells: nobody has tuned on them."""

Stated = TypeVar("Stated", bound="CampaignProtocol")


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

    def __post_init__(self) -> None:
        """Check the half and that there is a severity."""
        if self.half not in (*HALVES, BOTH):
            raise PluginError(f"family {self.name}: " + unknown("half", self.half, [*HALVES, BOTH]))
        if not self.severities:
            raise PluginError(f"family {self.name} has no severity; give at least one: severities: {{usual: {{}}}}.")


@dataclass(frozen=True)
class FaultScenario:
    """A fault on a field.

    Attributes:
        noise: kind of the field's GNSS noise.
        dataset: the field with its parameters.
        family: of the fault.
        severity: of the fault.
        half: "first", "second" or "both"; where domains are tuned apart, with the domain before it: "hand first".
        disturbance: with its parameters.
    """

    noise: str
    dataset: dict[str, Any]
    family: str
    severity: str
    half: str
    disturbance: dict[str, Any]

    @property
    def fault(self) -> str:
        """The fault's name."""
        return self.family if self.severity == self.family else f"{self.family} {self.severity}"

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.noise}, {self.fault}"


@dataclass(frozen=True, kw_only=True)
class CampaignProtocol:
    """What every campaign states.

    Attributes:
        duration_s: of each simulated drive [s].
        fields: data sets by the kind of their GNSS noise.
        trials: settings that each method may try, the one that it comes with among them.
        tune_seeds: seeds of a scenario to try settings on.
        test_seeds: seeds of a scenario to score on.
        margin: a ratio within 1 + margin is equal.
        families: the faults.
    """

    duration_s: float
    fields: Mapping[str, str]
    trials: int
    tune_seeds: int
    test_seeds: int
    margin: float
    families: tuple[FaultFamily, ...]

    def __post_init__(self) -> None:
        """Check that both halves have a family."""
        for half in HALVES:
            if half not in {family.half for family in self.families}:
                raise PluginError(f"The {half} half of the faults has no family; what is tuned needs one to score on.")

    @property
    def digest(self) -> str:
        """The first 12 digits of the SHA-256 of all of it."""
        stated = dataclasses.asdict(self)
        return hashlib.sha256(json.dumps(stated, sort_keys=True, default=list).encode()).hexdigest()[:12]

    @property
    def limits(self) -> Protocol:
        """How each run is judged."""
        return Protocol()

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


def protocol_of(cls: type[Stated], stated: Mapping[str, Any], where: str) -> Stated:
    """Return the protocol that a file states.

    Args:
        cls: its class.
        stated: the content of the file; with ``only``, names of families, the others are left out.
        where: the file's name, for sentences.

    Raises:
        PluginError: it has a parameter that there is not, or does not hold together.
    """
    known = {known.name for known in dataclasses.fields(cls)}
    values: dict[str, Any] = {k: tuple(value) if isinstance(value, list) else value for k, value in stated.items()}
    only = values.get("only") or tuple(values["families"])
    for key in values:
        if key not in (*known, "only"):
            raise PluginError(f"{where}: " + unknown("parameter", key, known))
    values["families"] = tuple(
        FaultFamily(name=name, **own) for name, own in values["families"].items() if name in only
    )
    return cls(**{key: value for key, value in values.items() if key in known})
