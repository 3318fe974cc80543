"""The fixes of a table: places in any frame -> positions in ENU with their covariances."""

from dataclasses import dataclass

import numpy as np

from jerkbench.datasets._table_covariance import CovarianceMap, covariances_of
from jerkbench.datasets._table_stream import Source
from jerkbench.datasets._timed_columns import TimedColumns
from jerkbench.readers.frames import axes_to_judge, in_degrees, in_enu, origin_of
from jerkbench.recording import Origin, Position
from jerkbench.sanitiser.fixes import steady_rows


@dataclass(frozen=True)
class PositionMap:
    """Which columns of a table are a place.

    Attributes:
        source: where they stand.
        place: three columns, in the order of the frame.
        frame: enu, ned, geodetic or ecef.
        angle_unit: of latitude and longitude: deg or rad.
        covariance: the columns of the covariance.
    """

    source: Source
    place: tuple[str, ...]
    frame: str
    angle_unit: str
    covariance: CovarianceMap


@dataclass(frozen=True)
class Fixes:
    """What a table says about where it was.

    Attributes:
        position: the fixes that do not leap, or None.
        origin: of their ENU; None where nothing is known of it.
        notes: what was dropped, in sentences.
    """

    position: Position | None
    origin: Origin | None
    notes: tuple[str, ...] = ()


def read_fixes(table: TimedColumns, mapping: PositionMap, zero_ns: int, origin: Origin | None) -> Fixes:
    """Return the fixes about ``origin``; where that is None, about the first complete one that does not leap.

    Raises:
        RecordingError: a file is missing or damaged, has no such column, or, without an origin, no complete row.
        PluginError: the file is a solution of RTKLIB, and the times of the table are not known.
    """
    if not mapping.source.file:
        return Fixes(None, origin)
    if mapping.source.solved:
        return _solved(table, mapping.source, zero_ns, origin)
    stream = table.read(mapping.source).only(mapping.place)
    t_s, places = (
        stream.t_s(zero_ns),
        in_degrees(stream.columns.numbers(mapping.place), mapping.frame, mapping.angle_unit),
    )
    notes: tuple[str, ...] = ()
    steady = np.ones(len(t_s), dtype=np.bool_)
    if table.drop_leaps:
        steady, notes = steady_rows(t_s, axes_to_judge(places, mapping.frame))
    origin = origin or origin_of(places[steady], mapping.frame)
    enu_m = in_enu(places[steady], mapping.frame, origin)
    covariance, rounded = covariances_of(stream.columns.only(steady), mapping.covariance, origin)
    return Fixes(Position(t_s[steady], enu_m, covariance), origin, (*stream.columns.notes, *notes, *rounded))


def _solved(table: TimedColumns, source: Source, zero_ns: int, origin: Origin | None) -> Fixes:
    t_s, solution, leaps = table.read_solution(source, zero_ns)
    if origin is not None:
        solution = solution.with_axes_at(origin)
    return Fixes(*solution.position(t_s, origin), leaps)
