"""Guesses from column names and values: the quantity, axis and unit of each column, and frames from comparisons.

The first part of this module contains the spellings of common loggers. The second part compares values with gravity,
and compares gyro, track and velocity with each other.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.files import read_yaml
from jerkbench.inspection.diagnostics import (
    COSINE_GAIN,
    IDENTITY,
    MIN_COSINE,
    TOLERANCE,
    axes_text,
    plane_fit,
)
from jerkbench.inspection.evidence import (
    DEG_PER_RAD,
    MIN_LOW_NORM,
    MIN_STRENGTH,
    Turning,
    cosine,
    low_and_median_norm,
    mean_velocities,
    slope,
    sure_turnings,
    turning_track,
)
from jerkbench.io.columns import TIME_UNITS
from jerkbench.io.conversions import (
    ACCEL_UNITS,
    ANGLE_UNITS,
    GYRO_UNITS,
    HEIGHT_UNITS,
    SPEED_UNITS,
    UPRIGHT,
    UPRIGHT_SHARE,
    WEEK_NS,
    gravity_share,
)
from jerkbench.io.sanitiser import MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG
from jerkbench.recording import GRAVITY_MPS2, Recording

# The meaning of column names, from the spellings of common loggers.

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


# Guesses from values.

Value = str | float | tuple[str, ...]

STAMPS = {"s": 1e8, "ms": 1e11, "us": 1e14, "ns": 1e17}
"""Minimum stamp of a date (time since 1970 or 1980) in each unit; the maximum is 100 times as large."""

RATES_HZ = (0.5, 2500.0)
"""Plausible range of the rate of the rows in a log."""

MAX_FIX_RATE_HZ = 50.0
"""Maximum plausible rate of a receiver."""

MIN_DATE_RATE_HZ = 0.01
"""Minimum rate of stamps that are dates. Stamps with a lower rate are in another unit."""

LATITUDE_RAD, LONGITUDE_RAD = np.pi / 2, np.pi
MIN_MM = 20_000.0
"""A height with a larger absolute value is in millimetres."""

_WINDOW_S = 1.0

_SCALE_WITHIN = 0.2


@dataclass(frozen=True)
class Guess:
    """A guessed value of one parameter, with its reason.

    Attributes:
        parameter: name of a parameter of the data set `table`.
        value: the guessed value of the parameter.
        grade: "measured" (based on the values), "named" (based on the name of the column), or "unsure" (neither).
        why: reason for the guess, as text.
    """

    parameter: str
    value: Value
    grade: Literal["measured", "named", "unsure"]
    why: str

    def __str__(self) -> str:
        value = f"[{', '.join(self.value)}]" if isinstance(self.value, tuple) else self.value
        return f"{self.grade:<8}  {self.parameter} = {value}: {self.why}"


def is_date(stamps: FloatArray, unit: str) -> bool:
    """Return True if the stamps, interpreted in ``unit``, are plausible times since 1970 or 1980."""
    return unit in STAMPS and len(stamps) > 0 and bool(STAMPS[unit] <= stamps[0] < 100 * STAMPS[unit])


def guess_time_unit(stamps: FloatArray, named: str, *, fixes: bool = False, of_week: bool = False) -> Guess:
    """Guess the unit of a column of times from its name, from the size of its stamps, or from its rate.

    Args:
        stamps: times in the column.
        named: unit in the name of the column, or an empty string.
        fixes: if true, all rows are fixes of a receiver, which has a lower rate than an IMU.
        of_week: if true, the times are times of the GPS week, from 0 to 604 800 s, according to the column names.
    """
    step = float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    if named:
        return Guess("time_unit", named, "named", f"stated by the column; the median step is {step:g} {named}")
    rates = {unit: 1e9 / TIME_UNITS[unit] / step if step > 0 else 0.0 for unit in STAMPS}
    for unit in () if of_week else STAMPS:
        if is_date(stamps, unit) and rates[unit] >= MIN_DATE_RATE_HZ:
            return Guess("time_unit", unit, "measured", f"{stamps[0]:.0f} {unit} is a plausible date")
    fastest_hz = MAX_FIX_RATE_HZ if fixes else RATES_HZ[1]
    fitting = [unit for unit, rate_hz in rates.items() if RATES_HZ[0] <= rate_hz <= fastest_hz]
    if of_week:
        fitting = [unit for unit in fitting if stamps.max() <= WEEK_NS / TIME_UNITS[unit]]
    if len(fitting) == 1:
        why = f"the median step is {step:g}, a rate of {rates[fitting[0]]:g} Hz"
        return Guess("time_unit", fitting[0], "measured", f"{why}, and it is a time of week" if of_week else why)
    others = f"{' or '.join(fitting)} is possible" if fitting else "no unit gives a plausible rate"
    return Guess("time_unit", fitting[0] if fitting else "s", "unsure", f"the median step is {step:g}: {others}")


def guess_accel_unit(accel: FloatArray, names: Sequence[Name]) -> Guess:
    """Guess the unit of specific forces (n, 3) from their median norm, which should be equal to gravity."""
    lowest, size = low_and_median_norm(accel)
    median = f"the median of |f| is {size:.3g}"
    if lowest < MIN_LOW_NORM * size:
        median = f"{median}, and 5 % of averages over short times are below {lowest:.2g}"
    for unit, gravity in (("m/s2", GRAVITY_MPS2), ("g", 1.0)):
        if abs(size / gravity - 1.0) < TOLERANCE and lowest >= MIN_LOW_NORM * size:
            return Guess("accel_unit", unit, "measured", f"{median}; gravity is {gravity:g} {unit}")
    why = f"{median}, which is not gravity in any known unit; was gravity removed?"
    return Guess("accel_unit", common_unit(names, ACCEL_UNITS) or "m/s2", "unsure", why)


def guess_upright(accel: FloatArray) -> Guess:
    """Guess body axes whose z axis is up, from the axis and the sign of gravity. The forward axis is arbitrary."""
    felt, share = gravity_share(accel)
    why = f"gravity is on {felt} (cosine of the angle: {share:.2f})"
    return Guess("imu_axes", UPRIGHT[felt], "measured" if share > UPRIGHT_SHARE else "unsure", why)


def guess_angle_unit(latitude: FloatArray, longitude: FloatArray, names: Sequence[Name]) -> Guess:
    """Guess the unit of latitudes and longitudes. Near (0, 0), the values do not identify the unit."""
    angles = np.abs(np.column_stack([latitude, longitude]))
    largest = np.nanmax(angles, axis=0)
    text = f"the largest values are {largest[0]:.6g} and {largest[1]:.6g}"
    if (largest > np.array([MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG])).any():
        minutes = angles % 100.0
        if (largest <= np.array([MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG]) * 100.0).all() and np.nanmax(minutes) < 60.0:
            return Guess("angle_unit", "ddmm", "measured", f"{text}: degrees and minutes, ddmm.mmmm")
        if (largest <= np.array([MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG]) * 1e7).all() and largest.max() > 1e6:
            return Guess("angle_unit", "1e-7 deg", "measured", f"{text}: degrees times ten million")
        return Guess("angle_unit", "deg", "unsure", f"{text}, which are not angles in any known unit")
    if largest[0] > LATITUDE_RAD or largest[1] > LONGITUDE_RAD:
        return Guess("angle_unit", "deg", "measured", f"{text}: too large for rad")
    if named := common_unit(names, ANGLE_UNITS):
        return Guess("angle_unit", named, "named", f"stated by the column; {text}")
    return Guess("angle_unit", "rad", "unsure", f"{text}: rad, or degrees in the Gulf of Guinea")


def guess_height_unit(height: FloatArray, named: str, angle_unit: str) -> Guess | None:
    """Guess the unit of heights, or return None if the heights are plausible in metres."""
    if named in HEIGHT_UNITS:
        return Guess("height_unit", named, "named", "stated by the column") if named != "m" else None
    largest = float(np.nanmax(np.abs(height)))
    if largest > MIN_MM:
        return Guess("height_unit", "mm", "measured", f"the largest value is {largest:.0f}, too large for m")
    if angle_unit == "1e-7 deg":
        return Guess("height_unit", "mm", "unsure", "receivers that write 1e-7 deg write heights in mm")
    return None


def guess_gyro_unit(recording: Recording, names: Sequence[Name]) -> Guess:
    """Guess the unit of a gyro that was read in rad/s, by comparison with the rotation of track and gravity."""
    for turning in sure_turnings(recording):
        for unit, factor in (("rad/s", 1.0), ("deg/s", 1 / DEG_PER_RAD)):
            if turning.is_about(factor):
                return Guess("gyro_unit", unit, "measured", _turning_text(turning))
    if named := common_unit(names, GYRO_UNITS):
        return Guess("gyro_unit", named, "named", "stated by the columns; too few turns to measure it")
    return Guess("gyro_unit", "rad/s", "unsure", "too few turns to measure it, and the columns do not state it")


def turns_with_gyro(recording: Recording) -> tuple[bool | None, str]:
    """Return True if track and gyro turn in the same direction, and a text about their comparison.

    If the correlation of track and gyro is not significant, the first returned value is None.
    """
    turning = turning_track(recording)
    if turning is None or abs(turning.strength) < MIN_STRENGTH:
        return None, "too few turns to compare the track with the gyro"
    return turning.factor > 0, _turning_text(turning)


def guess_forward(recording: Recording, body: tuple[str, ...], upright: Guess) -> Guess:
    """Guess the sensor axes that point forwards and to the left of the body, from the acceleration of the track.

    Args:
        recording: recording that was read with ``imu_axes`` = ``body``.
        body: sensor axes that were assumed as the x, y and z axis of the body, with an upward z axis.
        upright: guess from which ``body`` was computed.
    """
    fit = plane_fit(recording)
    if upright.grade != "measured":
        return upright
    if fit is None or not fit.sure or fit.mirrors:
        return Guess("imu_axes", body, "unsure", f"{upright.why}; the track does not identify the forward axis")
    horizontal = tuple(axis.replace("--", "") for axis in axes_text(fit.way, (body[0], body[1])))
    why = f"{upright.why}; the track's acceleration fits the axes {'as given' if fit.way == IDENTITY else fit.way}"
    return Guess("imu_axes", (*horizontal, body[2]), "measured", f"{why} (correlation {fit.correlation:.2f})")


def guess_velocity_frame(recording: Recording, named: str) -> list[Guess]:
    """Guess the frame and the unit of velocities that were read as ENU [m/s], by comparison with the fixes."""
    position, velocity = recording.position, recording.velocity
    way = means = np.empty((0, 3))
    if position is not None and velocity is not None:
        way, means = mean_velocities(position, velocity.t_s, velocity.mps, _WINDOW_S)
    frames = {"enu": means, "ned": means[:, [1, 0, 2]] * [1.0, 1.0, -1.0]}
    cosines = {frame: cosine(way, values) for frame, values in frames.items()}
    other, best = sorted(cosines, key=lambda frame: cosines[frame])
    if cosines[best] < MIN_COSINE or cosines[best] - cosines[other] < COSINE_GAIN:
        grade, why = ("named", "stated by the columns") if named else ("unsure", "not stated by the columns")
        return [Guess("velocity_frame", named or "enu", grade, f"{why}; the fixes do not identify it")]  # type: ignore[arg-type]
    listed = ", ".join(f"{frame} {value:.3f}" for frame, value in cosines.items())
    why = f"cosine with the velocity of the fixes: {listed}"
    factor = slope(way, frames[best])
    unit = next((unit for unit, scale in SPEED_UNITS.items() if abs(factor / scale - 1.0) < _SCALE_WITHIN), "")
    moves = f"the fixes move {factor:.3g} times as fast as the numbers in the columns"
    of_unit = {
        "m/s": [],
        "": [Guess("velocity_unit", "m/s", "unsure", f"{moves}, which is not a known unit")],
    }.get(unit, [Guess("velocity_unit", unit, "measured", moves)])
    return [Guess("velocity_frame", best, "measured", why), *of_unit]


def _turning_text(turning: Turning) -> str:
    turns = f"{turning.basis} turns {turning.factor:.3g} times as fast as the gyro's numbers"
    return f"{turns} (correlation {turning.correlation:.2f})"
