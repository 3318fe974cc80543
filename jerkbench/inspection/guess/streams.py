"""The streams of a table, by the names of its columns: which three columns, in which frame."""

from collections.abc import Sequence
from typing import NamedTuple

from jerkbench.inspection.guess.names import Name, triple

SENSOR_AXES = {
    ("x", "y", "z"): None,
    ("forward", "left", "up"): ("x", "y", "z"),
    ("forward", "right", "down"): ("x", "-y", "-z"),
}
"""Names of an IMU's axes, and the body's axes where the names say them."""

LOCAL = {("east", "north", "up"): "enu", ("north", "east", "down"): "ned", ("x", "y", "z"): ""}
"""Names of local axes, and their frame where the names say it."""

MOVING = LOCAL | {("forward", "left", "up"): "body"}
"""The same of velocities."""


class Vector(NamedTuple):
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


class Sensors(NamedTuple):
    """An accelerometer and a gyro on the same axes.

    Attributes:
        accel: three columns.
        gyro: three columns.
        body: what the body's axes are on the sensor, where the names say it.
    """

    accel: tuple[Name, ...]
    gyro: tuple[Name, ...]
    body: tuple[str, ...] | None


def sensors_of(names: Sequence[Name]) -> Sensors | None:
    """Return the first accelerometer and gyro that are whole."""
    for axes, body in SENSOR_AXES.items():
        accel, gyro = triple(names, "accel", axes), triple(names, "gyro", axes)
        if accel and gyro:
            return Sensors(accel, gyro, body)
    return None


def position_of(names: Sequence[Name]) -> Vector | None:
    """Return the columns of places: latitude, longitude and height before local axes."""
    angles = [[name for name in names if name.quantity == word] for word in ("latitude", "longitude", "height")]
    if all(len(columns) == 1 for columns in angles):
        return Vector(tuple(columns[0] for columns in angles), "geodetic")
    return _first(names, "position", LOCAL)


def velocity_of(names: Sequence[Name]) -> Vector | None:
    """Return the columns of velocities."""
    return _first(names, "velocity", MOVING)


def sigma_of(names: Sequence[Name]) -> Vector | None:
    """Return the columns of the standard deviations of places, where they say their axes."""
    return _first(names, "sigma", {axes: frame for axes, frame in LOCAL.items() if frame})


def _first(names: Sequence[Name], quantity: str, frames: dict[tuple[str, str, str], str]) -> Vector | None:
    for axes, frame in frames.items():
        if columns := triple(names, quantity, axes):
            return Vector(columns, frame)
    return None
