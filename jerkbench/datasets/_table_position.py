"""The fixes of a table: places in any frame -> positions in ENU with their covariances."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.datasets._table_stream import Source
from jerkbench.datasets._timed_columns import TimedColumns
from jerkbench.readers.frames import in_degrees, in_enu, origin_of
from jerkbench.recording import Origin, Position
from jerkbench.sanitiser.fixes import leap_notes, leaping_rows


@dataclass(frozen=True)
class PositionMap:
    """Which columns of a table are a place.

    Attributes:
        source: where they stand.
        place: three columns, in the order of the frame.
        frame: enu, ned, geodetic or ecef.
        angle_unit: of latitude and longitude: deg or rad.
        sigma: three columns of standard deviations, or one for all axes [m], in ENU, or none.
        sigma_m: one standard deviation of an axis, where there are no columns of it.
    """

    source: Source
    place: tuple[str, ...]
    frame: str
    angle_unit: str
    sigma: tuple[str, ...]
    sigma_m: float


def read_position(table: TimedColumns, given: PositionMap, zero_ns: int) -> tuple[Position | None, Origin | None]:
    """Return the fixes and the origin of their ENU, each None where there is none.

    Raises:
        RecordingError: the file is missing or damaged, or has no such column.
        PluginError: the file is a solution of RTKLIB, and the times of the table are not known.
    """
    if not given.source.file:
        return None, None
    if given.source.solved:
        t_s, solution = table.read_solution(given.source, zero_ns)
        return solution.position(t_s)
    stream = table.read(given.source).only(given.place)
    places = in_degrees(stream.columns.numbers(given.place), given.frame, given.angle_unit)
    origin = origin_of(places, given.frame)
    sigma = stream.columns.numbers(given.sigma)
    enu_m = in_enu(places, given.frame, origin)
    return Position(stream.t_s(zero_ns), enu_m, _covariances(enu_m, sigma, given.sigma_m)), origin


def steady_position(position: Position) -> tuple[Position, tuple[str, ...]]:
    """Return the fixes that do not leap, and a note that counts the others, or none."""
    leaps = leaping_rows(position.t_s, np.nan_to_num(position.enu_m))  # an axis that is not there leaps nowhere
    steady = Position(position.t_s[~leaps], position.enu_m[~leaps], position.covariance_m2[~leaps])
    return steady, leap_notes(leaps)


def _covariances(enu_m: FloatArray, sigma: FloatArray, otherwise: float) -> FloatArray:
    """Diagonal (n, 3, 3) of columns of sigmas: three, one for all axes, or none."""
    sigmas = np.broadcast_to(sigma, enu_m.shape) if sigma.shape[1] else np.full(enu_m.shape, otherwise)
    return np.asarray(np.einsum("ki,ij->kij", sigmas**2, np.eye(3)))
