"""Guesses of units and frames: by the values of columns, by the gyro against the track, by fixes against velocity."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.doctor import (
    COSINE_GAIN,
    IDENTITY,
    LEAST_COSINE,
    TOLERANCE,
    UPRIGHT,
    UPRIGHT_SHARE,
    axes_text,
    gravity_share,
    plane_fit,
)
from jerkbench.inspection.evidence import (
    DEG_PER_RAD,
    SURE,
    Turning,
    common_edges,
    mean_velocity,
    slope,
    sure_turnings,
    turning_track,
    window_means,
    without_nan_rows,
)
from jerkbench.recording import GRAVITY_MPS2, Recording

_SMALL = ("cm", "mm")
"""Lengths that only a standard deviation may be in: it has a scale."""

_NAMES = tomllib.loads((Path(__file__).parent / "names.toml").read_text(encoding="utf-8"))
UNITS, VECTORS, _AXES, SCALARS = (
    {spelling: meaning for meaning, spellings in _NAMES[kind].items() for spelling in spellings.split()}
    for kind in ("units", "vectors", "axes", "scalars")
)
"""What each spelling means."""

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
    return Name(column, quantity, axis, unit) if quantity and (unit not in _SMALL or quantity == "sigma") else None


def _meaning(text: str) -> tuple[str, str]:
    """Quantity and axis of a name without its unit; nothing where it says nothing that is known."""
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
    return (words[:-1], UNITS[words[-1]]) if len(words) > 1 and words[-1] in UNITS else (words, "")


SENSOR_AXES = (("x", "y", "z"), ("forward", "left", "up"), ("forward", "right", "down"))
"""Names of an IMU's axes."""

_LOCAL = {("east", "north", "up"): "enu", ("north", "east", "down"): "ned", ("x", "y", "z"): ""}
"""Names of local axes, and their frame where the names say it."""

MOVING = _LOCAL | {("forward", "left", "up"): "body"}
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
    return _first(names, "position", _LOCAL)


def velocity_columns(names: Sequence[Name]) -> Triple | None:
    """Return the columns of velocities."""
    return _first(names, "velocity", MOVING)


def sigma_of(names: Sequence[Name]) -> Triple | None:
    """Return the columns of the standard deviations of places, where they say their axes."""
    return _first(names, "sigma", {axes: frame for axes, frame in _LOCAL.items() if frame})


def _first(names: Sequence[Name], quantity: str, frames: dict[tuple[str, str, str], str]) -> Triple | None:
    for axes, frame in frames.items():
        if columns := triple(names, quantity, axes):
            return Triple(columns, frame)
    return None


# The guesses by values.

Value = str | float | tuple[str, ...]

STAMPS = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
"""Stamps since 1970 or 1980 are larger than these, in each unit, and smaller than 100 times that."""

RATES_HZ = (0.5, 2500.0)
"""A log's rows come so often."""

LATITUDE_RAD, LONGITUDE_RAD = np.pi / 2, np.pi

_WINDOW_S = 1.0
SCALES = {"m/s": 1.0, "km/h": 3.6, "knots": 1.94384}
"""What a velocity in each unit is multiplied with."""

_SCALE_WITHIN = 0.2
LEAST_EDGES = 10


@dataclass(frozen=True)
class Guess:
    """One guess.

    Attributes:
        parameter: of the data set table.
        value: what it is to be.
        grade: "measured" (the values say so), "named" (the column's name says so), or "unsure" (neither does).
        why: the reason, in words.
    """

    parameter: str
    value: Value
    grade: Literal["measured", "named", "unsure"]
    why: str

    def __str__(self) -> str:
        """Return it as a line that a person reads."""
        value = f"[{', '.join(self.value)}]" if isinstance(self.value, tuple) else self.value
        return f"{self.grade:<8}  {self.parameter} = {value}: {self.why}"


def is_date(stamps: FloatArray, unit: str) -> bool:
    """Return whether stamps in ``unit`` count from 1970 or 1980."""
    return unit in STAMPS and bool(STAMPS[unit] <= stamps[0] < 100 * STAMPS[unit])


def guess_time_unit(stamps: FloatArray, named: str) -> Guess:
    """Return the unit of a column of times, by its name, by the size of its stamps, or by its rate."""
    step = float(np.median(np.diff(stamps)))
    if named:
        return Guess("time_unit", named, "named", f"the column says so; the median step is {step:g} {named}")
    for unit in STAMPS:
        if is_date(stamps, unit):
            return Guess("time_unit", unit, "measured", f"{stamps[0]:.0f} is a date of our time in {unit}")
    scales = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9} if step > 0 else {}
    rates = {unit: scale / step for unit, scale in scales.items()}
    fitting = [unit for unit, rate_hz in rates.items() if RATES_HZ[0] <= rate_hz <= RATES_HZ[1]]
    if len(fitting) == 1:
        why = f"the median step is {step:g}, which makes {rates[fitting[0]]:g} Hz"
        return Guess("time_unit", fitting[0], "measured", why)
    others = f"{' or '.join(fitting)} would fit" if fitting else "no unit makes a usual rate"
    return Guess("time_unit", fitting[0] if fitting else "s", "unsure", f"the median step is {step:g}: {others}")


def guess_accel_unit(accel: FloatArray, named: str) -> Guess:
    """Return the unit of specific forces (n, 3), by the size of gravity."""
    size = float(np.median(np.linalg.norm(accel, axis=1)))
    median = f"the median of |f| is {size:.3g}"
    for unit, gravity in (("m/s2", GRAVITY_MPS2), ("g", 1.0)):
        if abs(size / gravity - 1.0) < TOLERANCE:
            return Guess("accel_unit", unit, "measured", f"{median}, gravity is {gravity:g} {unit}")
    why = f"{median}, which is gravity in no unit; is it without gravity?"
    return Guess("accel_unit", named or "m/s2", "unsure", why)


