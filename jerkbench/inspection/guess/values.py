"""Units by the values of columns."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.guess.guess import Guess
from jerkbench.io.frames import felt_axis
from jerkbench.recording import GRAVITY_MPS2

WITHIN = 0.25
"""So far from gravity may the median of |f| be."""

STAMPS = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
"""Stamps since 1970 or 1980 are larger than these, in each unit, and smaller than 100 times that."""

RATES_HZ = (0.5, 2500.0)
"""A log's rows come so often."""

UPRIGHT = {
    "+z": ("x", "y", "z"),
    "-z": ("x", "-y", "-z"),
    "+x": ("y", "z", "x"),
    "-x": ("z", "y", "-x"),
    "+y": ("z", "x", "y"),
    "-y": ("x", "z", "-y"),
}
"""A right-handed body for each axis that gravity is felt on; which way is forward has to be measured."""

LATITUDE_RAD, LONGITUDE_RAD = np.pi / 2, np.pi


def is_date(stamps: FloatArray, unit: str) -> bool:
    """Return whether stamps in ``unit`` count from 1970 or 1980."""
    return unit in STAMPS and bool(STAMPS[unit] <= stamps[0] < 100 * STAMPS[unit])


def time_unit(stamps: FloatArray, named: str) -> Guess:
    """Return the unit of a column of times, by its name, by the size of its stamps, or by its rate."""
    step = float(np.median(np.diff(stamps)))
    if named:
        return Guess("time_unit", named, "named", f"the column says so; the median step is {step:g} {named}")
    for unit in STAMPS:
        if is_date(stamps, unit):
            return Guess("time_unit", unit, "measured", f"{stamps[0]:.0f} is a date of our time in {unit}")
    scales = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
    fitting = [unit for unit, scale in scales.items() if RATES_HZ[0] <= scale / step <= RATES_HZ[1]]
    if len(fitting) == 1:
        rate_hz = scales[fitting[0]] / step
        return Guess("time_unit", fitting[0], "measured", f"the median step is {step:g}, which makes {rate_hz:g} Hz")
    others = f"{' or '.join(fitting)} would fit" if fitting else "no unit makes a usual rate"
    return Guess("time_unit", fitting[0] if fitting else "s", "unsure", f"the median step is {step:g}: {others}")


def accel_unit(accel: FloatArray, named: str) -> Guess:
    """Return the unit of specific forces (n, 3), by the size of gravity."""
    size = float(np.median(np.linalg.norm(accel, axis=1)))
    for unit, gravity in (("m/s2", GRAVITY_MPS2), ("g", 1.0)):
        if abs(size / gravity - 1.0) < WITHIN:
            return Guess(
                "accel_unit", unit, "measured", f"the median of |f| is {size:.3g}, gravity is {gravity:g} {unit}"
            )
    why = f"the median of |f| is {size:.3g}, which is gravity in no unit; is it without gravity?"
    return Guess("accel_unit", named or "m/s2", "unsure", why)


def upright(accel: FloatArray) -> Guess:
    """Return a body whose z axis is up, by the axis and the sign of gravity; forward is not known yet."""
    felt, force = felt_axis(accel), np.abs(np.median(accel, axis=0))
    share = float(force.max() / np.linalg.norm(force)) if force.any() else 0.0
    why = f"gravity is felt on {felt} (the cosine of the angle is {share:.2f})"
    return Guess("imu_axes", UPRIGHT[felt], "measured" if share > 0.9 else "unsure", why)


def angle_unit(latitude: FloatArray, longitude: FloatArray, named: str) -> Guess:
    """Return the unit of latitudes and longitudes; near 0, 0 the values do not tell."""
    largest = float(np.nanmax(np.abs(latitude))), float(np.nanmax(np.abs(longitude)))
    text = f"the largest are {largest[0]:.6g} and {largest[1]:.6g}"
    if largest[0] > LATITUDE_RAD or largest[1] > LONGITUDE_RAD:
        return Guess("angle_unit", "deg", "measured", f"{text}: more than any angle in rad")
    if named:
        return Guess("angle_unit", named, "named", f"the column says so; {text}")
    return Guess("angle_unit", "rad", "unsure", f"{text}: rad, or degrees in the Gulf of Guinea")
