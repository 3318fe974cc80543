"""From the columns of a table to what a recording has: maps of columns, and the functions that read by them.

In this order: covariances and attitude, which are parts of the streams; then the streams: fixes, velocities and the
reference. Each stream is read from columns or, where its file ends in .pos, from RTKLIB's solution.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, enu_axes, euler_from_dcm
from jerkbench.io.columns import Columns
from jerkbench.io.frames import axes_in_enu, axes_matrix, axes_to_judge, enu_from, in_degrees, in_enu, origin_of
from jerkbench.io.sanitiser import steady_rows
from jerkbench.io.table import Source, TimedColumns
from jerkbench.recording import Origin, Position, Reference, Velocity

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


def read_attitude(columns: Columns, mapping: AttitudeMap) -> FloatArray | None:
    """Return (n, 3) roll, pitch, yaw [rad] of the FLU body in ENU, NaN where they are unknown; None without columns.

    Raises:
        RecordingError: there is no such column, or a cell is no number.
    """
    if not mapping.angles:
        return None
    attitude = columns.numbers(mapping.angles)
    if len(mapping.angles) == 3 and mapping.unit == "deg":
        attitude = np.radians(attitude)
    known = _known_attitude(attitude)
    euler_rad = np.full((len(attitude), 3), np.nan)
    if known.any():
        turns = enu_from(mapping.frame) @ _turns(attitude[known]) @ _flu_from_body(mapping).T
        euler_rad[known] = euler_from_dcm(turns)
    return euler_rad


def _known_attitude(attitude: FloatArray) -> BoolArray:
    """Which rows (n,) are numbers, and no quaternions of zeros."""
    finite = np.isfinite(attitude).all(axis=1)
    if attitude.shape[1] == 3:
        return np.asarray(finite)
    return np.asarray(finite & (np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0))


def _turns(attitude: FloatArray) -> FloatArray:
    """Turns (n, 3, 3) from the body to the local frame, of three angles or of w, x, y, z."""
    by_angles = attitude.shape[1] == 3
    return dcm_from_euler(attitude) if by_angles else dcm_from_quaternion(attitude[:, [1, 2, 3, 0]])


def _flu_from_body(mapping: AttitudeMap) -> FloatArray:
    """M (3, 3) with f_flu = M f_body."""
    if mapping.body == "frd":
        return _FLU_FROM_FRD
    return axes_matrix(mapping.imu_axes) if mapping.body == "sensor" else np.eye(3)


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
        return _solved_fixes(table, mapping.source, zero_ns, origin)
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


def _solved_fixes(table: TimedColumns, source: Source, zero_ns: int, origin: Origin | None) -> Fixes:
    t_s, solution, leaps = table.read_solution(source, zero_ns)
    if origin is not None:
        solution = solution.with_axes_at(origin)
    return Fixes(*solution.position(t_s, origin), leaps)


KEPT_FRAMES: dict[str, Literal["body", "speed"]] = {"body": "body", "speed": "speed"}
"""Frames of velocities that a recording has too; all others are turned into ENU."""


@dataclass(frozen=True)
class VelocityMap:
    """Which columns of a table are a velocity.

    Attributes:
        source: where they stand.
        axes: three columns, one for a speed.
        frame: enu, ned, ecef, body (FLU) or speed.
        covariance: the columns of the covariance, in the frame.
    """

    source: Source
    axes: tuple[str, ...]
    frame: str
    covariance: CovarianceMap


def read_velocity(
    table: TimedColumns, mapping: VelocityMap, zero_ns: int, origin: Origin | None
) -> tuple[Velocity | None, tuple[str, ...]]:
    """Return the velocities, None where there are none, and what was dropped, in sentences.

    Raises:
        RecordingError: the file is missing or damaged, has no such column, is a solution without velocities, or is in
            ECEF and the ``origin`` is not known.
        PluginError: the file is a solution of RTKLIB, and the times of the table are not known.
    """
    if not mapping.source.file:
        return None, ()
    if mapping.source.solved:
        return _solved_velocity(table, mapping.source, zero_ns)
    stream = table.read(mapping.source).only(mapping.axes)
    columns, t_s = stream.columns, stream.t_s(zero_ns)
    covariance, notes = covariances_of(columns, mapping.covariance, origin)
    values = columns.numbers(mapping.axes)
    if mapping.frame == "speed":
        values = np.column_stack([values, np.full((len(values), 2), np.nan)])
    elif mapping.frame == "ecef":
        values = values @ enu_axes(_known_place(columns.where, origin)).T
    velocity = Velocity(t_s, axes_in_enu(values, mapping.frame), covariance, KEPT_FRAMES.get(mapping.frame, "enu"))
    return velocity, (*columns.notes, *notes)


def _known_place(where: str, origin: Origin | None) -> Origin:
    if origin is None:
        raise RecordingError(f"{where} has velocities in ECEF, and where it is on the Earth is not known; give origin.")
    return origin


def _solved_velocity(table: TimedColumns, source: Source, zero_ns: int) -> tuple[Velocity, tuple[str, ...]]:
    t_s, solution, notes = table.read_solution(source, zero_ns)
    if solution.velocity_enu_mps is None or solution.velocity_covariance_m2ps2 is None:
        raise RecordingError(
            f"dataset table: {source.file} has no velocities; let RTKLIB write them (out-outvel=on), or leave"
            f" {source.parameter} empty."
        )
    return Velocity(t_s, solution.velocity_enu_mps, solution.velocity_covariance_m2ps2), notes


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
        return _solved_reference(table, mapping, zero_ns, origin)
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
        euler_rad=read_attitude(columns, mapping.attitude),
    )
    return reference, origin, columns.notes


def _solved_reference(
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
