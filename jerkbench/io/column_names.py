"""The meaning (quantity, axis and unit) of column names, from the spellings of common loggers."""

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
"""The meaning of each spelling of a unit, vector, axis, scalar or file name."""

_IGNORED, _PREFERRED = set(_KNOWN["ignored"].split()), _KNOWN["preferred"].lower().split()
_SMALL = ("cm", "mm")
"""Units of length that are allowed only for heights and standard deviations, because only these have a parameter for
the unit or the scale."""

_TOPIC = re.compile(rf"^/?({'|'.join(_KNOWN['topics'].split())})(_\d+|\[\d+\])?[./]")
"""The name of a PX4 topic before the name of a column, for example vehicle_gps_position.lat."""

_OF_UNIT = {"m/s2": "accel", "g": "accel", "rad/s": "gyro", "deg/s": "gyro", "m/s": "velocity"}
"""The quantity of axes without any other name, for example "X (m/s^2)"."""

SENSOR_AXES = (("x", "y", "z"), ("forward", "left", "up"), ("forward", "right", "down"))
"""Names of an IMU's axes."""

_LOCAL = {("east", "north", "up"): "enu", ("north", "east", "down"): "ned", ("x", "y", "z"): ""}
"""Names of local axes, and their frame if the names identify it."""


class Name(NamedTuple):
    """The meaning of a column name.

    Attributes:
        column: the column name.
        quantity: accel, gyro, velocity, position, sigma (of a position), covariance, time, tow (time of week), week,
            latitude, longitude, height, roll, pitch, yaw or instance (number of one of several sensors).
        axis: x, y, z, east, north, up, down, forward, left, right, horizontal or vertical, or an empty string for a
            quantity without axes.
        unit: the unit in the name, or an empty string if the name contains no unit.
    """

    column: str
    quantity: str
    axis: str
    unit: str


class Triple(NamedTuple):
    """Three columns that form a vector.

    Attributes:
        names: names of the columns, with their meanings.
        frame: the frame that the names identify, or an empty string if the names identify no frame.
    """

    names: tuple[Name, ...]
    frame: str

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns in the file."""
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
    """Return the meaning of a column name, or None if unknown. The name of ``file`` may identify the sensor."""
    name = _TOPIC.sub("", column.strip())
    parts, unit = _parts(name)
    plain = re.sub(r"\.0?(\d)$", r"[\1]", name.lower())  # PlotJuggler writes a[0] as a.00
    bare = re.sub(r"\s*[\[(].*", "", plain)
    for spelling in (plain, bare, "".join(parts)):
        if spelling in _COMPLETE:
            return Name(column, *_COMPLETE[spelling])
    quantity, axis = _meaning("".join(parts))
    if bare in ("x", "y", "z") and (sensor := _FILES.get("".join(_parts(file)[0]))):
        quantity, axis = sensor, bare
    elif quantity == "position" and bare in ("x", "y", "z"):
        quantity = _OF_UNIT.get(unit, quantity)
    is_count = parts in (["x"], ["y"], ["z"]) and "raw" in bare  # x_raw is a count of a converter and no position
    allowed = unit not in _SMALL or quantity in ("sigma", "height")
    return Name(column, quantity, axis, unit) if quantity and allowed and not is_count else None


def _meaning(text: str) -> tuple[str, str]:
    """Return the quantity and the axis of a column name without its unit, or empty strings if the name is unknown."""
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


def _parts(column: str) -> tuple[list[str], str]:
    """Split a column name, and return its lower-case parts (without ignored parts and the unit) and its unit."""
    bracketed = re.search(r"[\[(]([^\])]*)[\])]", column)
    text = re.sub(r"[\[(].*", "", column)
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).lower() if not text.startswith(("iTOW", "hMSL")) else text.lower()
    parts = [part for part in re.split(r"[^a-z0-9]+", text) if part and part not in _IGNORED]
    if bracketed:
        return parts, UNITS.get(bracketed[1].strip().lower().replace(" ", ""), "")
    return (parts[:-1], UNITS[parts[-1]]) if len(parts) > 1 and parts[-1] in UNITS else (parts, "")


def with_meaning(names: Sequence[Name], quantity: str, axis: str = "") -> Name | None:
    """Return the column with the given quantity and axis.

    Return None if no column has this meaning, or if several columns have this meaning and none of these columns is a
    preferred column.
    """
    fitting = [name for name in names if (name.quantity, name.axis) == (quantity, axis)]
    preferred = [name for known in _PREFERRED for name in fitting if name.column.lower() == known]
    return preferred[0] if preferred else fitting[0] if len(fitting) == 1 else None


def triple(names: Sequence[Name], quantity: str, axes: Sequence[str]) -> tuple[Name, ...]:
    """Return the columns of a quantity in the order of ``axes``, or () if a column is missing or ambiguous."""
    columns = [name for axis in axes if (name := with_meaning(names, quantity, axis)) is not None]
    return tuple(columns) if len(columns) == len(axes) else ()


def common_unit(names: Sequence[Name], allowed: Mapping[str, object]) -> str:
    """Return the unit of ``names`` if all names have the same allowed unit, otherwise an empty string."""
    units = {name.unit for name in names}
    return units.pop() if len(units) == 1 and units <= set(allowed) else ""


def accel_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the specific force, or None if a column is missing or ambiguous."""
    return _first(names, "accel", dict.fromkeys(SENSOR_AXES, ""))


def gyro_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the angular rate, or None if a column is missing or ambiguous."""
    return _first(names, "gyro", dict.fromkeys(SENSOR_AXES, ""))


def position_columns(names: Sequence[Name]) -> Triple | None:
    """Return the position columns, with geodetic columns preferred to local axes, or None if a column is missing."""
    places = [
        name for quantity in ("latitude", "longitude", "height") if (name := with_meaning(names, quantity)) is not None
    ]
    return Triple(tuple(places), "geodetic") if len(places) == 3 else _first(names, "position", _LOCAL)


def velocity_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of velocities, or None if a column is missing or ambiguous."""
    return _first(names, "velocity", _LOCAL | {("forward", "left", "up"): "body"})


def sigma_of(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the standard deviations of positions, or None if the column names contain no axes."""
    local = _first(names, "sigma", {axes: frame for axes, frame in _LOCAL.items() if frame})
    return local or _first(names, "sigma", {("horizontal", "horizontal", "vertical"): "enu"})


def covariance_columns(names: Sequence[Name]) -> tuple[str, ...]:
    """Return the nine or six columns (11, 22, 33, 12, 13, 23) of a position covariance, or () if one is missing."""
    columns = triple(names, "covariance", "012345678") or triple(names, "covariance", "048125")
    return tuple(name.column for name in columns)


def _first(names: Sequence[Name], quantity: str, frames: Mapping[tuple[str, str, str], str]) -> Triple | None:
    for axes, frame in frames.items():
        if columns := triple(names, quantity, axes):
            return Triple(columns, frame)
    return None
