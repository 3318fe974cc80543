"""Guesses of units and frames, from the values of columns and from comparisons of gyro, track and velocity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from jerkbench.arrays import FloatArray
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
from jerkbench.io.column_names import Name, common_unit
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
