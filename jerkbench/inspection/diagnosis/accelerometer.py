"""The unit of an accelerometer, by the size of gravity."""

import numpy as np

from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording

TOLERANCE = 0.25
"""So far from 1 may the median of |f|/g be after the mistake is mended: a rough ride, a scale that is off."""


def accelerometer_unit(recording: Recording) -> list[Diagnosis]:
    """Return whether the specific force is g times too small or too large; its median is gravity, moving or not."""
    if recording.imu is None:
        return []
    median_mps2 = _median_force_mps2(recording.imu)
    measured = f"the median of |f| is {median_mps2:.3g} m/s2, where gravity is {GRAVITY_MPS2:g}"
    if _near(median_mps2, 1.0):
        sentence = "The accelerometer is in g, not in m/s2"
        return [Diagnosis("accelerometer in g", measured, sentence, "Set accel_unit=g, or multiply it by 9.80665")]
    if _near(median_mps2, GRAVITY_MPS2**2):
        sentence = "The accelerometer is 9.8 times too large: it was in m/s2 before it was multiplied by g"
        return [
            Diagnosis(
                "accelerometer 9.8 times too large", measured, sentence, "Set accel_unit=m/s2, or divide it by 9.80665"
            )
        ]
    return []


def _median_force_mps2(imu: Imu) -> float:
    return float(np.median(np.linalg.norm(imu.accel_mps2, axis=1)))


def _near(value: float, expected: float) -> bool:
    return bool(abs(value / expected - 1.0) < TOLERANCE)
