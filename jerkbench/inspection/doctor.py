"""The doctor: mistakes that a person makes in a log, found by what its streams say of each other."""

from dataclasses import replace

import numpy as np

from jerkbench.inspection.clocks import all_lags, clock_offsets
from jerkbench.inspection.evidence import DEG_PER_RAD, Diagnosis, sure_turnings
from jerkbench.inspection.frames import attitude_mistakes, exchanged_axes, exchanged_degrees
from jerkbench.inspection.lags import Lag
from jerkbench.inspection.mounting import EITHER_MIRRORED, TRACK_MIRRORED, mounting
from jerkbench.inspection.sigmas import understated_noise
from jerkbench.recording import GRAVITY_MPS2, Recording

TOLERANCE = 0.25
"""So far from 1 may the median of |f|/g be after the mistake is mended: a rough ride, a scale that is off."""


def diagnoses(recording: Recording, lags: list[Lag] | None = None) -> list[Diagnosis]:
    """Return the mistakes that are sure; ``lags`` are `all_lags` of the recording, where they are known already."""
    return [*first_diagnoses(recording), *clock_offsets(all_lags(recording) if lags is None else lags)]


def first_diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return them without those of the clocks, whose search takes longer.

    A mistake is told once, by those that see it best. Where streams do not agree on east and north, a reference says
    nothing of their errors. Where the IMU's units or axes are wrong, it says nothing of an attitude.
    """
    units = [*accelerometer_unit(recording), *gyro_unit(recording)]
    axes, degrees, exchanged = mounting(recording), exchanged_degrees(recording), exchanged_axes(recording)
    of_fixes = [one for one in axes if one.name in (TRACK_MIRRORED, EITHER_MIRRORED)]
    of_imu = [one for one in axes if one not in of_fixes]
    agreed = not (of_fixes or degrees or exchanged)
    if degrees:
        of_fixes, exchanged = [], {}
    elif of_fixes and exchanged:
        measured = [of_fixes[0].measured, *(one.measured for one in exchanged.values())]
        of_fixes, exchanged = [replace(of_fixes[0], measured=", and ".join(measured))], {}
    attitude = [] if units or of_imu else list(attitude_mistakes(recording))
    noise = understated_noise(recording, reference=agreed)
    return [*units, *of_imu, *of_fixes, *degrees, *exchanged.values(), *attitude, *noise]


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
        measured = (
            f"{turning.basis} turns {abs(turning.factor):.3g} times as fast as the gyro says (correlation"
            f" {turning.correlation:.2f})"
        )
        if turning.is_about(1 / DEG_PER_RAD):
            sentence = "The gyro is in deg/s, not in rad/s"
            return [Diagnosis("gyro in deg/s", measured, sentence, "Set gyro_unit=deg/s, or multiply it by pi/180")]
        if turning.is_about(DEG_PER_RAD):
            sentence = "The gyro is 57.3 times too small: it was in rad/s before it was multiplied by pi/180"
            remedy = "Set gyro_unit=rad/s, or multiply by 180/pi"
            return [Diagnosis("gyro 57.3 times too small", measured, sentence, remedy)]
    return []
