"""The covariances of a table's places and velocities: of standard deviations, variances, or whole matrices."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import enu_axes
from jerkbench.readers.columns import Columns
from jerkbench.recording import Origin

SIGMAS = (0, 1, 3, 6)
COVARIANCES = (0, 1, 3, 6, 9)
"""How many columns there may be of standard deviations and of variances and covariances."""

COVARIANCE_FRAMES = ("enu", "ned", "ecef")

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
    """Return (n, 3, 3) in ENU, and a note that counts those that are not positive definite, or none.

    Of these the sizes of the variances alone are used: rounding makes them so, or a solution that was no minimum, of
    which RTKLIB writes a negative standard deviation.

    Raises:
        RecordingError: there is no such column, a cell is no number, or the axes are those of ECEF and the place on
            Earth is not known.
    """
    if not mapping.covariance and not mapping.sigma:
        return np.tile(mapping.sigma_otherwise**2 * np.eye(3), (len(columns), 1, 1)), ()
    matrices = _matrices(columns, mapping)
    diagonal = np.abs(matrices * np.eye(3))
    sound = _positive_definite(matrices) | ~_positive_definite(diagonal)
    turned = _in_enu(columns.where, np.where(sound[:, None, None], matrices, diagonal), mapping.frame, origin)
    count = int((~sound).sum())
    few = f"{count} of {len(columns)} covariances of {Path(columns.where).name} are not positive definite"
    return turned, (f"{few}: the sizes of their variances alone are used.",) if count else ()


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
    if frame == "enu":
        return matrices
    if frame == "ned":
        return np.asarray(matrices[:, [1, 0, 2]][:, :, [1, 0, 2]] * np.outer([1, 1, -1], [1, 1, -1]))
    if origin is None:
        raise RecordingError(f"{where} has axes of ECEF, and where it is on the Earth is not known; give origin.")
    turned = enu_axes(origin) @ matrices @ enu_axes(origin).T
    return np.asarray(0.5 * (turned + turned.transpose(0, 2, 1)))
