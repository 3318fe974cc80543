"""The methods of an audit."""

from dataclasses import dataclass

import pandas as pd

from jerkbench.audit.protocol import AuditProtocol
from jerkbench.campaigns.entrant import Entrant, knobs_of
from jerkbench.campaigns.protocol import FaultScenario
from jerkbench.tuning.space import Space

FLOOR = "gnss_only"
"""The filter that tells what any of them is worth at all; it has nothing to tune."""


@dataclass(frozen=True, order=True)
class AuditMethod:
    """A filter with an adaptation.

    Attributes:
        filter: its name.
        adaptation: its name.
    """

    filter: str
    adaptation: str

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.filter} + {self.adaptation}"

    @property
    def entrant(self) -> Entrant:
        """The method at its defaults."""
        return Entrant.named(self.filter, self.adaptation)

    def space(self, scenario: FaultScenario) -> Space:
        """Return its knobs; empty where there is none."""
        return knobs_of(self.entrant.job(scenario))


def methods(protocol: AuditProtocol) -> list[AuditMethod]:
    """Return every method, those of one filter together, the plain one first."""
    adaptations = (*protocol.compared, *protocol.references)
    kinematic = [AuditMethod(model, adaptation) for model in protocol.filters for adaptation in adaptations]
    return [*kinematic, *(AuditMethod(name, protocol.plain) for name in (FLOOR, *protocol.apart))]


def by_method(rows: pd.DataFrame) -> dict[AuditMethod, pd.DataFrame]:
    """Return the rows of each method."""
    groups = rows.groupby(["filter", "adaptation"])
    return {AuditMethod(str(model), str(adaptation)): group for (model, adaptation), group in groups}
