"""The parameters of a table -> the maps by which its streams are read, and these streams."""

from typing import TYPE_CHECKING

from jerkbench.datasets._table_attitude import AttitudeMap
from jerkbench.datasets._table_checks import require_one_origin
from jerkbench.datasets._table_covariance import COVARIANCE_FRAMES, CovarianceMap
from jerkbench.datasets._table_position import Fixes, PositionMap, read_fixes
from jerkbench.datasets._table_reference import ReferenceMap, fixes_as_reference, read_reference
from jerkbench.datasets._table_stream import Source, Stream
from jerkbench.datasets._table_velocity import VelocityMap, read_velocity
from jerkbench.readers.gravity import gravity_notes
from jerkbench.readers.mounting import axes_matrix, imu_in_body
from jerkbench.readers.standstill import calibrated
from jerkbench.recording import Imu, Origin, Reference, Velocity
from jerkbench.sanitiser.values import possible_imu, repeat_notes

if TYPE_CHECKING:
    from jerkbench.datasets.table import Tables

NO_IMU = "There is no IMU: attitude, tilt and yaw do not apply."


def check_origin(table: "Tables") -> None:
    """Raise a PluginError where fixes and reference are about two origins."""
    reference = reference_source(table)
    if not (table.position_file and table.reference_file and (table.reference_position or reference.solved)):
        return
    solved = position_source(table).solved
    parameter = f"position_file {table.position_file}" if solved else "position_frame"
    frame = "geodetic" if solved else table.position_frame
    require_one_origin(parameter, frame, "geodetic" if reference.solved else table.reference_frame, table.origin)


def position_source(table: "Tables") -> Source:
    """Return where the fixes stand."""
    at = (table.position_file, table.position_time, table.position_shift_s, table.position_time_unit)
    return Source("position", *at, table.position_quality)


def velocity_source(table: "Tables") -> Source:
    """Return where the velocities stand."""
    at = (table.velocity_file, table.velocity_time, table.velocity_shift_s, table.velocity_time_unit)
    return Source("velocity", *at, table.position_quality)


def reference_source(table: "Tables") -> Source:
    """Return where the reference stands."""
    at = (table.reference_file, table.reference_time, table.reference_shift_s, table.reference_time_unit)
    return Source("reference", *at, table.reference_quality)


def samples_of(table: "Tables") -> Stream | None:
    """Return the rows of the IMU; None where there is none."""
    if not table.imu_file:
        return None
    stream = table.read(Source("imu", table.imu_file, table.imu_time, table.imu_shift_s))
    return stream.only((*table.imu_accel, *table.imu_gyro))


def first_ns(table: "Tables", samples: Stream | None) -> int:
    """Return time 0: that of the first sample, or, without an IMU, of the first fix."""
    if samples is None:
        source = position_source(table)
        if source.solved:
            return int(table.solution_of(source)[0][0])
        samples = table.read(source).only(table.position_columns)
    return int(samples.t_ns[0]) if len(samples.t_ns) else 0


def imu_of(table: "Tables", samples: Stream | None, zero_ns: int) -> tuple[Imu | None, tuple[str, ...]]:
    """Return the samples in the body, None where there are none, and what a reader has to know of them."""
    if samples is None:
        return None, (NO_IMU,)
    columns = samples.columns
    units, turn = (table.accel_unit, table.gyro_unit), axes_matrix(table.imu_axes)
    measured = (columns.numbers(table.imu_accel), columns.numbers(table.imu_gyro))
    imu = imu_in_body(samples.t_s(zero_ns), *measured, units, turn)
    imu = calibrated(imu, table.static_start_s, gyro=table.remove_gyro_bias, accel=False)
    imu = possible_imu(columns.where, imu)
    return imu, (*gravity_notes(imu.accel_mps2, "imu_axes"), *repeat_notes(imu), *columns.notes)


def fixes_of(table: "Tables", zero_ns: int) -> Fixes:
    """Return the fixes."""
    mapping = PositionMap(
        source=position_source(table),
        place=table.position_columns,
        frame=table.position_frame,
        angle_unit=table.angle_unit,
        covariance=CovarianceMap(
            sigma=table.position_sigma,
            covariance=table.position_covariance,
            frame=table.position_covariance_frame,
            sigma_otherwise=table.position_sigma_m,
            scale=table.position_sigma_scale,
        ),
    )
    return read_fixes(table, mapping, zero_ns, Origin(*table.origin) if table.origin else None)


def velocity_of(table: "Tables", zero_ns: int, origin: Origin | None) -> tuple[Velocity | None, tuple[str, ...]]:
    """Return the velocities, None where there are none, and what was dropped."""
    axes = table.velocity_frame if table.velocity_frame in COVARIANCE_FRAMES else "enu"
    mapping = VelocityMap(
        source=velocity_source(table),
        axes=table.velocity_columns,
        frame=table.velocity_frame,
        covariance=CovarianceMap(table.velocity_sigma, table.velocity_covariance, axes, table.velocity_sigma_mps),
    )
    return read_velocity(table, mapping, zero_ns, origin)


def reference_of(table: "Tables", zero_ns: int, fixes: Fixes) -> tuple[Reference, Origin | None, tuple[str, ...]]:
    """Return the reference, the origin of ENU, and what was dropped."""
    if not table.reference_file:
        return fixes_as_reference(fixes.position), fixes.origin, ()
    frame = table.attitude_frame or table.reference_frame
    mapping = ReferenceMap(
        source=reference_source(table),
        place=table.reference_position,
        velocity=table.reference_velocity,
        attitude=AttitudeMap(
            table.reference_attitude, table.attitude_unit, frame, table.reference_body, table.imu_axes
        ),
        frame=table.reference_frame,
        angle_unit=table.angle_unit,
        comes_from=table.reference_source,
        independent=table.reference_independent,
        offset_m=table.reference_offset_m,
    )
    return read_reference(table, mapping, zero_ns, fixes.origin)
