"""The attitude plugin ``gyro_only``: no accelerometer after the alignment."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import FloatArray
from jerkbench.attitude.alignment import align
from jerkbench.attitude.common import TiltAndYaw, Verticals, intervals
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
        start = align(recording, alignment=self.alignment)
        return propagate(start.x, intervals(imu)[:, None] * imu.gyro_radps), None


def propagate(x: FloatArray, turns_rad: FloatArray) -> FloatArray:
    """Return x (n, 3) after each of the turns (n, 3) of the body."""
    after = np.empty_like(turns_rad)
    for k, turned_back in enumerate(Rotation.from_rotvec(-turns_rad).as_matrix()):
        x = turned_back.dot(x)
        after[k] = x
    return after
