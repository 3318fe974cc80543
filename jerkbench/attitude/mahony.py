"""The attitude plugins ``mahony`` and ``madgwick``, two complementary filters."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatMatrix, FloatVector
from jerkbench.attitude.common import TiltAndYaw, Verticals, quaternion_of, run_samples, set_quaternion, tilt_start
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording

PROPORTIONAL_PER_S_RANGE = Range(1e-4, 3.0, log=True, source="ours: time constants from 0.3 s to 3 h")
PROPORTIONAL_PER_S_ORIGIN = DefaultOrigin("literature: 1 in the paper")
INTEGRAL_PER_S2_RANGE = Range(1e-6, 0.3, log=True, source="ours: from a bias estimated over an hour to the paper")
INTEGRAL_PER_S2_ORIGIN = DefaultOrigin("literature: 0.3 in the paper")


@register("attitude", "mahony")
@dataclass(frozen=True)
class Mahony(TiltAndYaw):
    """Mahony's explicit complementary filter, with proportional and integral feedback of the gravity error.

    Each sample updates the quaternion q from the body frame to ENU and the gyro bias b, with x = Omega^T e3::

        e = cross(y_A/|y_A|, x);  b -= k_I e dt;  q += dt q (0, y_G - b + k_P e)/2;  q /= |q|

    The time constant of the tilt is 1/k_P. With k_I = 0, the gyro bias is not estimated. The yaw is computed in the
    same way as in the plugin `tilt`.

    The results agree with the package ``ahrs`` to 1e-9, but the computation is about 100 times faster than in ``ahrs``.
    The package ``ahrs`` skips samples with an angular rate of exactly zero.

    Source: R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal group", IEEE
    Transactions on Automatic Control 53(5), 2008, doi:10.1109/TAC.2008.923738.

    Attributes:
        proportional_per_s: k_P, proportional gain of the tilt correction [1/s].
        integral_per_s2: k_I, integral gain of the gyro bias; 0 disables the bias estimation [1/s2].
    """

    name: ClassVar[str] = "mahony"

    proportional_per_s: Annotated[float, NOT_NEGATIVE, PROPORTIONAL_PER_S_RANGE, PROPORTIONAL_PER_S_ORIGIN] = 1.0
    integral_per_s2: Annotated[float, NOT_NEGATIVE, INTEGRAL_PER_S2_RANGE, INTEGRAL_PER_S2_ORIGIN] = 0.3

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3) after each sample. The mask of detected accelerations is None."""
        q = quaternion_of(tilt_start(recording, alignment=self.alignment).x)
        state = q, np.zeros(3), float(self.proportional_per_s), float(self.integral_per_s2)
        return run_samples(run_mahony, "the attitude filter mahony", recording.inertial, state, detects=False)


def run_mahony(
    q: FloatVector,
    bias: FloatVector,
    proportional: float,
    integral: float,
    gyro: FloatMatrix,
    accel: FloatMatrix,
    dt: FloatVector,
    x: FloatMatrix,
) -> None:
    """Process all samples: write the verticals to ``x`` (n, 3), and update the quaternion ``q`` and ``bias``."""
    for k in range(len(dt)):
        w, a, b, c = q[0], q[1], q[2], q[3]
        p, r, s = gyro[k, 0], gyro[k, 1], gyro[k, 2]
        force = math.sqrt(accel[k, 0] ** 2 + accel[k, 1] ** 2 + accel[k, 2] ** 2)
        if force > 0.0:
            f0, f1, f2 = accel[k, 0] / force, accel[k, 1] / force, accel[k, 2] / force
            x0, x1, x2 = 2.0 * (a * c - w * b), 2.0 * (w * a + b * c), 1.0 - 2.0 * (a * a + b * b)
            e0, e1, e2 = f1 * x2 - f2 * x1, f2 * x0 - f0 * x2, f0 * x1 - f1 * x0
            bias[0] -= integral * e0 * dt[k]
            bias[1] -= integral * e1 * dt[k]
            bias[2] -= integral * e2 * dt[k]
            p += proportional * e0
            r += proportional * e1
            s += proportional * e2
        p, r, s = 0.5 * dt[k] * (p - bias[0]), 0.5 * dt[k] * (r - bias[1]), 0.5 * dt[k] * (s - bias[2])
        w, a, b, c = (
            w - a * p - b * r - c * s,
            a + w * p + b * s - c * r,
            b + w * r - a * s + c * p,
            c + w * s + a * r - b * p,
        )
        set_quaternion(q, w, a, b, c, x[k])


GAIN_PER_S_RANGE = Range(1e-5, 1.0, log=True, source="ours: from hardly any correction to 30 times the default")
GAIN_PER_S_ORIGIN = DefaultOrigin("literature: 0.033 in the paper, for gyro and accelerometer")


@register("attitude", "madgwick")
@dataclass(frozen=True)
class Madgwick(TiltAndYaw):
    """Madgwick's filter without a magnetometer: integrated gyro, and a gradient step of constant rate towards gravity.

    A sample with the specific force y_A and the angular rate y_G updates the quaternion q from the body frame to ENU,
    with x(q) = Omega^T e3::

        f = x(q) - y_A/|y_A|;  J = dx/dq
        q += dt (q (0, y_G)/2 - beta J'f/|J'f|);  q /= |q|

    The rate of the correction is beta, independently of the size of the tilt error. The filter does not estimate the
    gyro bias. A gyro bias of more than about 2 beta causes an unbounded tilt error. The yaw is computed in the same way
    as in the plugin `tilt`.

    The results agree with the package ``ahrs`` to 1e-9, but the computation is about 100 times faster than in ``ahrs``.
    The package ``ahrs`` skips samples with an angular rate of exactly zero.

    Source: S. O. H. Madgwick, A. J. L. Harrison, R. Vaidyanathan, "Estimation of IMU and MARG orientation using a
    gradient descent algorithm", IEEE International Conference on Rehabilitation Robotics, 2011,
    doi:10.1109/ICORR.2011.5975346.

    Attributes:
        gain_per_s: beta, constant rate of the tilt correction [1/s].
    """

    name: ClassVar[str] = "madgwick"

    gain_per_s: Annotated[float, NOT_NEGATIVE, GAIN_PER_S_RANGE, GAIN_PER_S_ORIGIN] = 0.033

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3) after each sample. The mask of detected accelerations is None."""
        state = quaternion_of(tilt_start(recording, alignment=self.alignment).x), float(self.gain_per_s)
        return run_samples(run_madgwick, "the attitude filter madgwick", recording.inertial, state, detects=False)


def run_madgwick(
    q: FloatVector, gain: float, gyro: FloatMatrix, accel: FloatMatrix, dt: FloatVector, x: FloatMatrix
) -> None:
    """Process all samples: write the verticals to ``x`` (n, 3), and update the quaternion ``q`` (4,)."""
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
