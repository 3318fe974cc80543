"""What plugins say of themselves: what a method is, the range and the origin of a parameter, how a column is read.

A field that one would tune says within which bounds, and on which scale::

    accel_mps2: Annotated[float, Range(0.01, 10.0, log=True, source="..."), DefaultOrigin("...")] = 0.2
"""

import dataclasses
import math
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any, Literal, NamedTuple, get_args

from jerkbench.errors import PluginError


@dataclasses.dataclass(frozen=True)
class Range:
    """The values of a parameter that a search may try.

    Attributes:
        low: the smallest.
        high: the largest.
        log: whether equal factors count alike, not equal differences.
        toward_one: whether equal factors of 1 - x count alike: of a share that may come near to one.
        source: where the bounds come from.
    """

    low: float
    high: float
    log: bool = False
    toward_one: bool = False
    source: str = ""

    def value(self, share: float) -> float:
        """Return the value at ``share`` of the way from low to high, 0 to 1, on the range's scale."""
        value = self.low + share * (self.high - self.low)
        if self.log:
            value = self.low * (self.high / self.low) ** share
        elif self.toward_one:
            value = 1.0 - (1.0 - self.low) * ((1.0 - self.high) / (1.0 - self.low)) ** share
        return min(max(value, self.low), self.high)

    def share(self, value: float) -> float:
        """Return how much of the way from low to high ``value`` is, on the range's scale: the inverse of `value`."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        if self.toward_one:
            return math.log((1.0 - value) / (1.0 - self.low)) / math.log((1.0 - self.high) / (1.0 - self.low))
        return (value - self.low) / (self.high - self.low)

    def mistake(self) -> str:
        """Return what is wrong with the bounds, or an empty string."""
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            return f"low is {self.low:g} and high {self.high:g}; low < high is needed, both finite"
        if self.log and self.toward_one:
            return "log and toward_one are two scales; choose one"
        if self.log and self.low <= 0:
            return f"low is {self.low:g}; on a logarithmic scale it must be above 0"
        if self.toward_one and self.high >= 1:
            return f"high is {self.high:g}; with toward_one it must be below 1"
        return "" if self.source else "source is empty; say where the bounds come from"

    def __str__(self) -> str:
        """Say the bounds and the scale."""
        scale = ", logarithmic" if self.log else ", logarithmic in 1 - x" if self.toward_one else ""
        return f"{self.low:g} to {self.high:g}{scale}"


@dataclasses.dataclass(frozen=True)
class Limit:
    """What a parameter may be.

    Attributes:
        fits: whether it may have a value; null is not asked about.
        words: what it must be: the end of the error's sentence.
    """

    fits: Callable[[Any], object]
    words: str


PLUGIN_TITLES: dict[type, str] = {}
"""What an error's sentence begins with: kind and name of a plugin, as it was registered."""


class Limited:
    """A plugin that checks its parameters against the limits beside their types."""

    def __post_init__(self) -> None:
        """Check them.

        Raises:
            PluginError: one is not within its limit.
        """
        own: type = type(self)
        for name, notes in _notes(own).items():
            value = getattr(self, name)
            for limit in notes:
                if isinstance(limit, Limit) and value is not None and not limit.fits(value):
                    raise PluginError(f"{PLUGIN_TITLES.get(type(self), '')}{name} is {value}; {limit.words}")


NOT_NEGATIVE = Limit(lambda value: 0 <= value < math.inf, "it must be zero or positive, and finite.")
ABOVE_ZERO = Limit(lambda value: 0 < value < math.inf, "it must be a positive number.")


SWITCH = Range(0.0, 1.0, source="off or on")
"""Beside the type of a switch that a search may turn."""


@dataclasses.dataclass(frozen=True)
class DefaultOrigin:
    """The origin of a default: literature, a data sheet, what it was tuned on.

    Attributes:
        text: one phrase.
    """

    text: str