def guess_upright(accel: FloatArray) -> Guess:
    """Return a body whose z axis is up, by the axis and the sign of gravity; forward is not known yet."""
    felt, share = gravity_share(accel)
    why = f"gravity is felt on {felt} (the cosine of the angle is {share:.2f})"
    return Guess("imu_axes", UPRIGHT[felt], "measured" if share > UPRIGHT_SHARE else "unsure", why)


def guess_angle_unit(latitude: FloatArray, longitude: FloatArray, named: str) -> Guess:
    """Return the unit of latitudes and longitudes; near 0, 0 the values do not tell."""
    largest = float(np.nanmax(np.abs(latitude))), float(np.nanmax(np.abs(longitude)))
    text = f"the largest are {largest[0]:.6g} and {largest[1]:.6g}"
    if largest[0] > LATITUDE_RAD or largest[1] > LONGITUDE_RAD:
        return Guess("angle_unit", "deg", "measured", f"{text}: more than any angle in rad")
    if named:
        return Guess("angle_unit", named, "named", f"the column says so; {text}")
    return Guess("angle_unit", "rad", "unsure", f"{text}: rad, or degrees in the Gulf of Guinea")


def guess_gyro_unit(recording: Recording, named: str) -> Guess:
    """Return the unit of a gyro that was read as if it were in rad/s, by the track and by gravity."""
    for turning in sure_turnings(recording):
        for unit, factor in (("rad/s", 1.0), ("deg/s", 1 / DEG_PER_RAD)):
            if turning.is_about(factor):
                return Guess("gyro_unit", unit, "measured", _turning_text(turning))
    if named:
        return Guess("gyro_unit", named, "named", "the columns say so; too few turns to see it")
    return Guess("gyro_unit", "rad/s", "unsure", "too few turns to see it, and the columns do not say it")


def turns_with_gyro(recording: Recording) -> tuple[bool | None, str]:
    """Return whether the track turns as the gyro does, None where that is not sure, and what was measured."""
    turning = turning_track(recording)
    if turning is None or abs(turning.strength) < SURE:
        return None, "too few turns to compare the track with the gyro"
    return turning.factor > 0, _turning_text(turning)


def guess_forward(recording: Recording, body: tuple[str, ...], upright: Guess) -> Guess:
    """Return what the body's axes are on the sensor, by the track's acceleration, forward and left.

    Args:
        recording: read with ``body``.
        body: the axes by which it was read, whose z axis is up.
        upright: the guess of that.
    """
    fit = plane_fit(recording)
    if upright.grade != "measured":
        return upright
    if fit is None or not fit.sure or fit.mirrors:
        return Guess("imu_axes", body, "unsure", f"{upright.why}; which way is forward cannot be told from the track")
    turned = tuple(axis.replace("--", "") for axis in axes_text(fit.way, (body[0], body[1])))
    why = f"{upright.why}; the track's acceleration fits the axes {'as they are' if fit.way == IDENTITY else fit.way}"
    return Guess("imu_axes", (*turned, body[2]), "measured", f"{why} (correlation {fit.correlation:.2f})")


def guess_velocity_frame(recording: Recording, named: str) -> Guess:
    """Return the frame of velocities that were read as ENU, by the fixes' way from second to second.

    Where the fixes move at another speed the guess is unsure, and says the unit that would make them agree.
    """
    way, means = _ways(recording)
    frames = {"enu": means, "ned": means[:, [1, 0, 2]] * [1.0, 1.0, -1.0]}
    size = float(np.sqrt(np.sum(way**2) * np.sum(means**2))) or 1.0
    cosines = {frame: float(np.sum(way * values)) / size for frame, values in frames.items()}
    other, best = sorted(cosines, key=lambda frame: cosines[frame])
    if cosines[best] < LEAST_COSINE or cosines[best] - cosines[other] < COSINE_GAIN:
        grade, why = ("named", "the columns say so") if named else ("unsure", "the columns do not say it")
        return Guess("velocity_frame", named or "enu", grade, f"{why}; the fixes do not show it")  # type: ignore[arg-type]
    why = f"cosine with the fixes' way: {', '.join(f'{frame} {cosine:.3f}' for frame, cosine in cosines.items())}"
    factor = slope(way, frames[best])
    unit = next((unit for unit, scale in SCALES.items() if abs(factor * scale - 1.0) < _SCALE_WITHIN), "")
    if unit == "m/s":
        return Guess("velocity_frame", best, "measured", why)
    unit = unit or "no unit that is known"
    why = f"{why}; but the fixes move {factor:.3g} times as fast: {unit}; make m/s of it"
    return Guess("velocity_frame", best, "unsure", why)


def _ways(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """The fixes' velocity (n, 3) from second to second, and the mean of those measured; none where they are few."""
    position, velocity = recording.position, recording.velocity
    if position is not None and velocity is not None:
        fix_s, places = without_nan_rows(position.t_s, position.enu_m)
        t_s, mps = without_nan_rows(velocity.t_s, velocity.mps)
        edges_s = common_edges(_WINDOW_S, fix_s, t_s)
        if len(edges_s) >= LEAST_EDGES:
            return mean_velocity(fix_s, places, edges_s), window_means(t_s, mps, edges_s)
    return np.empty((0, 3)), np.empty((0, 3))


def _turning_text(turning: Turning) -> str:
    turns = f"{turning.basis} turns {turning.factor:.3g} times as fast as the gyro's numbers"
    return f"{turns} (correlation {turning.correlation:.2f})"
