"""The unit of a gyro, by how fast the track turns and by how fast gravity turns in the body."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.relation import SURE, slope, strength
from jerkbench.inspection.diagnosis.windows import LENGTHS_S, track_windows, window_means
from jerkbench.inspection.peaks import correlation_of
from jerkbench.recording import Imu, Recording

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
    """

    basis: str
    correlation: float
    factor: float
    strength: float


def gyro_unit(recording: Recording) -> list[Diagnosis]:
    """Return whether the gyro is 57.3 times too large or too small."""
    if recording.imu is None:
        return []
    turnings = [turning for turning in (turning_track(recording), turning_gravity(recording.imu)) if turning]
    for turning in turnings:
        size = abs(turning.factor)
        if abs(turning.strength) < SURE or size == 0:
            continue
        measured = (
            f"{turning.basis} turns {size:.3g} times as fast as the gyro says (correlation {turning.correlation:.2f})"
        )
        if 1 / WITHIN < size * DEG_PER_RAD < WITHIN:
            sentence = "The gyro is in deg/s, not in rad/s"
            return [Diagnosis("gyro in deg/s", measured, sentence, "Set gyro_unit=deg/s, or multiply it by pi/180")]
        if 1 / WITHIN < size / DEG_PER_RAD < WITHIN:
            sentence = "The gyro is 57.3 times too small: it was in rad/s before it was multiplied by pi/180"
            return [
                Diagnosis("gyro 57.3 times too small", measured, sentence, "Set gyro_unit=rad/s, or multiply by 180/pi")
            ]
    return []


def turning_track(recording: Recording) -> Turning | None:
    """Return how the course of the track turns with the gyro's z axis, over the windows that say most."""
    turnings = []
    for length_s in LENGTHS_S:
        windows = track_windows(recording, length_s)
        if windows is None or not windows.turn_rad[:, 2].any():
            continue
        turnings.append(_turning("the track", windows.course_change_rad, windows.turn_rad[:, 2]))
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
        turnings.append(_turning("gravity", np.diff(up, axis=0) / length_s, expected))
    return max(turnings, key=lambda turning: abs(turning.strength), default=None)


def _turning(basis: str, turned: FloatArray, expected: FloatArray) -> Turning:
    correlation = correlation_of(turned, expected)
    return Turning(basis, correlation, slope(turned, expected), strength(correlation, len(turned)))
