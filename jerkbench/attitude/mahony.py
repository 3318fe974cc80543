"""The attitude plugin ``mahony``: the explicit complementary filter on the rotations, with the gyro's bias."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatMatrix, FloatVector
from jerkbench.attitude.common import TiltAndYaw, Verticals, quaternion_of, run_samples, set_quaternion, tilt_start
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording

PROPORTIONAL_PER_S_ORIGIN = DefaultOrigin("literature: the paper's 1")
INTEGRAL_PER_S2_RANGE = Range(1e-6, 0.3, log=True, source="ours: from a bias that is found in an hour to the paper's")
INTEGRAL_PER_S2_ORIGIN = DefaultOrigin("literature: the paper's .3")


@register("attitude", "mahony")
@dataclass(frozen=True)
class Mahony(TiltAndYaw):
    """Mahony's explicit complementary filter: a proportional and an integral correction by the error of gravity.

    With q from the body to ENU, x = Omega^T e3, b the gyro's bias::

        e = y_A/|y_A| x x (cross product);  b -= k_I e dt;  q += dt q (0, y_G - b + k_P e)/2;  q /= |q|

    1/k_P is the time constant of the tilt. With k_I = 0 there is no estimate of the bias. Yaw is not its own, but that
    of `tilt`.

    Equal to the package ``ahrs`` to 1e-9, some hundred times as fast; the package skips samples whose rate is exactly
    zero.

    Source: R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal group", IEEE
    Transactions on Automatic Control 53(5), 2008, doi:10.1109/TAC.2008.923738.

    Attributes:
        proportional_per_s: k_P.
        integral_per_s2: k_I; 0: no bias is estimated.
    """

    name: ClassVar[str] = "mahony"

    proportional_per_s: Annotated[
        float,
        NOT_NEGATIVE,
        Range(1e-4, 3.0, log=True, source="ours: time constants from a third of a second to three hours"),
        PROPORTIONAL_PER_S_ORIGIN,
    ] = 1.0
    integral_per_s2: Annotated[float, NOT_NEGATIVE, INTEGRAL_PER_S2_RANGE, INTEGRAL_PER_S2_ORIGIN] = 0.3

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample."""
        x = np.empty((len(recording.inertial.t_s), 3))
        q = quaternion_of(tilt_start(recording, alignment=self.alignment).x)
        state = q, np.zeros(3), float(self.proportional_per_s), float(self.integral_per_s2)
        run_samples(run_mahony, "the attitude filter mahony", recording.inertial, state, x)
        return x, None


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
    """Fill x (n, 3); q (4,) and ``bias`` (3,) are the state before the first sample, and after the last."""
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
