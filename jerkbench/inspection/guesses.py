"""Guesses of units and frames: by the values of columns, by the gyro against the track, by fixes against velocity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.doctor import (
    COSINE_GAIN,
    IDENTITY,
    MIN_COSINE,
    TOLERANCE,
    axes_text,
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
from jerkbench.io.column_names import Name, common_unit
from jerkbench.io.columns import TIME_UNITS
from jerkbench.io.frames import (
    ACCEL_UNITS,
    ANGLE_UNITS,
    GYRO_UNITS,
    HEIGHT_UNITS,
    SPEED_UNITS,
    UPRIGHT,
    UPRIGHT_SHARE,
    gravity_share,
)
from jerkbench.io.sanitiser import MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG
from jerkbench.recording import GRAVITY_MPS2, Recording

Value = str | float | tuple[str, ...]

STAMPS = {"s": 1e8, "ms": 1e11, "us": 1e14, "ns": 1e17}
"""Stamps since 1970 or 1980 are larger than these, in each unit, and smaller than 100 times that."""

RATES_HZ = (0.5, 2500.0)
"""A log's rows come so often."""

FASTEST_FIXES_HZ = 50.0
"""No receiver has a higher rate."""

SLOWEST_HZ = 0.01
"""Stamps whose size fits a date but that make a lower rate are in another unit."""

WEEK_S = 604_800
LATITUDE_RAD, LONGITUDE_RAD = np.pi / 2, np.pi
MIN_MM = 20_000.0
"""A height beyond this is in millimetres."""

_WINDOW_S = 1.0

_SCALE_WITHIN = 0.2
MIN_EDGES = 10


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


def guess_time_unit(stamps: FloatArray, named: str, *, fixes: bool = False, of_week: bool = False) -> Guess:
    """Return the unit of a column of times, by its name, by the size of its stamps, or by its rate.

    Args:
        stamps: the times.
        named: the unit that the name says, or nothing.
        fixes: whether they are those of fixes alone, which no receiver gives as often as an IMU gives samples.
        of_week: whether the name says that they are times of the GPS week, from 0 to 604 800 s.
    """
    step = float(np.median(np.diff(stamps)))
    if named:
        return Guess("time_unit", named, "named", f"the column says so; the median step is {step:g} {named}")
    rates = {unit: 1e9 / TIME_UNITS[unit] / step if step > 0 else 0.0 for unit in STAMPS}
    for unit in () if of_week else STAMPS:
        if is_date(stamps, unit) and rates[unit] >= SLOWEST_HZ:
            return Guess("time_unit", unit, "measured", f"{stamps[0]:.0f} is a date of our time in {unit}")
    fastest_hz = FASTEST_FIXES_HZ if fixes else RATES_HZ[1]
    fitting = [unit for unit, rate_hz in rates.items() if RATES_HZ[0] <= rate_hz <= fastest_hz]
    if of_week:
        fitting = [unit for unit in fitting if stamps.max() <= WEEK_S * 1e9 / TIME_UNITS[unit]]
    if len(fitting) == 1:
        why = f"the median step is {step:g}, which makes {rates[fitting[0]]:g} Hz"
        return Guess("time_unit", fitting[0], "measured", f"{why}, and it is a time of week" if of_week else why)
    others = f"{' or '.join(fitting)} would fit" if fitting else "no unit makes a usual rate"
    return Guess("time_unit", fitting[0] if fitting else "s", "unsure", f"the median step is {step:g}: {others}")


def guess_accel_unit(accel: FloatArray, names: Sequence[Name]) -> Guess:
    """Return the unit of specific forces (n, 3), by the size of gravity."""
    size = float(np.median(np.linalg.norm(accel, axis=1)))
    median = f"the median of |f| is {size:.3g}"
    for unit, gravity in (("m/s2", GRAVITY_MPS2), ("g", 1.0)):
        if abs(size / gravity - 1.0) < TOLERANCE:
            return Guess("accel_unit", unit, "measured", f"{median}, gravity is {gravity:g} {unit}")
    why = f"{median}, which is gravity in no unit; is it without gravity?"
    return Guess("accel_unit", common_unit(names, ACCEL_UNITS) or "m/s2", "unsure", why)


def guess_upright(accel: FloatArray) -> Guess:
    """Return a body whose z axis is up, by the axis and the sign of gravity; forward is not known yet."""
    felt, share = gravity_share(accel)
    why = f"gravity is felt on {felt} (the cosine of the angle is {share:.2f})"
    return Guess("imu_axes", UPRIGHT[felt], "measured" if share > UPRIGHT_SHARE else "unsure", why)


