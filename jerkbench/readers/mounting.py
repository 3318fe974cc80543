"""From an IMU's own axes and units to the body's (FLU, m/s2, rad/s)."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_euler

ACCEL_UNITS = {"g": 9.80665, "m/s2": 1.0}
"""Metres per second squared in each unit of specific force (g: the standard acceleration of gravity)."""

GYRO_UNITS = {"deg/s": float(np.pi / 180.0), "rad/s": 1.0}
"""Radians per second in each unit of angular rate."""


def body_from_sensor(signs: tuple[float, ...], yaw_deg: float, pitch_deg: float) -> FloatArray:
    """Return (3, 3) M = (Rz(yaw) Ry(pitch))' diag(signs), so that f_body = M f_sensor."""
    turned = dcm_from_euler(np.radians([0.0, pitch_deg, yaw_deg]))
    return np.asarray(turned.T @ np.diag(signs))
