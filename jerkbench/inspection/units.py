"""The units of an accelerometer, by the size of gravity, and of a gyro, by how fast the track and gravity turn."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    SURE,
    Diagnosis,
    correlation_of,
    over_lengths,
    slope,
    strength,
    track_windows,
    window_means,
)
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording

TOLERANCE = 0.25
"""So far from 1 may the median of |f|/g be after the mistake is mended: a rough ride, a scale that is off."""

DEG_PER_RAD = float(np.degrees(1.0))

WITHIN = 2.5
"""So many times larger or smaller than one degree a radian may the factor be: windows, vibration and noise bend it."""

GRAVITY_WINDOWS_S = (1.0, 2.0)
"""Over shorter ones a force turns with vibration."""

LEAST_FORCE_MPS2 = 1e-6
"""A sensor that says nothing has no direction."""


class Turning(NamedTuple):
    """A turning that was measured beside the gyro.

    Attributes:
        basis: what turns.
        correlation: with what the gyro says.
        factor: how many times as fast as that it turns.
        strength: of the correlation, in standard deviations from none.
        length_s: of the windows.
    """

    basis: str
    correlation: float
    factor: float
    strength: float
    length_s: float


def accelerometer_unit(recording: Recording) -> list[Diagnosis]:
    """Return whether the specific force is g times too small or too large; its median is gravity, moving or not."""
    if recording.imu is None:
        return []
    median_mps2 = float(np.median(np.linalg.norm(recording.imu.accel_mps2, axis=1)))
    measured = f"the median of |f| is {median_mps2:.3g} m/s2, where gravity is {GRAVITY_MPS2:g}"
    if abs(median_mps2 - 1.0) < TOLERANCE:
        sentence = "The accelerometer is in g, not in m/s2"
        return [Diagnosis("accelerometer in g", measured, sentence, "Set accel_unit=g, or multiply it by 9.80665")]
    if abs(median_mps2 / GRAVITY_MPS2**2 - 1.0) < TOLERANCE:
        sentence = "The accelerometer is 9.8 times too large: it was in m/s2 before it was multiplied by g"
        remedy = "Set accel_unit=m/s2, or divide it by 9.80665"
        return [Diagnosis("accelerometer 9.8 times too large", measured, sentence, remedy)]
    return []


def gyro_unit(recording: Recording) -> list[Diagnosis]:
    """Return whether the gyro is 57.3 times too large or too small."""
    for turning in sure_turnings(recording):
        size = abs(turning.factor)
        measured = (
            f"{turning.basis} turns {size:.3g} times as fast as the gyro says (correlation {turning.correlation:.2f})"
        )
        if 1 / WITHIN < size * DEG_PER_RAD < WITHIN:
            sentence = "The gyro is in deg/s, not in rad/s"
            return [Diagnosis("gyro in deg/s", measured, sentence, "Set gyro_unit=deg/s, or multiply it by pi/180")]
        if 1 / WITHIN < size / DEG_PER_RAD < WITHIN:
            sentence = "The gyro is 57.3 times too small: it was in rad/s before it was multiplied by pi/180"
            remedy = "Set gyro_unit=rad/s, or multiply by 180/pi"
            return [Diagnosis("gyro 57.3 times too small", measured, sentence, remedy)]
    return []


def sure_turnings(recording: Recording) -> list[Turning]:
    """Return what surely turns with the gyro, or against it: the track, gravity, or both."""
    if recording.imu is None:
        return []
    turnings = (turning_track(recording), turning_gravity(recording.imu))
    return [turning for turning in turnings if turning is not None and abs(turning.strength) >= SURE]


def turning_track(recording: Recording) -> Turning | None:
    """Return how the course of the track turns with the gyro's z axis, over the windows that say most."""
    turnings = [
        _turning("the track", windows.course_change_rad, windows.turn_rad[:, 2], length_s)
        for length_s, windows in over_lengths(track_windows, recording).items()
        if windows.turn_rad[:, 2].any()
    ]
    return max(turnings, key=lambda turning: abs(turning.strength), default=None)


def turning_gravity(imu: Imu) -> Turning | None:
    """Return how the direction of the specific force turns with the gyro.

    With u = f/|f|, both averaged over windows of 1 and 2 s::

        du/dt = -omega x u
    """
    turnings = []
    for length_s in GRAVITY_WINDOWS_S:
        edges_s = np.arange(imu.t_s[0], imu.t_s[-1], length_s)
        if len(edges_s) < 10 or not imu.gyro_radps.any():
            continue
        force, rate = (window_means(imu.t_s, values, edges_s) for values in (imu.accel_mps2, imu.gyro_radps))
        up = force / np.maximum(np.linalg.norm(force, axis=1), LEAST_FORCE_MPS2)[:, None]
        expected = -np.cross(0.5 * (rate[1:] + rate[:-1]), 0.5 * (up[1:] + up[:-1]))
        turnings.append(_turning("gravity", np.diff(up, axis=0) / length_s, expected, length_s))
    return max(turnings, key=lambda turning: abs(turning.strength), default=None)


def _turning(basis: str, turned: FloatArray, expected: FloatArray, length_s: float) -> Turning:
    correlation = correlation_of(turned, expected)
    return Turning(basis, correlation, slope(turned, expected), strength(correlation, len(turned)), length_s)
