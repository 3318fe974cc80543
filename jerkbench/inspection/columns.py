"""The names of columns, taken apart, and the streams that they make: which three columns, in which frame."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

SMALL = ("cm", "mm")
"""Lengths that only a standard deviation may be in: it has a scale."""

UNITS = {
    **dict.fromkeys(("degps", "dps", "deg/s", "degs", "°/s"), "deg/s"),
    **dict.fromkeys(("radps", "rad/s", "rads"), "rad/s"),
    **dict.fromkeys(("mps2", "m/s2", "m/s^2", "m/s²", "ms2"), "m/s2"),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
    **{unit: unit for unit in ("g", "s", "ms", "us", "ns", "m", *SMALL)},
    **dict.fromkeys(("mps", "m/s"), "m/s"),
    **dict.fromkeys(("sec", "seconds"), "s"),
}
"""Spellings of units at the end of a name, or in brackets."""

QUANTITIES = {
    "accel": "a acc accel accelerometer acceleration f force linearacceleration specificforce",
    "gyro": "w g gyr gyro gyroscope omega angularvelocity angularrate angrate rotationrate",
    "velocity": "v vel velocity",
    "position": "p pos position",
    "sigma": "sd std stddev sigma sdpos stdpos sigmapos possd posstd possigma",
}
"""Words that a name of a vector begins with."""

AXES = {"x": "x", "y": "y", "z": "z", "e": "east", "n": "north", "u": "up", "d": "down", "f": "forward", "l": "left"}
"""Letters of axes; the words stand for themselves."""

SCALARS = {
    "time": "t time timestamp stamp tow itow sow timeofweek secondsofweek gpsseconds",
    "week": "week wn weeknumber gpsweek",
    "latitude": "lat latitude",
    "longitude": "lon long lng longitude",
    "height": "h height alt altitude",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw heading",
}

SENSORS = {"imu", "gnss", "gps", "ins", "sensor", "drive", "meas", "measured"}
"""Words that say who measured, and not what."""


class Name(NamedTuple):
    """What a name says.

    Attributes:
        column: the name.
        quantity: accel, gyro, velocity, position, sigma (of a position), time, week, latitude, longitude, height,
            roll, pitch or yaw.
        axis: x, y, z, east, north, up, down, forward, left, right, or nothing.
        unit: that the name says, or nothing.
    """

    column: str
    quantity: str
    axis: str
    unit: str


def parse_name(column: str) -> Name | None:
    """Return what the name of a column says; None where it says nothing that is known."""
    words, unit = _words(column)
    quantity, axis = _meaning("".join(words))
    return Name(column, quantity, axis, unit) if quantity and (unit not in SMALL or quantity == "sigma") else None


def _meaning(text: str) -> tuple[str, str]:
    """Quantity and axis of a name without its unit; nothing where it says nothing that is known."""
    for quantity, spellings in SCALARS.items():
        if text in spellings.split():
            return quantity, ""
    if text in AXES.values() and text not in ("forward", "left"):
        return "position", text
    for quantity, spellings in QUANTITIES.items():
        for spelling in spellings.split():
            axis = _axis(text.removeprefix(spelling)) if text.startswith(spelling) else ""
            if axis:
                return quantity, axis
    return "", ""


def triple(names: Sequence[Name], quantity: str, axes: Sequence[str]) -> tuple[Name, ...]:
    """Return the columns of a quantity on ``axes``, in their order; nothing where one is lacking or is there twice."""
    chosen = [[name for name in names if (name.quantity, name.axis) == (quantity, axis)] for axis in axes]
    return tuple(names[0] for names in chosen) if all(len(names) == 1 for names in chosen) else ()


def common_unit(names: Sequence[Name], allowed: Mapping[str, object]) -> str:
    """Return the unit that all the names say, if it is one that may be."""
    units = {name.unit for name in names}
    return units.pop() if len(units) == 1 and units <= set(allowed) else ""


def _words(column: str) -> tuple[list[str], str]:
    """Lower-case words of a name without those of sensors and units, and the unit."""
    bracketed = re.search(r"[\[(]([^\])]*)[\])]", column)
    text = re.sub(r"[\[(].*", "", column)
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).lower()
    words = [word for word in re.split(r"[^a-z0-9]+", text) if word and word not in SENSORS]
    if bracketed:
        return words, UNITS.get(bracketed[1].strip().lower().replace(" ", ""), "")
    if len(words) > 1 and words[-1] in UNITS:
        return words[:-1], UNITS[words[-1]]
    return words, ""


def _axis(rest: str) -> str:
    return AXES.get(rest, rest if rest in {*AXES.values(), "right"} else "")


SENSOR_AXES = (("x", "y", "z"), ("forward", "left", "up"), ("forward", "right", "down"))
"""Names of an IMU's axes."""

LOCAL = {("east", "north", "up"): "enu", ("north", "east", "down"): "ned", ("x", "y", "z"): ""}
"""Names of local axes, and their frame where the names say it."""

MOVING = LOCAL | {("forward", "left", "up"): "body"}
"""The same of velocities."""


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


def sensors_of(names: Sequence[Name]) -> tuple[Triple, Triple] | None:
    """Return the first accelerometer and gyro that are whole, on the same axes."""
    for axes in SENSOR_AXES:
        accel, gyro = triple(names, "accel", axes), triple(names, "gyro", axes)
        if accel and gyro:
            return Triple(accel, ""), Triple(gyro, "")
    return None


def position_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of places: latitude, longitude and height before local axes."""
    angles = [[name for name in names if name.quantity == word] for word in ("latitude", "longitude", "height")]
    if all(len(columns) == 1 for columns in angles):
        return Triple(tuple(columns[0] for columns in angles), "geodetic")
    return _first(names, "position", LOCAL)


def velocity_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of velocities."""
    return _first(names, "velocity", MOVING)


def sigma_of(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the standard deviations of places, where they say their axes."""
    return _first(names, "sigma", {axes: frame for axes, frame in LOCAL.items() if frame})


def _first(names: Sequence[Name], quantity: str, frames: dict[tuple[str, str, str], str]) -> Triple | None:
    for axes, frame in frames.items():
        if columns := triple(names, quantity, axes):
            return Triple(columns, frame)
    return None
