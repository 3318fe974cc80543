"""A figure that is drawn."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Picture:
    """A figure as bytes, with what belongs under it.

    Attributes:
        name: of its files, without the ending.
        caption: what it shows.
        scenario: whose runs; empty for a figure of all rows.
        png: the picture.
    """

    name: str
    caption: str
    scenario: str
    png: bytes
