"""The mounting of an IMU: its own axes and units -> the body's (FLU, m/s2, rad/s)."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Imu

ACCEL_UNITS = {"g": 9.80665, "m/s2": 1.0}
"""Metres per second squared in each unit of specific force (g: the standard acceleration of gravity)."""

GYRO_UNITS = {"deg/s": float(np.pi / 180.0), "rad/s": 1.0}
"""Radians per second in each unit of angular rate."""


def axes_matrix(axes: tuple[str, ...]) -> FloatArray:
    """Return (3, 3) M with f_body = M f_sensor, of what the body's x, y, z are: ("z", "-y", "x") for instance.

    Raises:
        PluginError: these are not three axes of the sensor, or they make a left-handed body.
    """
    turn = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        name = axis.lstrip("+-")
        if len(axes) != 3 or name not in ("x", "y", "z") or len(axis) - len(name) > 1:
            raise PluginError(f"imu_axes is {axes}; give three of x, y, z, -x, -y, -z: what the body's x, y, z are.")
        turn[row, "xyz".index(name)] = -1.0 if axis.startswith("-") else 1.0
    if not np.isclose(np.linalg.det(turn), 1.0):
        raise PluginError(f"imu_axes is {axes}, which makes no right-handed body; check the signs.")
    return turn


def body_from_sensor(signs: tuple[float, ...], yaw_deg: float, pitch_deg: float) -> FloatArray:
    """Return (3, 3) M = (Rz(yaw) Ry(pitch))' diag(signs), so that f_body = M f_sensor."""
    turned = dcm_from_euler(np.radians([0.0, pitch_deg, yaw_deg]))
    return np.asarray(turned.T @ np.diag(signs))


def imu_in_body(t_s: FloatArray, accel: FloatArray, gyro: FloatArray, units: tuple[str, str], turn: FloatArray) -> Imu:
    """Return the samples in the body's axes and units.

    Args:
        t_s: (n,) their times.
        accel: (n, 3) specific force, the sensor's axes and unit.
        gyro: (n, 3) angular rate, the sensor's axes and unit.
        units: of the specific force and of the angular rate.
        turn: (3, 3) M with f_body = M f_sensor.
    """
    accel_unit, gyro_unit = units
    return Imu(t_s, accel * ACCEL_UNITS[accel_unit] @ turn.T, gyro * GYRO_UNITS[gyro_unit] @ turn.T)
