"""The protocol of a suite: drives, faults, seeds, budget, metrics; read from conf/suite, refused if it changed."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jerkbench.audit.campaign import TEST_FROM
from jerkbench.audit.protocol import Family, digest_of, require_halves
from jerkbench.audit.scenarios import Scenario, scenarios
from jerkbench.errors import PluginError, unknown
from jerkbench.presets import preset
from jerkbench.suite.frozen import FROZEN


@dataclass(frozen=True)
class SuiteProtocol:
    """What a suite runs an entry on, and how long it is tuned.

    Attributes:
        name: of the suite.
        duration_s: of each simulated drive [s].
        fields: data sets by the kind of their GNSS noise.
        plain: names of the filter and the adaptation that every entry is compared with.
        metrics: what is computed from each run; the first one is tuned for.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a lost run [m].
        trials: settings that a method may try on each half, the one that it comes with among them.
        tune_seeds: seeds of a scenario to try settings on.
        test_seeds: seeds of a scenario to score on.
        margin: a ratio within 1 + margin is equal.
        families: the faults.
    """

    name: str
    duration_s: float
    fields: Mapping[str, str]
    plain: Mapping[str, str]
    metrics: tuple[str, ...]
    burn_in_s: float
    divergence_limit_m: float
    trials: int
    tune_seeds: int
    test_seeds: int
    margin: float
    families: tuple[Family, ...]

    def __post_init__(self) -> None:
        """Check that both halves have a family."""
        require_halves("suite", self.families)

    @property
    def digest(self) -> str:
        """The first 12 digits of the SHA-256 of all of it."""
        return digest_of(self)

    @property
    def seeds_to_tune_on(self) -> tuple[int, ...]:
        """The seeds on which every setting is tried."""
        return tuple(range(self.tune_seeds))

    @property
    def seeds_to_test_on(self) -> tuple[int, ...]:
        """The seeds on which the chosen settings are scored; they follow from the digest, as those of an audit do."""
        first = TEST_FROM + int(self.digest[:6], 16)
        return tuple(range(first, first + self.test_seeds))

    @property
    def scenarios(self) -> tuple[Scenario, ...]:
        """Every scenario, in order."""
        return tuple(scenarios(self))


def read_suite(scale: str) -> SuiteProtocol:
    """Return the suite conf/suite/``scale``.yaml.

    Raises:
        PluginError: there is none, or it is not what was frozen.
    """
    if scale not in FROZEN:
        raise PluginError(unknown("suite", scale, FROZEN))
    protocol = _protocol(scale, preset("suite", scale))
    if protocol.digest != FROZEN[scale].protocol:
        raise PluginError(
            f"conf/suite/{scale}.yaml is not {protocol.name} any more: its digest is {protocol.digest}, the frozen one"
            f" {FROZEN[scale].protocol}. Take the change back; whatever differs is a new suite, in a file of its own."
        )
    return protocol


def _protocol(scale: str, plain: Mapping[str, Any]) -> SuiteProtocol:
    known = {field.name for field in dataclasses.fields(SuiteProtocol)}
    values: dict[str, Any] = {key: tuple(v) if isinstance(v, list) else v for key, v in plain.items()}
    only = values.pop("only", tuple(values["families"]))
    for key in values:
        if key not in known:
            raise PluginError(f"conf/suite/{scale}.yaml: " + unknown("parameter", key, known))
    families = tuple(Family(name=name, **own) for name, own in values["families"].items() if name in only)
    return SuiteProtocol(**{**values, "families": families})
