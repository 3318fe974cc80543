"""The protocol of an audit, read from conf/audit."""

from dataclasses import dataclass, field

from jerkbench import plugins
from jerkbench.campaigns.protocol import LATER, CampaignProtocol, protocol_of
from jerkbench.presets import preset

CHOOSE_FROM = 1_000
"""The first seed to choose on; those to tune on begin at 0."""


@dataclass(frozen=True, kw_only=True)
class AuditProtocol(CampaignProtocol):
    """What an audit compares, and how long it searches, besides what every campaign states.

    Attributes:
        version: of the protocol.
        filters: the kinematic filters that every adaptation runs on.
        adaptations: names; empty: every one that there is in the tree.
        plain: the adaptation that the others are compared with.
        references: adaptations that are scored and never compared.
        restarts: how many searches, each with another scramble.
        finalists: settings that are tried again on the seeds to choose on.
        choose_seeds: seeds of a scenario to choose among the finalists on.
        only: names of the families to take; empty: all.
        apart: estimators of another kind with the plain adaptation, tuned alike, scored and never compared.
    """

    version: int
    filters: tuple[str, ...]
    plain: str
    references: tuple[str, ...]
    restarts: int
    finalists: int
    choose_seeds: int
    adaptations: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    apart: tuple[str, ...] = field(default=(), metadata=LATER)

    def __post_init__(self) -> None:
        """Check that every name exists and both halves have a family."""
        for name in (*self.adaptations, self.plain, *self.references):
            plugins.get("adaptation", name)
        for name in (*self.filters, *self.apart):
            plugins.get("filter", name)
        super().__post_init__()

    @property
    def compared(self) -> tuple[str, ...]:
        """The adaptations that are compared, with the plain one first."""
        names = self.adaptations or tuple(
            name for name in plugins.names("adaptation") if plugins.is_own(plugins.get("adaptation", name))
        )
        rest = [name for name in names if name not in (self.plain, *self.references)]
        return (self.plain, *rest)

    @property
    def seeds_to_choose_on(self) -> tuple[int, ...]:
        """The seeds on which the finalists are tried again."""
        return tuple(range(CHOOSE_FROM, CHOOSE_FROM + self.choose_seeds))


def read_protocol(scale: str) -> AuditProtocol:
    """Return the protocol conf/audit/``scale``.yaml.

    Raises:
        PluginError: there is none, or it does not hold together.
    """
    return protocol_of(AuditProtocol, preset("audit", scale), f"conf/audit/{scale}.yaml")
