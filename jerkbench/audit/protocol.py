"""The protocol of an audit: what is compared, on what, with which budget; read from conf/audit, and hashed."""

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.presets import preset

HALVES = ("first", "second")
"""What is tuned on one is scored on the other."""

LATER = {"later": True}
"""Of a field that came after protocols had been published: empty, it is no part of the digest."""


@dataclass(frozen=True)
class Family:
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
    dataset: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the half and that there is a severity."""
        if self.half not in (*HALVES, "both"):
            raise PluginError(f"family {self.name}: " + unknown("half", self.half, [*HALVES, "both"]))
        if not self.severities:
            raise PluginError(f"family {self.name} has no severity; give at least one: severities: {{usual: {{}}}}.")


class Faults(Protocol):
    """Whatever says on which fields which families of faults are compared."""

    @property
    def duration_s(self) -> float:
        """Length of each simulated drive [s]."""

    @property
    def fields(self) -> Mapping[str, str]:
        """Data sets by the kind of their GNSS noise."""

    @property
    def families(self) -> tuple[Family, ...]:
        """The faults."""


@dataclass(frozen=True)
class AuditProtocol:
    """What an audit compares, on what, and how long it searches.

    Attributes:
        version: of the protocol.
        duration_s: of each simulated drive [s].
        fields: data sets by the kind of their GNSS noise.
        filters: the kinematic filters that every adaptation runs on.
        adaptations: names; empty: every one that there is in the tree.
        plain: the adaptation that the others are compared with.
        references: adaptations that are scored and never compared.
        trials: settings that each method may try, its defaults among them.
        restarts: how many searches, each with another scramble.
        finalists: settings that are tried again on the seeds to choose on.
        tune_seeds: seeds of a scenario to try settings on.
        choose_seeds: seeds of a scenario to choose among the finalists on.
        test_seeds: seeds of a scenario to score on.
        margin: a ratio within 1 + margin is equal.
        families: the faults.
        only: names of the families to take; empty: all.
        apart: estimators of another kind with the plain adaptation, tuned alike, scored and never compared.
    """

    version: int
    duration_s: float
    fields: Mapping[str, str]
    filters: tuple[str, ...]
    plain: str
    references: tuple[str, ...]
    trials: int
    restarts: int
    finalists: int
    tune_seeds: int
    choose_seeds: int
    test_seeds: int
    margin: float
    families: tuple[Family, ...]
    adaptations: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    apart: tuple[str, ...] = dataclasses.field(default=(), metadata=LATER)

    def __post_init__(self) -> None:
        """Check that every name exists and both halves have a family."""
        for name in (*self.adaptations, self.plain, *self.references):
            plugins.get("adaptation", name)
        for name in (*self.filters, *self.apart):
            plugins.get("filter", name)
        require_halves("audit", self.families)

    @property
    def compared(self) -> tuple[str, ...]:
        """The adaptations that are compared, with the plain one first."""
        names = self.adaptations or tuple(
            name for name in plugins.names("adaptation") if plugins.is_own(plugins.get("adaptation", name))
        )
        rest = [name for name in names if name not in (self.plain, *self.references)]
        return (self.plain, *rest)

    @property
    def digest(self) -> str:
        """The first 12 digits of the SHA-256 of all of it."""
        return digest_of(self)


def digest_of(protocol: Any) -> str:  # noqa: ANN401 - any dataclass
    """Return the first 12 digits of the SHA-256 of all that a protocol says."""
    later = {field.name for field in dataclasses.fields(protocol) if field.metadata == LATER}
    stated = {name: value for name, value in dataclasses.asdict(protocol).items() if value or name not in later}
    text = json.dumps(stated, sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def require_halves(name: str, families: Iterable[Family]) -> None:
    """Require a family of faults in each half.

    Raises:
        PluginError: one of them has none.
    """
    halves = {family.half for family in families}
    for half in HALVES:
        if half not in halves:
            raise PluginError(f"The {half} half of the {name} has no family; what is tuned needs one to be scored on.")


def read_protocol(scale: str) -> AuditProtocol:
    """Return the protocol conf/audit/``scale``.yaml.

    Raises:
        PluginError: there is none, or it does not hold together.
    """
    plain = preset("audit", scale)
    only = plain.get("only") or list(plain["families"])
    families = tuple(Family(name=name, **values) for name, values in plain.pop("families").items() if name in only)
    known = {field.name for field in dataclasses.fields(AuditProtocol)}
    for key in plain:
        if key not in known:
            raise PluginError(f"conf/audit/{scale}.yaml: " + unknown("parameter", key, known))
    lists = {key: tuple(value) for key, value in plain.items() if isinstance(value, list)}
    return AuditProtocol(**{**plain, **lists}, families=families)
