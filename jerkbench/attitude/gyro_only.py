"""The attitude plugin ``gyro_only``: no accelerometer after the alignment."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import FloatArray, require_not_negative, require_positive
from jerkbench.attitude.common import COMPENSATIONS, attitude_from, filtered_yaw, intervals
from jerkbench.attitude.tilt_filter import align, roll_pitch
from jerkbench.attitude.yaw import YAW_SOURCES, require_headings, select_headings, yaw_remarks
from jerkbench.errors import PluginError, unknown
from jerkbench.estimate import Attitude
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("attitude", "gyro_only")
@dataclass(frozen=True)
class GyroOnly:
    """Tilt from the gyro alone after the alignment; yaw from headings, course or track, as in `tilt`.

    With x = Omega^T e3, the vertical of ENU seen from the body::

        x_k = exp(-dt skew(y_G)) x_{k-1};  roll = atan2(x2, x3);  pitch = atan2(-x1, hypot(x2, x3))

    Start: at rest for 1 s, x_0 is the normalised mean of y_A over it; moving, x_0 is level. Yaw and the input of the
    navigation filter are those of `tilt`.

    No external acceleration disturbs it, and nothing ever corrects it: a gyro bias b tilts it by b t, and gravity
    leaks by g b t. It shows what the accelerometer is worth to the tilt filter.

    Attributes:
        compensation: midpoint or endpoint.
        yaw_source: dual_antenna, odometry, course, track, gyro_only or auto, as in `tilt`.
        yaw_walk_rad_per_sqrt_s: random walk of yaw.
        course_min_speed_mps: horizontal speed above which the course counts.
        course_sigma_min_rad: least standard deviation of a course.
    """

    compensation: str = "midpoint"
    yaw_source: str = "auto"
    yaw_walk_rad_per_sqrt_s: float = 2e-4
    course_min_speed_mps: float = 0.5
    course_sigma_min_rad: float = 0.0087

    def __post_init__(self) -> None:
        """Check that every choice exists and every number makes sense."""
        for name, available in (("compensation", COMPENSATIONS), ("yaw_source", YAW_SOURCES)):
            if getattr(self, name) not in available:
                raise PluginError(unknown(f"{name} of attitude gyro_only", getattr(self, name), available))
        require_positive("attitude gyro_only", self, ("course_min_speed_mps", "course_sigma_min_rad"))
        require_not_negative("attitude gyro_only", self, ("yaw_walk_rad_per_sqrt_s",))

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the recording of ``load`` has the yaw source that was asked for.

        Raises:
            RecordingError: the recording has no such yaw source.
        """
        require_headings(load, self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return what a reader of the table has to know: that nothing measures yaw."""
        return yaw_remarks(recording, self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)

    def estimate(self, recording: Recording) -> Attitude:
        """Return attitude and ENU acceleration at the IMU's stamps.

        Raises:
            RecordingError: the recording lacks the yaw source that was asked for.
        """
        headings = select_headings(recording, self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)
        imu = recording.inertial
        x = propagate(align(recording, None).x, intervals(imu)[:, None] * imu.gyro_radps)
        roll, pitch = roll_pitch(x)
        yaw = filtered_yaw(imu, roll, pitch, headings, self.yaw_walk_rad_per_sqrt_s, self.course_sigma_min_rad)
        euler = np.column_stack([roll, pitch, yaw.rad])
        return attitude_from(imu, euler, self.compensation, yaw_sigma_rad=yaw.sigma_rad)


def propagate(x: FloatArray, turns_rad: FloatArray) -> FloatArray:
    """Return x (n, 3) after each of the turns (n, 3) of the body."""
    after = np.empty_like(turns_rad)
    for k, turned_back in enumerate(Rotation.from_rotvec(-turns_rad).as_matrix()):
        x = turned_back.dot(x)
        after[k] = x
    return after
