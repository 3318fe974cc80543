"""The standstill at the start of a recording, and the calibration of the IMU over it."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import GRAVITY_MPS2, Imu

STILL_BELOW_MPS = 0.1
"""A receiver that stands still reports less: its velocity noise is some centimetres a second."""

MARGIN_S = 1.0
"""The time between the end of the rest and the first motion in the velocity, which is smoothed and old."""

SHORTEST_S = 1.0
"""A mean over less says nothing about a bias."""

SCALE_WITHIN = 0.1
"""An accelerometer that errs by more than this part of gravity is read in the wrong unit, or does not stand still."""


def first_rest_s(t_s: FloatArray, speed_mps: FloatArray, end_s: float) -> float:
    """Return when the rest that begins at time 0 ends; 0 where there is none.

    Args:
        t_s: (m,) stamps of the speed.
        speed_mps: (m,) over ground.
        end_s: when the recording ends, for one that never moves.
    """
    moving = t_s[speed_mps > STILL_BELOW_MPS]
    return float(np.clip(moving[0] - MARGIN_S, 0.0, end_s)) if moving.size else end_s


def calibrated(imu: Imu, rest_s: float, *, gyro: bool, accel: bool) -> Imu:
    """Return the samples without the gyro's bias, and with the accelerometer scaled, where that is asked for.

    Raises:
        RecordingError: the rest is too short, or the accelerometer's mean over it is not near gravity.
    """
    if gyro:
        imu = without_gyro_bias(imu, rest_s)
    return scaled_to_gravity(imu, rest_s) if accel else imu


def without_gyro_bias(imu: Imu, rest_s: float) -> Imu:
    """Subtract the gyro's mean over the rest (the Earth's rate goes with it)."""
    bias = imu.gyro_radps[_at_rest(imu, rest_s)].mean(axis=0)
    return Imu(imu.t_s, imu.accel_mps2, imu.gyro_radps - bias)


def scaled_to_gravity(imu: Imu, rest_s: float) -> Imu:
    """Scale the accelerometer, all axes alike, so that its mean over the rest has the magnitude of gravity."""
    magnitude = float(np.linalg.norm(imu.accel_mps2[_at_rest(imu, rest_s)].mean(axis=0)))
    if abs(magnitude - GRAVITY_MPS2) > SCALE_WITHIN * GRAVITY_MPS2:
        raise RecordingError(
            f"The accelerometer's mean over the first {rest_s:.1f} s is {magnitude:.3f} m/s2, not near {GRAVITY_MPS2};"
            " correct its unit or the length of the rest, or switch scale_accel_to_gravity off."
        )
    return Imu(imu.t_s, imu.accel_mps2 * (GRAVITY_MPS2 / magnitude), imu.gyro_radps)


def _at_rest(imu: Imu, rest_s: float) -> slice:
    if rest_s < SHORTEST_S:
        raise RecordingError(
            f"The recording stands still for {rest_s:.2f} s at its start; calibrating the IMU needs {SHORTEST_S:.0f} s:"
            " switch remove_gyro_bias and scale_accel_to_gravity off, or give rest_s."
        )
    return slice(0, int(np.searchsorted(imu.t_s, rest_s)))
