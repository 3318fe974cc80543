"""The protocol of an audit, read from conf/audit: which methods, on which drives, with which budget."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.presets import preset
from jerkbench.tuning.entrant import Entrant, FaultScenario, knobs_of, tried_settings
from jerkbench.tuning.space import Setting, Space

PUBLISHED = ("published", "simplified")
"""Kinds of adaptations that H1 averages and H2 picks from."""

MOST_DRIVES = 10_000
"""Seeds of one audit, at most."""

FEWEST_JUDGED = 64
"""Drives to judge on: of fewer, hardly any kind of fault has enough to be told."""

FEWEST_TUNINGS = 3
"""Independent tunings: of fewer there is no third moment, which the intervals need."""


class AuditMethod(NamedTuple):
    """A filter with an adaptation, by their names."""

    filter: str
    adaptation: str

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.filter} + {self.adaptation}"

    @property
    def entrant(self) -> Entrant:
        """The method at its defaults."""
        return _entrant(*self)


_entrant = cache(Entrant.named)  # asked for with each setting


@dataclass(frozen=True, kw_only=True)
class AuditProtocol:
    """What an audit compares, and how long it searches; conf/audit/full.yaml explains all but two of it.

    Attributes:
        laws: what the preset of the drives states.
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
        """Check that every name exists, and that there are seeds for all drives."""
        for name in (*self.adaptations, *self.only, self.plain, *self.references):
            plugins.get("adaptation", name)
        for name in (*self.filters, *self.apart, *self.apart_with_adaptations):
            plugins.get("filter", name)
        if (drives := self.tunings * self.tune_drives + self.judged_drives) > MOST_DRIVES:
            raise PluginError(
                f"An audit of {drives} drives is too large; {MOST_DRIVES} of all tunings together are allowed."
            )
        if self.judged_drives < FEWEST_JUDGED:
            wanted = f"give {FEWEST_JUDGED} or more, so that kinds of faults can be told"
            raise PluginError(f"judged_drives is {self.judged_drives}; {wanted}.")
        if self.tunings < FEWEST_TUNINGS:
            wanted = f"give {FEWEST_TUNINGS} or more, so that their spread can be told"
            raise PluginError(f"tunings is {self.tunings}; {wanted}.")

    @cached_property
    def digest(self) -> str:
        """The first 12 digits of the SHA-256 of all of it, with the laws of the drives."""
        text = json.dumps(dataclasses.asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @cached_property
    def drives(self) -> FaultScenario:
        """What all methods navigate: drives that bring their own faults."""
        return FaultScenario(self.dataset, dict(self.laws), "any", "any", {"name": "none"})

    @cached_property
    def spaces(self) -> dict[AuditMethod, Space]:
        """What may be tuned of each method."""
        return {own: knobs_of(own.entrant.job(self.drives)) for own in (*self.competing, *self.beside)}

    # Seeds: each is a drive.

    def seeds_to_tune_on(self, tuning: int) -> range:
        """The drives of a tuning; the first of them is the seed of its scramble as well."""
        first = int(self.digest[:8], 16) * MOST_DRIVES + tuning * self.tune_drives
        return range(first, first + self.tune_drives)

    @property
    def seeds_to_judge_on(self) -> range:
        """The drives that no tuning has seen."""
        first = self.seeds_to_tune_on(self.tunings)[0]
        return range(first, first + self.judged_drives)

    # Methods.

    @property
    def compared(self) -> tuple[str, ...]:
        """The adaptations that are compared with the plain one."""
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
        """The plain filters, all that is compared with them, and the references."""
        told = [AuditMethod(model, name) for model in self.filters for name in self.references]
        return [*self.plains, *self.methods, *told]

    @property
    def beside(self) -> list[AuditMethod]:
        """The estimators that are shown apart, with the adaptations that they take."""
        own = [AuditMethod(name, self.plain) for name in self.apart]
        taken = {name: plugins.create("filter", {"name": name}).adaptations for name in self.apart_with_adaptations}
        return [*own, *(AuditMethod(name, rule) for name in taken for rule in self.compared if rule in taken[name])]

    def searches(self, method: AuditMethod) -> tuple[int, ...]:
        """How many settings each search of a method tries; the shorter one is the begin of the longer."""
        return (self.trials, self.plain_trials) if method in self.plains else (self.trials,)

    def tunings_of(self, method: AuditMethod) -> range:
        """The tunings of a method."""
        return range(self.tunings if method.filter in self.filters else min(self.apart_tunings, self.tunings))

    def settings_of(self, method: AuditMethod, tuning: int) -> tuple[Setting, ...]:
        """The settings that a tuning tries of a method, its defaults first; a longer search begins as a shorter one."""
        return _settings(max(self.searches(method)), self.spaces[method], self.seeds_to_tune_on(tuning)[0])

    def judges(self, method: AuditMethod) -> range:
        """The drives that a method is judged on."""
        return self.seeds_to_judge_on[: None if method.filter in self.filters else self.apart_drives]


_settings = lru_cache(maxsize=8192)(tried_settings)


def read_protocol(scale: str) -> AuditProtocol:
    """Return the protocol conf/audit/``scale``.yaml.

    Raises:
        PluginError: there is none, or it does not hold together.
    """
    stated = preset("audit", scale)
    return audit_protocol({**stated, "laws": preset("dataset", str(stated.get("dataset")))}, f"conf/audit/{scale}.yaml")


def audit_protocol(stated: Mapping[str, Any], where: str | Path) -> AuditProtocol:
    """Return the protocol that ``stated`` says, as it stands in the file ``where``.

    Raises:
        PluginError: a parameter is missing or unknown, or they do not hold together.
    """
    known = {field.name for field in dataclasses.fields(AuditProtocol)}
    if wrong := sorted(known ^ {*stated, "only"}):
        raise PluginError(f"{where} lacks {wrong[0]}, or has it and may not; give all of {', '.join(sorted(known))}.")
    values: dict[str, Any] = {k: tuple(value) if isinstance(value, list) else value for k, value in stated.items()}
    return AuditProtocol(**values)
