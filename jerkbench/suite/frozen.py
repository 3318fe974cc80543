"""The digests of what is frozen: the protocol of each suite, and the data that are simulated for it."""

from dataclasses import dataclass


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
