"""Attitude errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import (
    angle_between,
    euler_error_rad,
    inclination_error_rad,
    known,
    largest_norm,
    rms_norm,
)
from jerkbench.geometry import vertical_in_body
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import Recording

_MAX_ANGLE_RAD = np.radians(75.0)
"""Up to this pitch of the reference, roll and yaw are angles of their own."""


@register("metric", "attitude_rmse")
@dataclass(frozen=True)
class AttitudeRmse:
    """Root mean square error of roll, pitch and yaw.

    With e_i the difference of the angles wrapped to (-pi, pi] [rad], over the N counted rows whose reference knows
    that angle::

        roll_rmse_rad = sqrt(1/N sum e_roll,i^2)        pitch_rmse_rad, yaw_rmse_rad likewise

    Rows whose reference is pitched by more than 75 degrees do not count for roll and yaw, which are one angle at 90
    degrees; `inclination` has no such hole.

    NaN without a single such row.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "roll_rmse_rad": Column(section=13),
        "pitch_rmse_rad": Column(section=14),
        "yaw_rmse_rad": Column(section=15),
    }

    reads: ClassVar[str] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        error = euler_error_rad(estimate, recording)
        truth = recording.reference.euler_rad
        steep = np.zeros(len(error), dtype=bool) if truth is None else np.abs(truth[estimate.index, 1]) > _MAX_ANGLE_RAD
        values = {}
        for axis, name in enumerate(("roll", "pitch", "yaw")):
            rows = counted & known(truth, estimate, (axis,)) & (~steep | (name == "pitch"))
            values[f"{name}_rmse_rad"] = rms_norm(error[rows][:, [axis]])
        return values


# The error of the tilt as one angle, and the accuracy of the reference's own level.

_WINDOW_S = 1.0
"""Over how long the accelerometer is averaged for the floor."""

STILL_RANGE_RADPS = 0.05
STILL_MIDDLE_RADPS = 0.02
_STILL_BELOW_MPS = 0.1
"""A window is still where the gyro's range on each axis and the middle of it are not above the first
two, and the speed, where there is any, not above the third."""


@register("metric", "inclination")
@dataclass(frozen=True)
class Inclination:
    """Root mean square error of the inclination: the angle between the estimated and the true vertical.

    With x = Omega' e3 = (-sin(pitch), cos(pitch) sin(roll), cos(pitch) cos(roll)), the vertical seen from the body,
    and a_i = atan2(|x_i x x_ref,i|, x_i' x_ref,i), over the N counted rows whose roll and pitch are known::

        inclination_rmse_rad   = sqrt(1/N sum a_i^2)            inclination_rmse_deg: the same in degrees
        inclination_max_deg    = max a_i
        inclination_floor_deg  = median over windows of 1 s of the angle between the mean specific force and the mean
                                 x_ref

    The angle is defined at every attitude; roll and yaw say nothing where the pitch is 90 degrees. The floor takes the
    windows in which the body is still (gyro, each axis: range up to 0.05, its middle up to 0.02 rad/s; and, where the
    recording has velocities or places, a speed up to 0.1 m/s: straight driving is no rest) and the reference is known,
    scored or not. There the accelerometer shows the vertical, so what it says is an error of the
    reference, of its alignment with the IMU, or of the accelerometer: no error far below the floor means anything. NaN
    where there is nothing.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "inclination_rmse_rad": Column("RMSE of the inclination", section=11),
        "inclination_rmse_deg": Column("RMSE of the inclination", section=10),
        "inclination_max_deg": Column("Largest error of the inclination"),
        "inclination_floor_deg": Column(
            "Floor of the inclination: accelerometer against reference at rest", judged=False, section=12
        ),
    }

    reads: ClassVar[str] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the four values by column name."""
        rows = counted & known(recording.reference.euler_rad, estimate, (0, 1))
        angle = inclination_error_rad(estimate, recording)[rows, None]
        rmse_rad = rms_norm(angle)
        return {
            "inclination_rmse_rad": rmse_rad,
            "inclination_rmse_deg": float(np.degrees(rmse_rad)),
            "inclination_max_deg": float(np.degrees(largest_norm(angle))),
            "inclination_floor_deg": float(np.degrees(_floor_rad(recording))),
        }


