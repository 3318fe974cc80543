"""The reference of a table: places, velocities and attitudes of its own, or the fixes themselves."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.datasets._table_attitude import AttitudeMap, attitude_of
from jerkbench.datasets._table_stream import Source
from jerkbench.datasets._timed_columns import TimedColumns
from jerkbench.readers.columns import Columns
from jerkbench.readers.frames import axes_in_enu, in_degrees, in_enu, origin_of
from jerkbench.recording import Origin, Position, Reference


@dataclass(frozen=True)
class ReferenceMap:
    """Which columns of a table are the reference.

    Attributes:
        source: where they stand.
        place: three columns, or none.
        velocity: three columns, or none.
        attitude: the columns of the attitude.
        frame: of places and velocities: enu, ned, geodetic or ecef.
        angle_unit: of latitude and longitude: deg or rad.
        comes_from: where the reference comes from, in words.
        independent: whether it shares nothing with the measurements.
    """

    source: Source
    place: tuple[str, ...]
    velocity: tuple[str, ...]
    attitude: AttitudeMap
    frame: str
    angle_unit: str
    comes_from: str
    independent: bool


def read_reference(
    table: TimedColumns, given: ReferenceMap, zero_ns: int, origin: Origin | None
) -> tuple[Reference, Origin | None]:
    """Return the reference and the origin of ENU, which is its first place where there was no ``origin`` before.

    Raises:
        RecordingError: the file is missing or damaged, or has no such column.
    """
    stream = table.read(given.source)
    if named := (*given.place, *given.velocity, *given.attitude.angles):
        stream = stream.only(named)
    columns = stream.columns
    enu_m, origin = _places(columns, given, origin) if given.place else (None, origin)
    reference = Reference(
        t_s=stream.t_s(zero_ns),
        source=given.comes_from,
        independent=given.independent,
        enu_m=enu_m,
        velocity_mps=axes_in_enu(columns.numbers(given.velocity), given.frame) if given.velocity else None,
        euler_rad=attitude_of(columns, given.attitude),
    )
    return reference, origin


def fixes_as_reference(position: Position | None) -> Reference:
    """Return the fixes as their own reference; without any, a reference that knows nothing."""
    if position is None:
        return Reference(np.array([0.0]), source="none", independent=False)
    return Reference(position.t_s, source="the fixes themselves", independent=False, enu_m=position.enu_m)


def _places(columns: Columns, given: ReferenceMap, origin: Origin | None) -> tuple[FloatArray, Origin | None]:
    places = in_degrees(columns.numbers(given.place), given.frame, given.angle_unit)
    origin = origin or origin_of(places, given.frame)
    return in_enu(places, given.frame, origin), origin
