"""The protocol of a suite, read from conf/suite; refused if it is not what was frozen."""

from collections.abc import Mapping
from dataclasses import dataclass

from jerkbench.campaigns.entrant import Entrant
from jerkbench.campaigns.protocol import CampaignProtocol, protocol_of
from jerkbench.errors import PluginError, unknown
from jerkbench.jobs.job import Protocol
from jerkbench.presets import preset


@dataclass(frozen=True, kw_only=True)
class SuiteProtocol(CampaignProtocol):
    """What a suite states, besides what every campaign does.

    Attributes:
        name: of the suite.
        plain: names of the filter and the adaptation that every entry is compared with.
        metrics: what is computed from each run; the first one is tuned for.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a lost run [m].
    """

    name: str
    plain: Mapping[str, str]
    metrics: tuple[str, ...]
    burn_in_s: float
    divergence_limit_m: float

    @property
    def limits(self) -> Protocol:
        """How each run is judged."""
        return Protocol(burn_in_s=self.burn_in_s, divergence_limit_m=self.divergence_limit_m)

    @property
    def plain_entrant(self) -> Entrant:
        """The plain filter that every entry is compared with."""
        return Entrant.named(self.plain["filter"], self.plain["adaptation"])


def read_suite(scale: str) -> SuiteProtocol:
    """Return the suite conf/suite/``scale``.yaml.

    Raises:
        PluginError: there is none, or it is not what was frozen.
    """
    if scale not in FROZEN:
        raise PluginError(unknown("suite", scale, FROZEN))
    protocol = protocol_of(SuiteProtocol, preset("suite", scale), f"conf/suite/{scale}.yaml")
    if protocol.digest != FROZEN[scale].protocol:
        raise PluginError(
            f"conf/suite/{scale}.yaml is not {protocol.name} any more: its digest is {protocol.digest}, the frozen one"
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
    """

    protocol: str
    data: tuple[str, ...]


FROZEN = {
    "v1": Frozen(
        protocol="1d88f1baae4c",
        data=(
            "90c4b231",
            "4cc1d53f",
            "6e2f0306",
            "cbf76c17",
            "28256383",
            "33d4f817",
            "4a767dcd",
            "2bea5d71",
            "259e8eb9",
            "575a3f23",
            "67947eb3",
            "0ea6ad9e",
            "03dadda7",
            "7e935b7f",
            "fc41deb0",
            "4e4d5848",
            "87067f89",
            "64bc12c4",
            "0a2adf53",
            "35dd97e3",
            "8271d941",
            "98b6e02b",
            "cb777b18",
            "ea8f8833",
        ),
    ),
    "tiny": Frozen(
        protocol="c8613f7239bd", data=("c7cb2e2d", "a9681d79", "2cef4710", "41700fac", "9e31e6df", "7f9195ec")
    ),
}
"""Never edited: what changes is a new suite with a name of its own."""
