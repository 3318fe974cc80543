"""The unit quaternion w, a, b, c of `madgwick` and `mahony`, which turns the body into ENU."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import roll_pitch


def quaternion_of(x: FloatArray) -> FloatArray:
    """Return (4,) the rotation whose vertical is x = Omega^T e3 (3,), with yaw 0."""
    roll, pitch = roll_pitch(x)
    cr, sr, cp, sp = np.cos(roll / 2), np.sin(roll / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return np.array([cr * cp, sr * cp, cr * sp, -sr * sp])


def set_quaternion(q: FloatArray, w: float, a: float, b: float, c: float, x: FloatArray) -> None:
    """Put (w, a, b, c), brought to length 1, into q (4,), and its vertical into x (3,); for a compiled loop."""
    length = math.sqrt(w * w + a * a + b * b + c * c)
    w, a, b, c = w / length, a / length, b / length, c / length
    q[0], q[1], q[2], q[3] = w, a, b, c
    x[0], x[1], x[2] = 2.0 * (a * c - w * b), 2.0 * (w * a + b * c), 1.0 - 2.0 * (a * a + b * b)
