"""The attitude in a table, whoever's and in whatever form it is -> roll, pitch, yaw of the FLU body in ENU."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.readers.columns import Columns
from jerkbench.readers.frames import enu_from
from jerkbench.readers.mounting import axes_matrix

ATTITUDE_BODIES = ("flu", "frd", "sensor")

_FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class AttitudeMap:
    """Which columns of a table are an attitude.

    Attributes:
        angles: three columns (roll, pitch, yaw) or four (w, x, y, z), body to local frame, or none.
        unit: of roll, pitch and yaw: rad or deg.
        frame: the local frame.
        body: whose attitude it is: flu, frd or sensor.
        imu_axes: what the body's x, y, z are on the sensor.
    """

    angles: tuple[str, ...]
    unit: str
    frame: str
    body: str
    imu_axes: tuple[str, ...]


def attitude_of(columns: Columns, mapping: AttitudeMap) -> FloatArray | None:
    """Return (n, 3) roll, pitch, yaw [rad] of the FLU body in ENU, NaN where they are unknown; None without columns.

    Raises:
        RecordingError: there is no such column, or a cell is no number.
    """
    if not mapping.angles:
        return None
    attitude = columns.numbers(mapping.angles)
    if len(mapping.angles) == 3 and mapping.unit == "deg":
        attitude = np.radians(attitude)
    known = _known(attitude)
    euler_rad = np.full((len(attitude), 3), np.nan)
    if known.any():
        turns = enu_from(mapping.frame) @ _dcm(attitude[known]) @ _flu_from_body(mapping).T
        euler_rad[known] = euler_from_dcm(turns)
    return euler_rad


def _known(attitude: FloatArray) -> BoolArray:
    """Which rows (n,) are numbers, and no quaternions of zeros."""
    finite = np.isfinite(attitude).all(axis=1)
    if attitude.shape[1] == 3:
        return np.asarray(finite)
    return np.asarray(finite & (np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0))


def _dcm(attitude: FloatArray) -> FloatArray:
    """Turns (n, 3, 3) from the body to the local frame, of three angles or of w, x, y, z."""
    by_angles = attitude.shape[1] == 3
    return dcm_from_euler(attitude) if by_angles else dcm_from_quaternion(attitude[:, [1, 2, 3, 0]])


def _flu_from_body(mapping: AttitudeMap) -> FloatArray:
    """M (3, 3) with f_flu = M f_body."""
    if mapping.body == "frd":
        return _FLU_FROM_FRD
    return axes_matrix(mapping.imu_axes) if mapping.body == "sensor" else np.eye(3)
