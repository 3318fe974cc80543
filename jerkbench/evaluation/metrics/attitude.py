"""Metrics of the attitude error."""

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
"""Maximum pitch of the reference at which the roll and yaw errors are computed."""


@register("metric", "attitude_rmse")
@dataclass(frozen=True)
class AttitudeRmse:
    """Root mean square error of roll, pitch and yaw.

    Let e_i be the error of an angle, wrapped to (-pi, pi] [rad], at the N counted rows at which the reference of this
    angle is known::

        roll_rmse_rad = sqrt(1/N sum e_roll,i^2)        pitch_rmse_rad, yaw_rmse_rad the same

    For roll and yaw, rows with an absolute reference pitch of more than 75 degrees are left out, because roll and yaw
    cannot be distinguished at a pitch of 90 degrees. The metric `inclination` has no limit of the pitch. A value is NaN
    if no row is counted.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "roll_rmse_rad": Column(section=13),
        "pitch_rmse_rad": Column(section=14),
        "yaw_rmse_rad": Column(section=15),
    }

    reads: ClassVar[str] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        error = euler_error_rad(estimate, recording)
        truth = recording.reference.euler_rad
        steep = np.zeros(len(error), dtype=bool) if truth is None else np.abs(truth[estimate.index, 1]) > _MAX_ANGLE_RAD
        values = {}
        for axis, name in enumerate(("roll", "pitch", "yaw")):
            rows = counted & known(truth, estimate, (axis,)) & (~steep | (name == "pitch"))
            values[f"{name}_rmse_rad"] = rms_norm(error[rows][:, [axis]])
        return values


# The error of roll and pitch as one angle, and the accuracy of its reference.

_WINDOW_S = 1.0
"""Length of the windows in which the specific force is averaged for the inclination floor."""

STILL_RANGE_RADPS = 0.05
STILL_MIDDLE_RADPS = 0.02
_STILL_BELOW_MPS = 0.1
"""Limits for a stationary window: the range of the angular rate on each axis, the midpoint of this range, the speed."""


@register("metric", "inclination")
@dataclass(frozen=True)
class Inclination:
    """Root mean square error of the inclination: the angle between the estimated and the true vertical.

    Let x = Omega' e3 = (-sin(pitch), cos(pitch) sin(roll), cos(pitch) cos(roll)) be the vertical in the body frame. Let
    a_i = atan2(|x_i x x_ref,i|, x_i' x_ref,i) be the error angle at the N counted rows whose reference roll and pitch
    are known::

        inclination_rmse_rad   = sqrt(1/N sum a_i^2)            inclination_rmse_deg: the same in degrees
        inclination_max_deg    = max a_i
        inclination_floor_deg  = median over windows of 1 s of the angle between the mean specific force and the mean
                                 x_ref

    The inclination error is defined at every attitude, whereas roll and yaw are undefined at a pitch of 90 degrees.

    The floor uses windows in which the body is stationary and the reference is known, even if the rows are not scored.
    A window is stationary if, on each axis, the range of the angular rate is at most 0.05 rad/s, and the midpoint of
    this range is at most 0.02 rad/s. If the recording has velocities or positions, the speed must also be at most 0.1
    m/s. A stationary accelerometer measures the vertical. The floor is therefore an error of the reference, of its
    alignment with the IMU, or of the accelerometer. Errors far below the floor are meaningless. The errors are NaN if
    no row is counted, and the floor is NaN if no window is stationary.
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
        """Return the four values of the metric by column name."""
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
    """Return the median angle [rad] between the specific force and the reference vertical over stationary windows."""
    reference, imu = recording.reference, recording.imu
    if reference.euler_rad is None or imu is None:
        return float("nan")
    known = np.isfinite(reference.euler_rad[:, :2]).all(axis=1)
    truth = vertical_in_body(np.nan_to_num(reference.euler_rad[known]))
    sampled_windows = np.floor(imu.t_s / _WINDOW_S)  # a gap becomes one long window
    windows = np.union1d(sampled_windows, sampled_windows + 1)
    windows = windows[windows <= np.ceil(imu.t_s[-1] / _WINDOW_S)] * _WINDOW_S
    vertical, known_rows = _means(truth, np.searchsorted(windows, reference.t_s[known], side="right"), len(windows))
    starts = np.searchsorted(imu.t_s, windows[:-1])
    force, sampled = _means(imu.accel_mps2, np.searchsorted(windows, imu.t_s, side="right"), len(windows))
    starts = np.minimum(starts, len(imu.t_s) - 1)  # an index past the end belongs to an empty window, which is ignored
    high, low = np.maximum.reduceat(imu.gyro_radps, starts), np.minimum.reduceat(imu.gyro_radps, starts)
    calm = ((high - low) <= STILL_RANGE_RADPS).all(axis=1)
    calm &= np.abs(high + low).max(axis=1) / 2 <= STILL_MIDDLE_RADPS
    still = np.zeros(len(known_rows), dtype=bool)
    still[1 : len(windows)] = calm & ~_moving(recording, windows)
    use = still & (known_rows > 0) & (sampled > 0)
    return float(np.median(angle_between(force[use], vertical[use]))) if use.any() else float("nan")


def _moving(recording: Recording, windows: FloatArray) -> BoolArray:
    """Return whether each window has motion or an unknown speed.

    No window has motion if the recording has neither velocities nor positions.
    """
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
    """Return times (k,) [s] and speeds (k,) [m/s] from the first source that exists, or None without a source.

    The sources are the reference velocity, the measured velocity, the fixes, and the reference position.
    """
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
    """Return the mean (count + 1, 3) of the (n, 3) rows in each window, and the number of rows in each window.

    ``window`` (n,) is the index of the window of each row, from 0 to ``count``.
    """
    number = np.bincount(window, minlength=count + 1).astype(np.float64)
    total = np.column_stack([np.bincount(window, weights=rows[:, i], minlength=count + 1) for i in range(3)])
    return total / np.maximum(number, 1)[:, None], number
