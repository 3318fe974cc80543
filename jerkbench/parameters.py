"""Metadata of plugins: provenance, ranges and origins of parameters, factors on R, interpretation of metric columns.

The metadata of a tunable parameter are part of its type annotation::

    accel_mps2: Annotated[float, Range(0.01, 10.0, log=True, source="..."), DefaultOrigin("...")] = 0.2
"""

import dataclasses
import math
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, get_args

from jerkbench.errors import PluginError, require_known


@dataclasses.dataclass(frozen=True)
class Range:
    """The range in which a search may vary a parameter.

    Attributes:
        low: Lower bound of the parameter.
        high: Upper bound of the parameter.
        log: True if the search uses a logarithmic scale.
        toward_one: True if the search uses a logarithmic scale for 1 - x, which suits fractions x close to one.
        source: Origin of the bounds, for example a publication.
    """

    low: float
    high: float
    log: bool = False
    toward_one: bool = False
    source: str = ""

    def value(self, share: float) -> float:
        """Return the parameter value at the fraction ``share`` (0 to 1) of the range, on the scale of the range."""
        value = self.low + share * (self.high - self.low)
        if self.log:
            value = self.low * (self.high / self.low) ** share
        elif self.toward_one:
            value = 1.0 - (1.0 - self.low) * ((1.0 - self.high) / (1.0 - self.low)) ** share
        return min(max(value, self.low), self.high)

    def share(self, value: float) -> float:
        """Return the fraction (0 to 1) of the range at which ``value`` lies, measured on the scale of the range."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        if self.toward_one:
            return math.log((1.0 - value) / (1.0 - self.low)) / math.log((1.0 - self.high) / (1.0 - self.low))
        return (value - self.low) / (self.high - self.low)

    @property
    def valid(self) -> bool:
        """True if the bounds are finite and suit the scale of the range, and the source of the bounds is given."""
        suits = (self.low > 0 or not self.log) and (self.high < 1 or not self.toward_one)
        finite = -math.inf < self.low < self.high < math.inf
        return finite and suits and not (self.log and self.toward_one) and bool(self.source)

    def __str__(self) -> str:
        scale = ", logarithmic" if self.log else ", logarithmic in 1 - x" if self.toward_one else ""
        return f"{self.low:g} to {self.high:g}{scale}"


@dataclasses.dataclass(frozen=True)
class Limit:
    """A condition on the value of a parameter.

    Attributes:
        fits: Function that returns whether a value is allowed. The value None is always allowed.
        words: End of the error message, for example "it must be a positive number."
    """

    fits: Callable[[Any], object]
    words: str


PLUGIN_TITLES: dict[type, str] = {}
"""Prefix of the error messages of each plugin class: the kind and name with which it was registered."""


class Limited:
    """Base class of plugins that checks the parameters against the limits in their annotations."""

    def __post_init__(self) -> None:
        """Check each parameter against the limits in its annotation.

        Raises:
            PluginError: A parameter violates its limit.
        """
        cls: type = type(self)
        for name, notes in _notes(cls).items():
            value = getattr(self, name)
            for limit in notes:
                if isinstance(limit, Limit) and value is not None and not limit.fits(value):
                    raise PluginError(f"{PLUGIN_TITLES.get(type(self), '')}{name} is {value}; {limit.words}")


NOT_NEGATIVE = Limit(lambda value: 0 <= value < math.inf, "it must be zero or positive, and finite.")
ABOVE_ZERO = Limit(lambda value: 0 < value < math.inf, "it must be a positive number.")
AT_LEAST_ONE = Limit(lambda value: value >= 1, "it must be at least 1.")
BETWEEN_0_AND_1 = Limit(lambda value: 0 < value < 1, "it must lie between 0 and 1.")


SWITCH = Range(0.0, 1.0, source="off or on")
"""The range of a tunable parameter of the type bool."""


@dataclasses.dataclass(frozen=True)
class DefaultOrigin:
    """The origin of a default value: literature, a data sheet, or the recordings of a tuning.

    Attributes:
        text: Description of the origin in one phrase.
    """

    text: str


class Column(NamedTuple):
    """The title and the interpretation of a column of a metric.

    Attributes:
        title: Title of the column, or an empty string to derive the title from the name of the column.
        expected: Expected value for a consistent filter, or None if the column has no expected value. In a column with
            an expected value, neither the lowest nor the highest value is the best.
        judged: True if methods are compared by this column, in which the lowest value is the best and differences are
            stated as ratios. ``judged`` is False for counts, bounds, activities of an adaptation, logarithms (which
            have no meaningful ratio), and columns whose highest value is the best.
        reading: Interpretation of values above and below the expected value.
        section: Position of the section in table.md, or 0 if the column is in no section.
        unit: Unit in the heading, or an empty string to derive the unit from the suffix of the name of the column.
            Ratios have no unit.
    """

    title: str = ""
    expected: float | None = None
    judged: bool = True
    reading: str = "more is overconfident, less too cautious"
    section: int = 0
    unit: str = ""

    @property
    def heading(self) -> str:
        """Title with the unit in brackets."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    @property
    def lowest_is_best(self) -> bool:
        """True if methods are compared by this column, in which the lowest value is the best."""
        return self.judged and self.expected is None


