"""The scenarios of an audit: every family of faults at every severity, on every field."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jerkbench.audit.protocol import Family, Faults
from jerkbench.cells.cell import Cell
from jerkbench.cells.from_names import Part, cell_of_parts
from jerkbench.cells.protocol import Protocol

ERROR = "position_rmse"
"""The metric that is tuned for."""


@dataclass(frozen=True)
class Scenario:
    """A fault on a field.

    Attributes:
        noise: kind of the field's GNSS noise.
        dataset: the field with its parameters.
        family: of the fault.
        severity: of the fault.
        half: "first", "second" or "both".
        disturbance: with its parameters.
    """

    noise: str
    dataset: dict[str, Any]
    family: str
    severity: str
    half: str
    disturbance: dict[str, Any]

    @property
    def name(self) -> str:
        """What tables call it."""
        fault = self.family if self.severity == self.family else f"{self.family} {self.severity}"
        return f"{self.noise}, {fault}"


def scenarios(protocol: Faults) -> Iterator[Scenario]:
    """Yield every scenario of the protocol."""
    for noise, field in protocol.fields.items():
        for family in protocol.families:
            for severity in family.severities:
                yield _scenario(protocol, noise, field, family, severity)


def _scenario(protocol: Faults, noise: str, field: str, family: Family, severity: str) -> Scenario:
    """Put the severity's parameters where they belong: into what makes the fault, data set or disturbance."""
    parameters = dict(family.severities[severity])
    of_field = {**family.dataset, **parameters} if family.dataset else {}
    dataset = {"name": field, "duration_s": protocol.duration_s, **of_field}
    disturbance = {"name": family.disturbance, **({} if family.dataset else parameters)}
    return Scenario(noise, dataset, family.name, severity, family.half, disturbance)


def cell_on(
    scenario: Scenario,
    model: Part,
    adaptation: Part,
    seeds: int,
    metrics: Sequence[str] = (ERROR,),
    r_scale: Mapping[str, float] | None = None,
    attitude: Part | None = None,
) -> Cell:
    """Return the cell of a method, as it is given or at its defaults, on a scenario.

    Without ``attitude`` it has that of the data set.

    Raises:
        PluginError: they do not fit together.
    """
    single = {
        "dataset": scenario.dataset,
        "attitude": attitude,
        "filter": model,
        "adaptation": adaptation,
        "engine": "compiled",
    }
    cell = cell_of_parts(single, [scenario.disturbance], None, Protocol(seeds=seeds), metrics, r_scale)
    labels = cell.labels._replace(dataset=scenario.noise, disturbance=scenario.name.split(", ", 1)[1])
    return dataclasses.replace(cell, labels=labels)