def guess_angle_unit(latitude: FloatArray, longitude: FloatArray, names: Sequence[Name]) -> Guess:
    """Return the unit of latitudes and longitudes; near 0, 0 the values do not tell."""
    angles = np.abs(np.column_stack([latitude, longitude]))
    largest = np.nanmax(angles, axis=0)
    text = f"the largest are {largest[0]:.6g} and {largest[1]:.6g}"
    if (largest > np.array([MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG])).any():
        minutes = angles % 100.0
        if (largest <= np.array([MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG]) * 100.0).all() and np.nanmax(minutes) < 60.0:
            return Guess("angle_unit", "ddmm", "measured", f"{text}: degrees and minutes, ddmm.mmmm")
        if (largest <= np.array([MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG]) * 1e7).all() and largest.max() > 1e6:
            return Guess("angle_unit", "1e-7 deg", "measured", f"{text}: degrees times ten million")
        return Guess("angle_unit", "deg", "unsure", f"{text}, which are angles in no unit that is known")
    if largest[0] > LATITUDE_RAD or largest[1] > LONGITUDE_RAD:
        return Guess("angle_unit", "deg", "measured", f"{text}: more than any angle in rad")
    if named := common_unit(names, ANGLE_UNITS):
        return Guess("angle_unit", named, "named", f"the column says so; {text}")
    return Guess("angle_unit", "rad", "unsure", f"{text}: rad, or degrees in the Gulf of Guinea")


def guess_height_unit(height: FloatArray, named: str, angle_unit: str) -> Guess | None:
    """Return the unit of heights; None if nothing speaks against metres."""
    if named in HEIGHT_UNITS:
        return Guess("height_unit", named, "named", "the column says so") if named != "m" else None
    largest = float(np.nanmax(np.abs(height)))
    if largest > MIN_MM:
        return Guess("height_unit", "mm", "measured", f"the largest is {largest:.0f}, higher than any vehicle in m")
    if angle_unit == "1e-7 deg":
        return Guess("height_unit", "mm", "unsure", "receivers that write 1e-7 deg write heights in mm")
    return None


def guess_gyro_unit(recording: Recording, names: Sequence[Name]) -> Guess:
    """Return the unit of a gyro that was read as if it were in rad/s, by the track and by gravity."""
    for turning in sure_turnings(recording):
        for unit, factor in (("rad/s", 1.0), ("deg/s", 1 / DEG_PER_RAD)):
            if turning.is_about(factor):
                return Guess("gyro_unit", unit, "measured", _turning_text(turning))
    if named := common_unit(names, GYRO_UNITS):
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


def guess_velocity_frame(recording: Recording, named: str) -> list[Guess]:
    """Return the frame and the unit of velocities that were read as ENU [m/s], by the fixes' way each second."""
    way, means = _ways(recording)
    frames = {"enu": means, "ned": means[:, [1, 0, 2]] * [1.0, 1.0, -1.0]}
    size = float(np.sqrt(np.sum(way**2) * np.sum(means**2))) or 1.0
    cosines = {frame: float(np.sum(way * values)) / size for frame, values in frames.items()}
    other, best = sorted(cosines, key=lambda frame: cosines[frame])
    if cosines[best] < MIN_COSINE or cosines[best] - cosines[other] < COSINE_GAIN:
        grade, why = ("named", "the columns say so") if named else ("unsure", "the columns do not say it")
        return [Guess("velocity_frame", named or "enu", grade, f"{why}; the fixes do not show it")]  # type: ignore[arg-type]
    why = f"cosine with the fixes' way: {', '.join(f'{frame} {cosine:.3f}' for frame, cosine in cosines.items())}"
    factor = slope(way, frames[best])
    unit = next((unit for unit, scale in SPEED_UNITS.items() if abs(factor / scale - 1.0) < _SCALE_WITHIN), "")
    moves = f"the fixes move {factor:.3g} times as fast as its numbers"
    of_unit = {
        "m/s": [],
        "": [Guess("velocity_unit", "m/s", "unsure", f"{moves}, which is no unit that is known")],
    }.get(unit, [Guess("velocity_unit", unit, "measured", moves)])
    return [Guess("velocity_frame", best, "measured", why), *of_unit]


def _ways(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """The fixes' velocity (n, 3) from second to second, and the mean of those measured; none where they are few."""
    position, velocity = recording.position, recording.velocity
    if position is not None and velocity is not None:
        fix_s, places = without_nan_rows(position.t_s, position.enu_m)
        t_s, mps = without_nan_rows(velocity.t_s, velocity.mps)
        edges_s = common_edges(_WINDOW_S, fix_s, t_s)
        if len(edges_s) >= MIN_EDGES:
            return mean_velocity(fix_s, places, edges_s), window_means(t_s, mps, edges_s)
    return np.empty((0, 3)), np.empty((0, 3))


def _turning_text(turning: Turning) -> str:
    turns = f"{turning.basis} turns {turning.factor:.3g} times as fast as the gyro's numbers"
    return f"{turns} (correlation {turning.correlation:.2f})"