@dataclasses.dataclass(frozen=True)
class Provenance:
    """The provenance of a method: as published, simplified, or original.

    Attributes:
        kind: "published" (as in the source), "simplified" (parts are left out or changed) or "own" (original).
        source: DOI, or authors and year. For an original method, the source is the work that the method extends, or
            empty.
        note: One sentence about the parts that are left out or changed, or about the idea of an original method. The
            note of a published method is empty.
    """

    kind: Literal["published", "simplified", "own"]
    source: str
    note: str = ""

    def mistake(self) -> str:
        """Return a message about an invalid kind, source or note, or an empty string if the provenance is valid."""
        if self.kind not in get_args(Provenance.__annotations__["kind"]):
            return f"kind is {self.kind!r}; it must be published, simplified or own"
        if (self.kind != "own" and not self.source) or (self.kind == "published") != (not self.note):
            return "a published method needs a source and no note, and other methods need a note (see Provenance)"
        return ""

    def __str__(self) -> str:
        source = f" ({self.source})" if self.source else ""
        return f"{self.kind}{source}: {self.note}" if self.note else f"{self.kind}{source}"


def provenance_of(cls: type) -> Provenance | None:
    """Return the provenance that the class declares, or None. A provenance of a base class is ignored."""
    known = vars(cls).get("provenance")
    return known if isinstance(known, Provenance) else None


def ranges_of(cls: type) -> Mapping[str, Range]:
    """Return the ranges of the parameters of a plugin class, by the name of the parameter."""
    return {name: note for name, notes in _notes(cls).items() for note in notes if isinstance(note, Range)}


def origins_of(cls: type) -> Mapping[str, str]:
    """Return the origins of the default values of a plugin class, by the name of the parameter."""
    return {name: note.text for name, notes in _notes(cls).items() for note in notes if isinstance(note, DefaultOrigin)}


def type_of(cls: type, name: str) -> Any:  # noqa: ANN401 - a type
    """Return the type of a field, without the metadata in its annotation."""
    return typing.get_type_hints(cls)[name]


def range_problems(cls: type) -> Iterator[str]:
    """Yield a message for each invalid range, and for each default value that is outside its range."""
    defaults = {f.name: f.default for f in dataclasses.fields(cls)}
    for name, bounds in ranges_of(cls).items():
        subject, default = f"{cls.__name__}.{name}", defaults[name]
        if not bounds.valid:
            needs = "finite bounds (low < high, above 0 with log, below 1 with toward_one), one scale and a source"
            yield f"The range of {subject} is not valid; it needs {needs}."
        elif not isinstance(default, int | float) or isinstance(default, bool) != (type_of(cls, name) is bool):
            yield f"{subject} has a range and the default {default!r}; a search needs a number to start from."
        elif not bounds.low <= default <= bounds.high:
            yield f"The default of {subject} is {default}, outside of its range {bounds}."
        elif type_of(cls, name) is int and (bounds.low % 1 or bounds.high % 1):
            yield f"{subject} is an integer; the bounds of its range are {bounds.low} and {bounds.high}."


@cache
def _notes(cls: type) -> Mapping[str, tuple[object, ...]]:
    """Return the metadata in the type annotation of each field, by the name of the field."""
    hints = typing.get_type_hints(cls, include_extras=True)
    return {f.name: getattr(hints[f.name], "__metadata__", ()) for f in dataclasses.fields(cls)}


# Factors on the measurement covariances R that a receiver reports.

_FACTOR = Limit(
    lambda factor: isinstance(factor, float) and 0 < factor < math.inf,
    "r_scale needs positive numbers (1 leaves R as reported).",
)


@dataclasses.dataclass(frozen=True)
class RScale(Limited):
    """Factors on the reported covariances R. The factors are tunable parameters, like the process noise.

    The factors change neither the measurements nor the true covariances nor the attitude.

    Attributes:
        position: Factor on the covariance of each position [-].
        velocity: Factor on the covariance of each velocity [-].
    """

    position: Annotated[float, _FACTOR] = 1.0
    velocity: Annotated[float, _FACTOR] = 1.0

    @property
    def changed(self) -> dict[str, float]:
        """The factors that differ from 1, by name (position, velocity)."""
        return {name: value for name, value in vars(self).items() if value != 1.0}


def scale_of(values: object) -> RScale:
    """Return the factors in the mapping ``values``. If ``values`` is None, both factors are 1.

    Raises:
        PluginError: ``values`` is not a mapping, a key is unknown, or a factor is not a positive number.
    """
    factors = {} if values is None else values
    if not isinstance(factors, Mapping):
        raise PluginError(f"r_scale is {factors}; give two factors: r_scale.position=2 r_scale.velocity=0.5.")
    for name in factors:
        require_known("parameter of r_scale", str(name), [f.name for f in dataclasses.fields(RScale)])
    return RScale(**{name: float(value) if type(value) is int else value for name, value in factors.items()})


AS_REPORTED = RScale()
"""The factors that leave R as the receiver reports it."""
