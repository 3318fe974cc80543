"""The meaning of the names of columns: a quantity, its axis and its unit, by the spellings of common loggers."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from jerkbench.files import read_yaml

_KNOWN = read_yaml(Path(__file__).with_name("column_names.yaml"))
UNITS, VECTORS, _AXES, SCALARS, _FILES = (
    {spelling: meaning for meaning, spellings in _KNOWN[kind].items() for spelling in spellings.split()}
    for kind in ("units", "vectors", "axes", "scalars", "files")
)
"""The meaning of each spelling."""

_IGNORED, _PREFERRED = set(_KNOWN["ignored"].split()), _KNOWN["preferred"].lower().split()
_SMALL = ("cm", "mm")
"""Lengths that only a height and a standard deviation may be in: the data set has a parameter for them."""

SENSOR_AXES = (("x", "y", "z"), ("forward", "left", "up"), ("forward", "right", "down"))
"""Names of an IMU's axes."""

_LOCAL = {("east", "north", "up"): "enu", ("north", "east", "down"): "ned", ("x", "y", "z"): ""}
"""Names of local axes, and their frame where the names say it."""


class Name(NamedTuple):
    """The meaning of a name.

    Attributes:
        column: the name.
        quantity: accel, gyro, velocity, position, sigma (of a position), covariance, time, tow (time of week), week,
            latitude, longitude, height, roll, pitch, yaw or instance.
        axis: x, y, z, east, north, up, down, forward, left, right, horizontal, vertical, or nothing.
        unit: that the name says, or nothing.
    """

    column: str
    quantity: str
    axis: str
    unit: str


class Triple(NamedTuple):
    """Three columns.

    Attributes:
        names: of the columns.
        frame: that the names say, or nothing.
    """

    names: tuple[Name, ...]
    frame: str

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns."""
        return tuple(name.column for name in self.names)


def _complete_names() -> Iterable[tuple[str, tuple[str, str, str]]]:
    for key, text in _KNOWN["columns"].items():
        quantity, unit, *axes = key.split()
        for line in text.splitlines():
            names = line.lower().split()
            for name, axis in zip(names, axes or [""] * len(names), strict=True):
                yield name, (quantity, axis, unit.strip("-"))


_COMPLETE = dict(_complete_names())


def parse_name(column: str, file: str = "") -> Name | None:
    """Return the meaning of the name of a column in a file; None if it is not known."""
    plain = column.strip().lower()
    for spelling in (plain, re.sub(r"\s*[\[(].*", "", plain)):
        if spelling in _COMPLETE:
            return Name(column, *_COMPLETE[spelling])
    words, unit = _words(column)
    quantity, axis = _meaning("".join(words))
    if plain in ("x", "y", "z") and (sensor := _FILES.get("".join(_words(file)[0]))):
        quantity, axis = sensor, plain
    allowed = unit not in _SMALL or quantity in ("sigma", "height")
    return Name(column, quantity, axis, unit) if quantity and allowed else None


def _meaning(text: str) -> tuple[str, str]:
    """Quantity and axis of a name without its unit; nothing where it is not known."""
    if text in SCALARS:
        return SCALARS[text], ""
    if text in _AXES.values() and text not in ("forward", "left"):
        return "position", text
    for spelling, quantity in VECTORS.items():
        rest = text.removeprefix(spelling)
        axis = _AXES.get(rest, rest if rest in {*_AXES.values(), "right"} else "")
        if axis and text.startswith(spelling):
            return quantity, axis
    return "", ""


def _words(column: str) -> tuple[list[str], str]:
    """Lower-case words of a name without those of sensors and units, and the unit."""
    bracketed = re.search(r"[\[(]([^\])]*)[\])]", column)
    text = re.sub(r"[\[(].*", "", column)
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).lower() if not text.startswith(("iTOW", "hMSL")) else text.lower()
    words = [word for word in re.split(r"[^a-z0-9]+", text) if word and word not in _IGNORED]
    if bracketed:
        return words, UNITS.get(bracketed[1].strip().lower().replace(" ", ""), "")
    return (words[:-1], UNITS[words[-1]]) if len(words) > 1 and words[-1] in UNITS else (words, "")


def with_meaning(names: Sequence[Name], quantity: str, axis: str = "") -> Name | None:
    """Return the column with a meaning; None if there is none, or several of which none is preferred."""
    fitting = [name for name in names if (name.quantity, name.axis) == (quantity, axis)]
    preferred = [name for known in _PREFERRED for name in fitting if name.column.lower() == known]
    return preferred[0] if preferred else fitting[0] if len(fitting) == 1 else None


def triple(names: Sequence[Name], quantity: str, axes: Sequence[str]) -> tuple[Name, ...]:
    """Return the columns of a quantity on ``axes``, in their order; nothing where one is missing or ambiguous."""
    chosen = [name for axis in axes if (name := with_meaning(names, quantity, axis)) is not None]
    return tuple(chosen) if len(chosen) == len(axes) else ()


def common_unit(names: Sequence[Name], allowed: Mapping[str, object]) -> str:
    """Return the unit that all the names say, if it is an allowed one."""
    units = {name.unit for name in names}
    return units.pop() if len(units) == 1 and units <= set(allowed) else ""


def accel_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the specific force."""
    return _first(names, "accel", dict.fromkeys(SENSOR_AXES, ""))


def gyro_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the angular rate."""
    return _first(names, "gyro", dict.fromkeys(SENSOR_AXES, ""))


def position_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of places: latitude, longitude and height before local axes."""
    places = [name for word in ("latitude", "longitude", "height") if (name := with_meaning(names, word)) is not None]
    return Triple(tuple(places), "geodetic") if len(places) == 3 else _first(names, "position", _LOCAL)


def velocity_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of velocities."""
    return _first(names, "velocity", _LOCAL | {("forward", "left", "up"): "body"})


def sigma_of(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the standard deviations of places, where they say their axes."""
    local = _first(names, "sigma", {axes: frame for axes, frame in _LOCAL.items() if frame})
    return local or _first(names, "sigma", {("horizontal", "horizontal", "vertical"): "enu"})


def covariance_columns(names: Sequence[Name]) -> tuple[str, ...]:
    """Return the nine columns of a covariance of places, or none."""
    return tuple(name.column for name in triple(names, "covariance", [str(k) for k in range(9)]))


def _first(names: Sequence[Name], quantity: str, frames: Mapping[tuple[str, str, str], str]) -> Triple | None:
    for axes, frame in frames.items():
        if columns := triple(names, quantity, axes):
            return Triple(columns, frame)
    return None
