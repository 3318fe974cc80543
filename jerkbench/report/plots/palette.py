"""The look of each method: one colour a filter, one line style an adaptation, in every figure and on the page."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from jerkbench.report.plots.style import OKABE_ITO

COLOURS = (*OKABE_ITO, "#332288", "#882255", "#117733", "#999933", "#661100", "#44AA99")
"""Okabe and Ito's, then the darker ones of Paul Tol's muted palette (2021)."""

DASHES = ((), (8, 4), (2, 3), (10, 3, 2, 3), (4, 2), (1, 2))
"""Lengths of dashes and gaps, in pixels; the first is a full line."""

HATCHES = ("", "////", "....", "xxxx", "----", "\\\\\\\\")
"""What stands for the dashes where a method is an area."""

PLAIN = "none"
"""The adaptation that has the full line, wherever it stands."""

POINTS = 0.5
"""Lengths of dashes in a figure, for one pixel of the page, in line widths."""

BETWEEN = re.compile(r", *(?![^()]*\))")
"""A comma that is in no parentheses."""

Method = tuple[str, str]
"""Filter and adaptation."""


class Look(NamedTuple):
    """How a method is drawn.

    Attributes:
        colour: of its filter.
        dash: of its adaptation, as on the page.
        hatch: of its adaptation, where it is an area.
    """

    colour: str
    dash: tuple[int, ...]
    hatch: str

    @property
    def line(self) -> str | tuple[float, tuple[float, ...]]:
        """The line style as matplotlib has it."""
        return (0.0, tuple(POINTS * length for length in self.dash)) if self.dash else "-"


@dataclass(frozen=True)
class Palette:
    """The filters and adaptations of a study, in the order in which they take colours and line styles.

    Attributes:
        filters: their labels.
        adaptations: their labels.
    """

    filters: tuple[str, ...]
    adaptations: tuple[str, ...]

    @classmethod
    def of(cls, methods: Iterable[Method]) -> "Palette":
        """Return the palette of ``methods``."""
        methods = list(methods)
        adaptations = dict.fromkeys(adaptation for _, adaptation in methods)
        plain = [PLAIN] * (PLAIN in adaptations)
        return cls(
            tuple(dict.fromkeys(filter_name for filter_name, _ in methods)),
            tuple(dict.fromkeys([*plain, *adaptations])),
        )

    def look(self, method: Method) -> Look:
        """Return the look of a method; one that the study has not comes after all others."""
        filter_name, adaptation = method
        dash = _place(self.adaptations, adaptation) % len(DASHES)
        return Look(COLOURS[_place(self.filters, filter_name) % len(COLOURS)], DASHES[dash], HATCHES[dash])


def method_of(name: str) -> Method:
    """Return filter and adaptation of a method's name.

    >>> method_of("jerk(a=1, b=2) + mtf, accel_mps2=0.1")
    ('jerk(a=1, b=2)', 'mtf')
    >>> method_of("gnss_only")
    ('gnss_only', 'none')
    """
    filter_name, _, rest = name.partition(" + ")
    return filter_name, BETWEEN.split(rest.partition(" + ")[0])[0] or PLAIN


def looks(names: Iterable[str], palette: Palette | None = None) -> Iterator[tuple[str, Look]]:
    """Yield each method's name with its look; without a palette in the order of the names."""
    names = list(names)
    palette = palette or Palette.of(map(method_of, names))
    return ((name, palette.look(method_of(name))) for name in names)


def _place(labels: tuple[str, ...], label: str) -> int:
    return labels.index(label) if label in labels else len(labels)
