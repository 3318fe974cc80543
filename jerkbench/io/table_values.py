"""Covariances and attitudes in the columns of a table: which columns they are, and how they are read."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, enu_axes, euler_from_dcm
from jerkbench.io.columns import Columns
from jerkbench.io.frames import FLU_FROM_FRD, axes_matrix, covariance_in_enu, enu_from, turned_covariance
from jerkbench.recording import Origin

_RTKLIB = [0, 3, 5, 3, 1, 4, 5, 4, 2]
_UPPER = [0, 3, 4, 3, 1, 5, 4, 5, 2]
"""Where the nine elements of a matrix stand: of RTKLIB's six (11 22 33 12 23 31), of the upper half's six."""


@dataclass(frozen=True)
class CovarianceMap:
    """Which columns of a table are the covariance of three axes.

    Attributes:
        sigma: standard deviations: one for all axes, three, or RTKLIB's six (11, 22, 33, 12, 23, 31; each the root of
            the covariance's absolute value with its sign).
        covariance: one variance for all axes, three variances, six elements (11, 22, 33, 12, 13, 23), or nine, row by
            row.
        frame: of the axes: enu, ned or ecef.
        sigma_otherwise: one standard deviation of an axis, where there are no columns.
        scale: what the columns of standard deviations are multiplied with: of a DOP, one standard deviation of a range.
    """

    sigma: tuple[str, ...]
    covariance: tuple[str, ...]
    frame: str
    sigma_otherwise: float
    scale: float = 1.0


def covariances_of(
    columns: Columns, mapping: CovarianceMap, origin: Origin | None
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return (n, 3, 3) in ENU, and notes that count those that are not positive definite, and rows that have none.

    Of the first the sizes of the variances alone are used: rounding makes them so, or a solution that was no minimum,
    of which RTKLIB writes a negative standard deviation. A row with empty cells has ``sigma_otherwise``.

    Raises:
        RecordingError: there is no such column, a cell is no number, or the axes are those of ECEF and the place on
            Earth is not known.
    """
    otherwise = mapping.sigma_otherwise**2 * np.eye(3)
    if not mapping.covariance and not mapping.sigma:
        return np.tile(otherwise, (len(columns), 1, 1)), ()
    matrices = _matrices(columns, mapping)
    empty = ~columns.rows_of(mapping.covariance or mapping.sigma)
    matrices = np.where(empty[:, None, None], otherwise, matrices)
    diagonal = np.abs(matrices * np.eye(3))
    sound = _positive_definite(matrices) | ~_positive_definite(diagonal)
    turned = _in_enu(columns.where, np.where(sound[:, None, None], matrices, diagonal), mapping.frame, origin)
    count = int((~sound).sum())
    name, notes = Path(columns.where).name, []
    if count:
        few = f"{count} of {len(columns)} covariances of {name} are not positive definite"
        notes.append(f"{few}: the sizes of their variances alone are used.")
    if empty.any():
        few = f"{int(empty.sum())} of {len(columns)} rows of {name} have no standard deviation"
        notes.append(f"{few}: {mapping.sigma_otherwise:g} is taken.")
    return turned, tuple(notes)


def _matrices(columns: Columns, mapping: CovarianceMap) -> FloatArray:
    """(n, 3, 3) in the file's axes."""
    if mapping.covariance:
        values, six = columns.numbers(mapping.covariance), _UPPER
    else:
        sd = mapping.scale * columns.numbers(mapping.sigma)
        values, six = sd * np.abs(sd), _RTKLIB
    if values.shape[1] in (1, 3):
        return np.asarray(np.broadcast_to(values, (len(values), 3))[:, :, None] * np.eye(3))
    return np.asarray(values[:, six if values.shape[1] == 6 else list(range(9))].reshape(-1, 3, 3))


def _positive_definite(matrices: FloatArray) -> BoolArray:
    finite: BoolArray = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    lowest = np.linalg.eigvalsh(np.where(finite[:, None, None], matrices, 0.0))[:, 0]
    return np.asarray(finite & (lowest > 0))


def _in_enu(where: str, matrices: FloatArray, frame: str, origin: Origin | None) -> FloatArray:
    """Turned into ENU and symmetric to the bit; of local axes one that is NaN stays alone."""
    if frame in ("enu", "ned"):
        return covariance_in_enu(matrices, frame)
    if origin is None:
        raise RecordingError(f"{where} has axes of ECEF, and where it is on the Earth is not known; give origin.")
    return turned_covariance(enu_axes(origin), matrices)


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


def read_attitude(columns: Columns, mapping: AttitudeMap) -> FloatArray | None:
    """Return (n, 3) roll, pitch, yaw [rad] of the FLU body in ENU, NaN where they are unknown; None without columns.

    Raises:
        RecordingError: there is no such column, or a cell is no number.
    """
    if not mapping.angles:
        return None
    attitude, by_angles = columns.numbers(mapping.angles), len(mapping.angles) == 3
    if by_angles and mapping.unit == "deg":
        attitude = np.radians(attitude)
    known = np.isfinite(attitude).all(axis=1)
    if not by_angles:
        known &= np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0  # a quaternion of zeros is none
    euler_rad = np.full((len(attitude), 3), np.nan)
    if known.any():
        turns = dcm_from_euler(attitude[known]) if by_angles else dcm_from_quaternion(attitude[known][:, [1, 2, 3, 0]])
        axes = axes_matrix(mapping.imu_axes) if mapping.body == "sensor" else np.eye(3)
        flu_from_body = FLU_FROM_FRD if mapping.body == "frd" else axes
        euler_rad[known] = euler_from_dcm(enu_from(mapping.frame) @ turns @ flu_from_body.T)
    return euler_rad