class Column(NamedTuple):
    """How a column of a metric is read.

    Attributes:
        title: in words; empty: those of its name.
        expected: what a consistent filter gives; then neither the lowest nor the highest is the best.
        judged: whether tables and pages say who is better: the lowest is, and a ratio says by how much. Not so of a
            count, of what an adaptation did, of a bound, of what is the better the higher it is, and of a logarithm,
            which has no ratio.
        reading: how to read more or less than what is expected.
        section: its place among the sections of table.md, where it applies; 0: it has none.
        unit: beside a title; empty: the one that the end of its name stands for, or none (a ratio).
    """

    title: str = ""
    expected: float | None = None
    judged: bool = True
    reading: str = "more is overconfident, less too cautious"
    section: int = 0
    unit: str = ""

    @property
    def heading(self) -> str:
        """Title and unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    @property
    def lowest_is_best(self) -> bool:
        """Whether the lowest is the best, and a ratio says by how much; if not, nothing is judged."""
        return self.judged and self.expected is None


@dataclasses.dataclass(frozen=True)
class Provenance:
    """What a method is: as published, simplified, or its author's own.

    Attributes:
        kind: "published" (as in its source), "simplified" (something is left out or changed) or "own".
        source: a DOI, or authors and year; of an own method, what it builds on.
        note: what is left out or changed, or what an own method is: one sentence.
    """

    kind: Literal["published", "simplified", "own"]
    source: str
    note: str = ""

    def mistake(self) -> str:
        """Return what is missing or too much, or an empty string."""
        if self.kind not in get_args(Provenance.__annotations__["kind"]):
            return f"kind is {self.kind!r}; it is published, simplified or own"
        if self.kind != "own" and not self.source:
            return f"a {self.kind} method has a source: a DOI, or authors and year"
        if (self.kind == "published") != (not self.note):
            return "what is published as it is needs no note; all else needs one: what is left out, or what it is"
        return (
            "" if not self.note or self.note.endswith(".") else "the note is no sentence: it ends without a full stop"
        )

    def __str__(self) -> str:
        """Say it in one line."""
        source = f" ({self.source})" if self.source else ""
        return f"{self.kind}{source}: {self.note}" if self.note else f"{self.kind}{source}"


def provenance_of(cls: type) -> Provenance | None:
    """Return what a method says that it is, not what it is a variant of; None where it does not say."""
    known = vars(cls).get("provenance")
    return known if isinstance(known, Provenance) else None


def ranges_of(cls: type) -> Mapping[str, Range]:
    """Return the range of each field of a plugin's class that has one."""
    return {name: note for name, notes in _notes(cls).items() for note in notes if isinstance(note, Range)}


def origins_of(cls: type) -> Mapping[str, str]:
    """Return the origin of the default of each field that says one."""
    return {name: note.text for name, notes in _notes(cls).items() for note in notes if isinstance(note, DefaultOrigin)}


def is_whole(cls: type, name: str) -> bool:
    """Whether a field holds whole numbers."""
    return typing.get_type_hints(cls)[name] is int


def is_switch(cls: type, name: str) -> bool:
    """Whether a field is on or off."""
    return typing.get_type_hints(cls)[name] is bool


def range_problems(cls: type) -> Iterator[str]:
    """Yield what is wrong with the ranges of parameters and with the defaults in them."""
    defaults = {f.name: f.default for f in dataclasses.fields(cls)}
    for name, bounds in ranges_of(cls).items():
        subject, default = f"{cls.__name__}.{name}", defaults[name]
        if bounds.mistake():
            yield f"The range of {subject} is not valid: {bounds.mistake()}."
        elif not isinstance(default, int | float) or isinstance(default, bool) != is_switch(cls, name):
            yield f"{subject} has a range and the default {default!r}; a search needs a number to start from."
        elif not bounds.low <= default <= bounds.high:
            yield f"The default of {subject} is {default}, outside of its range {bounds}."
        elif is_whole(cls, name) and (bounds.low % 1 or bounds.high % 1):
            yield f"{subject} is an integer; the bounds of its range are {bounds.low} and {bounds.high}."


@cache
def _notes(cls: type) -> Mapping[str, tuple[object, ...]]:
    """What stands beside the type of each field."""
    hints = typing.get_type_hints(cls, include_extras=True)
    return {f.name: getattr(hints[f.name], "__metadata__", ()) for f in dataclasses.fields(cls)}
