"""The attitude plugin ``gyro_only``: no accelerometer after the alignment."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.attitude.common import TiltAndYaw, Verticals, tilt_start
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("attitude", "gyro_only")
@dataclass(frozen=True)
class GyroOnly(TiltAndYaw):
    """Tilt from the gyro alone after the alignment; yaw from headings, course or track, as in `tilt`.

    With x = Omega^T e3, the vertical of ENU seen from the body::

        x_k = exp(-dt skew(y_G)) x_{k-1};  roll = atan2(x2, x3);  pitch = atan2(-x1, hypot(x2, x3))

    Yaw and the input of the navigation filter are those of `tilt`.

    No external acceleration disturbs it, and nothing ever corrects it: a gyro bias b tilts it by b t, and gravity
    leaks by g b t. It shows what the accelerometer is worth to the tilt filter.
    """

    name: ClassVar[str] = "gyro_only"

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample."""
        imu = recording.inertial
        x, after = tilt_start(recording, alignment=self.alignment).x, np.empty_like(imu.gyro_radps)
        for k, turn in enumerate(Rotation.from_rotvec(-imu.intervals_s[:, None] * imu.gyro_radps).as_matrix()):
            after[k] = x = turn.dot(x)
        return after, None
