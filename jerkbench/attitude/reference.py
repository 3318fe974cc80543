"""The attitude plugins ``reference`` and ``gyro_only``, which never correct the tilt with the accelerometer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import FloatArray, nearest_rows, require_positive
from jerkbench.attitude.common import COMPENSATIONS, TiltAndYaw, Verticals, attitude_from, tilt_start
from jerkbench.errors import RecordingError, require_known
from jerkbench.estimate import Attitude
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("attitude", "reference")
@dataclass(frozen=True)
class ReferenceAttitude:
    """Roll, pitch and yaw of the reference, to separate errors of the attitude from errors of the navigation.

    The attitude at each IMU sample is the attitude of the nearest reference row that has all three angles. The attitude
    is not interpolated. By default, the simulated data sets have a reference row for every IMU sample. The acceleration
    in ENU is computed in the same way as in the plugin `tilt`.

    This plugin gives a bound on the accuracy and is not an estimation method. The difference between the results with
    `reference` and with `tilt` shows the possible benefit of a better attitude. If the reference has a lower rate than
    the IMU, the time error of the attitude is up to half an interval of the reference.

    Attributes:
        compensation: attitude that rotates the specific force: at the midpoint or at the endpoint of each sample.
        gap_s: maximum time between an IMU sample and the nearest attitude of the reference [s].
    """

    compensation: str = "midpoint"
    gap_s: float = 0.1

    def __post_init__(self) -> None:
        require_known("compensation of attitude reference", self.compensation, COMPENSATIONS)
        require_positive("attitude reference", self, ("gap_s",))

    def require(self, load: Callable[[], Recording]) -> None:
        """Check before a sweep that every IMU sample has a reference attitude within ``gap_s``.

        Raises:
            RecordingError: the reference has no attitude, or its attitude has a gap that is too long.
        """
        self._angles(load())

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the acceleration in ENU at the times of the IMU samples.

        Raises:
            RecordingError: the reference has no attitude, or no attitude within ``gap_s`` of an IMU sample.
        """
        return attitude_from(recording.inertial, self._angles(recording), self.compensation)

    def _angles(self, recording: Recording) -> FloatArray:
        """Return the roll, pitch and yaw (n, 3) of the reference that are nearest in time to the IMU samples."""
        reference = recording.reference
        euler_rad = np.empty((0, 3)) if reference.euler_rad is None else reference.euler_rad
        known = np.isfinite(euler_rad).all(axis=1)
        if not known.any():
            raise RecordingError(
                f"The reference of {recording.name} has no attitude; use attitude=tilt or attitude=gyro_only."
            )
        t_s, euler_rad = reference.t_s[known], euler_rad[known]
        rows = nearest_rows(t_s, recording.inertial.t_s)
        distance_s = np.abs(t_s[rows] - recording.inertial.t_s)
        if distance_s.max() > self.gap_s:
            worst = int(np.argmax(distance_s))
            raise RecordingError(
                f"{recording.name}: the reference has no attitude within gap_s = {self.gap_s} s of the IMU sample at"
                f" {recording.inertial.t_s[worst]:.2f} s. The nearest attitude is {distance_s[worst]:.2f} s away."
                " Increase gap_s, or use attitude=tilt."
            )
        return euler_rad[rows]


@register("attitude", "gyro_only")
@dataclass(frozen=True)
class GyroOnly(TiltAndYaw):
    """Tilt from the gyro only after the alignment, and yaw from headings, course or track.

    The angular rate y_G of each sample rotates x = Omega^T e3, the direction of the vertical in the body frame::

        x_k = exp(-dt skew(y_G)) x_{k-1};  roll = atan2(x2, x3);  pitch = atan2(-x1, hypot(x2, x3))

    The yaw and the acceleration in ENU are computed in the same way as in the plugin `tilt`.

    External accelerations do not affect the tilt, but no measurement corrects the tilt. After the time t, a gyro bias b
    has caused a tilt error b t and an acceleration error g b t. The difference between the results with `gyro_only` and
    with `tilt` shows the benefit of the accelerometer.
    """

    name: ClassVar[str] = "gyro_only"

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x (n, 3) after each sample. The mask of detected accelerations is None."""
        imu = recording.inertial
        x, after = tilt_start(recording, alignment=self.alignment).x, np.empty_like(imu.gyro_radps)
        for k, turn in enumerate(Rotation.from_rotvec(-imu.intervals_s[:, None] * imu.gyro_radps).as_matrix()):
            after[k] = x = turn.dot(x)
        return after, None
