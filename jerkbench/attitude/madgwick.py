"""The attitude plugin ``madgwick``: gradient descent towards the direction of gravity."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatMatrix, FloatVector
from jerkbench.attitude.common import TiltAndYaw, Verticals, quaternion_of, run_samples, set_quaternion, tilt_start
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording

GAIN_PER_S_RANGE = Range(1e-5, 1.0, log=True, source="ours: from hardly any correction to thirty times the default")
GAIN_PER_S_ORIGIN = DefaultOrigin("literature: the paper's .033 for gyro and accelerometer")


@register("attitude", "madgwick")
@dataclass(frozen=True)
class Madgwick(TiltAndYaw):
    """Madgwick's filter without a magnetometer: the gyro, and a step of constant rate against the error of gravity.

    With q = (w, a, b, c) from the body to ENU, x(q) = Omega^T e3 and y_A, y_G of one sample::

        f = x(q) - y_A/|y_A|;  J = dx/dq
        q += dt (q (0, y_G)/2 - beta J'f/|J'f|);  q /= |q|

    The correction has the rate beta [1/s] however large the error is. It has no estimate of the gyro's bias: a bias
    larger than about 2 beta is not held. Yaw is not its own, but that of `tilt`.

    Equal to the package ``ahrs`` to 1e-9, some hundred times as fast; the package skips samples whose rate is exactly
    zero.

    Source: S. O. H. Madgwick, A. J. L. Harrison, R. Vaidyanathan, "Estimation of IMU and MARG orientation using a
    gradient descent algorithm", IEEE International Conference on Rehabilitation Robotics, 2011,
    doi:10.1109/ICORR.2011.5975346.

    Attributes:
        gain_per_s: beta.
    """

    name: ClassVar[str] = "madgwick"

    gain_per_s: Annotated[float, NOT_NEGATIVE, GAIN_PER_S_RANGE, GAIN_PER_S_ORIGIN] = 0.033

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample."""
        x = np.empty((len(recording.inertial.t_s), 3))
        q = quaternion_of(tilt_start(recording, alignment=self.alignment).x)
        state = q, float(self.gain_per_s)
        run_samples(run_madgwick, "the attitude filter madgwick", recording.inertial, state, x)
        return x, None


def run_madgwick(
    q: FloatVector, gain: float, gyro: FloatMatrix, accel: FloatMatrix, dt: FloatVector, x: FloatMatrix
) -> None:
    """Fill x (n, 3); q (4,) is the state before the first sample, and after the last."""
    for k in range(len(dt)):
        w, a, b, c = q[0], q[1], q[2], q[3]
        p, r, s = gyro[k, 0], gyro[k, 1], gyro[k, 2]
        rate_w, rate_a = 0.5 * (-a * p - b * r - c * s), 0.5 * (w * p + b * s - c * r)
        rate_b, rate_c = 0.5 * (w * r - a * s + c * p), 0.5 * (w * s + a * r - b * p)
        force = math.sqrt(accel[k, 0] ** 2 + accel[k, 1] ** 2 + accel[k, 2] ** 2)
        if force > 0.0:
            f0 = 2.0 * (a * c - w * b) - accel[k, 0] / force
            f1 = 2.0 * (w * a + b * c) - accel[k, 1] / force
            f2 = 2.0 * (0.5 - a * a - b * b) - accel[k, 2] / force
            down_w, down_a = -2.0 * b * f0 + 2.0 * a * f1, 2.0 * c * f0 + 2.0 * w * f1 - 4.0 * a * f2
            down_b, down_c = -2.0 * w * f0 + 2.0 * c * f1 - 4.0 * b * f2, 2.0 * a * f0 + 2.0 * b * f1
            slope = math.sqrt(down_w**2 + down_a**2 + down_b**2 + down_c**2)
            if slope > 0.0:
                rate_w -= gain * down_w / slope
                rate_a -= gain * down_a / slope
                rate_b -= gain * down_b / slope
                rate_c -= gain * down_c / slope
        set_quaternion(q, w + dt[k] * rate_w, a + dt[k] * rate_a, b + dt[k] * rate_b, c + dt[k] * rate_c, x[k])
