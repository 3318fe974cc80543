"""Madgwick's attitude filter in plain Python.

Run as python madgwick.py recording.csv out.csv. SI units; the body is forward, left, up; at rest the accelerometer
shows +g upwards.
"""

import csv
import math
import sys
from pathlib import Path

BETA = 0.033  # 1/s: the rate of the correction, of the paper
GYRO = ("gyro_forward_radps", "gyro_left_radps", "gyro_up_radps")
ACCEL = ("accel_forward_mps2", "accel_left_mps2", "accel_up_mps2")


def level(x, y, z):
    """Return the quaternion of a body at rest that feels the specific force x, y, z; its heading is 0."""
    roll, pitch = math.atan2(y, z) / 2, math.atan2(-x, math.hypot(y, z)) / 2
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    return [cr * cp, sr * cp, cr * sp, -sr * sp]


def step(q, gyro, accel, dt):
    """Return q (w, a, b, c; body to a world whose z is up) after a sample: q' = q (0, gyro)/2 - BETA J'f/|J'f|."""
    (w, a, b, c), (p, r, s), (x, y, z), norm = q, gyro, accel, math.hypot(*accel)
    rate = [-a * p - b * r - c * s, w * p + b * s - c * r, w * r - a * s + c * p, w * s + a * r - b * p]
    f = 2 * (a * c - w * b) - x / norm, 2 * (w * a + b * c) - y / norm, 1 - 2 * (a * a + b * b) - z / norm
    J = ((-2 * b, 2 * c, -2 * w, 2 * a), (2 * a, 2 * w, 2 * c, 2 * b), (0, -4 * a, -4 * b, 0))
    slope = [sum(J[i][k] * f[i] for i in range(3)) for k in range(4)]
    length = math.hypot(*slope) or 1.0
    q = [q[k] + dt * (rate[k] / 2 - BETA * slope[k] / length) for k in range(4)]
    return [value / math.hypot(*q) for value in q]


with Path(sys.argv[1]).open(newline="") as recording, Path(sys.argv[2]).open("w", newline="") as out:
    before, q, write = None, None, csv.writer(out)
    write.writerow(("t_s", "qw", "qx", "qy", "qz"))
    for row in csv.DictReader(recording):
        t, *measured = (float(row[name]) for name in ("t_s", *GYRO, *ACCEL))
        q = step(q or level(*measured[3:]), measured[:3], measured[3:], t - (t if before is None else before))
        before = t
        write.writerow((t, *q))