def _floor_rad(recording: Recording) -> float:
    """Median angle between specific force and the reference's vertical over the windows that are still."""
    reference, imu = recording.reference, recording.imu
    if reference.euler_rad is None or imu is None:
        return float("nan")
    known = np.isfinite(reference.euler_rad[:, :2]).all(axis=1)
    truth = vertical_in_body(np.nan_to_num(reference.euler_rad[known]))
    sampled_windows = np.floor(imu.t_s / _WINDOW_S)  # a gap is one long window without a sample
    windows = np.union1d(sampled_windows, sampled_windows + 1)
    windows = windows[windows <= np.ceil(imu.t_s[-1] / _WINDOW_S)] * _WINDOW_S
    vertical, known_rows = _means(truth, np.searchsorted(windows, reference.t_s[known], side="right"), len(windows))
    starts = np.searchsorted(imu.t_s, windows[:-1])
    force, sampled = _means(imu.accel_mps2, np.searchsorted(windows, imu.t_s, side="right"), len(windows))
    starts = np.minimum(starts, len(imu.t_s) - 1)  # an empty window does not count anyway
    high, low = np.maximum.reduceat(imu.gyro_radps, starts), np.minimum.reduceat(imu.gyro_radps, starts)
    calm = ((high - low) <= STILL_RANGE_RADPS).all(axis=1)
    calm &= np.abs(high + low).max(axis=1) / 2 <= STILL_MIDDLE_RADPS
    still = np.zeros(len(known_rows), dtype=bool)
    still[1 : len(windows)] = calm & ~_moving(recording, windows)
    use = still & (known_rows > 0) & (sampled > 0)
    return float(np.median(angle_between(force[use], vertical[use]))) if use.any() else float("nan")


def _moving(recording: Recording, windows: FloatArray) -> BoolArray:
    """Whether it moves from each of ``windows`` to the next, or nobody knows; without velocity and places: nowhere."""
    track = _speed(recording)
    if track is None:
        return np.zeros(len(windows) - 1, dtype=bool)
    t_s, speed_mps = track
    window = np.searchsorted(windows, t_s, side="right")
    fastest = np.zeros(len(windows) + 1)
    np.maximum.at(fastest, window, speed_mps)
    unknown = np.bincount(window, minlength=len(windows) + 1) == 0
    return np.asarray((unknown | (fastest > _STILL_BELOW_MPS))[1 : len(windows)])


def _speed(recording: Recording) -> tuple[FloatArray, FloatArray] | None:
    """Times and speeds (k,): the reference's, the measured one, or that from place to place; None without any."""
    reference, velocity, position = recording.reference, recording.velocity, recording.position
    t_s, enu_m = (reference.t_s, reference.enu_m) if position is None else (position.t_s, position.enu_m)
    if reference.velocity_mps is not None:
        t_s, speed_mps = reference.t_s, np.linalg.norm(reference.velocity_mps, axis=1)
    elif velocity is not None:
        t_s, speed_mps = velocity.t_s, np.sqrt(np.nansum(velocity.mps**2, axis=1))
    elif enu_m is None or len(t_s) < 2:
        return None
    else:
        t_s, speed_mps = t_s[1:], np.linalg.norm(np.diff(enu_m, axis=0), axis=1) / np.diff(t_s)
    finite = np.isfinite(speed_mps)
    return t_s[finite], speed_mps[finite]


def _means(rows: FloatArray, window: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Mean of (n, 3) rows in each of the windows 0 ... count, and how many rows it has."""
    number = np.bincount(window, minlength=count + 1).astype(np.float64)
    total = np.column_stack([np.bincount(window, weights=rows[:, i], minlength=count + 1) for i in range(3)])
    return total / np.maximum(number, 1)[:, None], number
