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
        offset_m: added to its places: east, north, up.
    """

    source: Source
    place: tuple[str, ...]
    velocity: tuple[str, ...]
    attitude: AttitudeMap
    frame: str
    angle_unit: str
    comes_from: str
    independent: bool
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)


def read_reference(
    table: TimedColumns, mapping: ReferenceMap, zero_ns: int, origin: Origin | None
) -> tuple[Reference, Origin | None, tuple[str, ...]]:
    """Return the reference, the origin of ENU, which is its first place without an ``origin`` before, and notes.

    Raises:
        RecordingError: the file is missing or damaged, or has no such column.
        PluginError: the file is a solution of RTKLIB, and the times of the table are not known.
    """
    if mapping.source.solved:
        return _solved(table, mapping, zero_ns, origin)
    stream = table.read(mapping.source)
    if named := (*mapping.place, *mapping.velocity, *mapping.attitude.angles):
        stream = stream.only(named)
    columns = stream.columns
    enu_m, origin = _places(columns, mapping, origin) if mapping.place else (None, origin)
    reference = Reference(
        t_s=stream.t_s(zero_ns),
        source=mapping.comes_from,
        independent=mapping.independent,
        enu_m=None if enu_m is None else enu_m + mapping.offset_m,
        velocity_mps=axes_in_enu(columns.numbers(mapping.velocity), mapping.frame) if mapping.velocity else None,
        euler_rad=attitude_of(columns, mapping.attitude),
    )
    return reference, origin, columns.notes


def _solved(
    table: TimedColumns, mapping: ReferenceMap, zero_ns: int, origin: Origin | None
) -> tuple[Reference, Origin | None, tuple[str, ...]]:
    t_s, solution, notes = table.read_solution(mapping.source, zero_ns)
    if origin is not None:
        solution = solution.with_axes_at(origin)
    position, origin = solution.position(t_s, origin)
    reference = Reference(
        t_s=t_s,
        source=mapping.comes_from,
        independent=mapping.independent,
        enu_m=position.enu_m + mapping.offset_m,
        velocity_mps=solution.velocity_enu_mps,
    )
    return reference, origin, tuple(f"Reference: {note}" for note in notes)


def fixes_as_reference(position: Position | None) -> Reference:
    """Return the fixes as their own reference; without any, a reference that knows nothing."""
    if position is None:
        return Reference(np.array([0.0]), source="none", independent=False)
    return Reference(position.t_s, source="the fixes themselves", independent=False, enu_m=position.enu_m)


def _places(columns: Columns, mapping: ReferenceMap, origin: Origin | None) -> tuple[FloatArray, Origin | None]:
    places = in_degrees(columns.numbers(mapping.place), mapping.frame, mapping.angle_unit)
    origin = origin or origin_of(places, mapping.frame)
    return in_enu(places, mapping.frame, origin), origin
