"""The data set `table`: any recording in tables (CSV, text, Parquet or MATLAB), with a map from columns to fields.

`Tables.load` reads IMU, fixes, velocities and reference from columns of tables or from an RTKLIB solution (.pos).
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from jerkbench.arrays import FloatArray, require_choices, require_not_negative, require_positive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import enu_axes
from jerkbench.io.columns import Columns
from jerkbench.io.conversions import (
    LOCAL_FRAMES,
    SPEED_UNITS,
    axes_in_enu,
    axes_matrix,
    calibrated_at_rest,
    in_degrees,
    in_enu,
    origin_of,
)
from jerkbench.io.files import FromFiles, named_folder
from jerkbench.io.readers import SOLUTION
from jerkbench.io.sanitiser import (
    HELD,
    MAX_MPS,
    drop_notes,
    held_rows,
    impossible_speeds,
    imu_in_body,
    possible_rows,
    require_origin,
    steady_rows,
    with_common_time,
    with_recorded_outages,
)
from jerkbench.io.table import (
    CHOICES,
    COVARIANCE_FRAMES,
    SOLUTION_SETTINGS,
    Source,
    TimedColumns,
    covariances_of,
    read_attitude,
    require_columns,
    with_sigma,
)
from jerkbench.io.tracks import POS_QUALITY
from jerkbench.plugins import register
from jerkbench.recording import THE_FIXES, Imu, Origin, Position, Recording, Reference, Velocity

NO_IMU = "There is no IMU: attitude, tilt and yaw do not apply."

RECORDED_FRAMES: dict[str, Literal["body", "speed"]] = {"body": "body", "speed": "speed"}
"""Frames of velocities that are not converted to ENU."""


@register("dataset", "table")
@dataclass(frozen=True)
class Tables(FromFiles, TimedColumns):
    """Any recording in tables (CSV, text, Parquet, .mat), with a map from columns to fields.

    A parameter selects a column by its name in the header or by its number from 1. A parameter selects a file by its
    name, or several files by a pattern (``data/*.txt``), in the order of their names. Time 0 is the time of the first
    IMU sample, or of the first fix if there is no IMU. A time shift (``imu_shift_s``, ``position_shift_s``, ...) is
    added to the stamps: if a value is 0.1 s old at its stamp, the shift must be -0.1 s. An empty cell of a position or
    velocity is an axis that was not measured. One file may contain several streams (IMU, fixes, velocities, reference):
    a row in which all columns of a stream are empty does not belong to this stream. A file of fixes, velocities or the
    reference whose name ends in .pos is read as a solution of RTKLIB, so its columns need not be specified.

    Rows with a position that is not on Earth, or with a date before 1980 or after 2100, are dropped and counted. If all
    stamps are before 1980, they are interpreted as times since an unknown start. Fixes that leap (are far from
    neighbouring fixes) are dropped if ``drop_leaps`` is true. A row with latitude and longitude but without a height is
    a horizontal fix. A horizontal fix is converted to ENU with a height that is interpolated between other fixes.

    In a .mat file (version 5 to 7.3), the columns of a matrix ``acc`` are acc_1, acc_2, acc_3, and a field ``t`` of a
    structure ``imu`` is imu.t. Variables in a .mat file may have different lengths. The first and the last row of a
    file are dropped if they are truncated.

    The body axes are FLU (forward, left, up). The parameter ``imu_axes`` states which sensor axis is along each body
    axis. The frames of positions are enu and ned (local), geodetic and ecef. The origin of ENU is ``origin``. If
    ``origin`` is empty, the origin of ENU is the first complete fix that does not leap, or the first position of the
    reference. Local positions are relative to the origin. If either the fixes or the reference, but not both, are in a
    local frame, ``origin`` is required. Without a position file, only the filter attitude_only runs. Without an IMU,
    only filters that do not use IMU samples (constant_velocity, acceleration, gnss_only) run.

    Presets with an IMU are kitti, euroc, tum, nclt, urbannav, ppc. Presets without an IMU are tokyo_1105, hamburg,
    pixel4, taroz, ppc_fixes, uwb_outdoor.

    Attributes:
        imu_file: file of the IMU, or empty for a recording without an IMU.
        imu_time: column of the times of the IMU.
        imu_accel: columns of the specific force x, y, z.
        imu_gyro: columns of the angular rate x, y, z.
        gyro_file: separate file of the gyro, or empty if `imu_file` has the angular rates. The angular rates of a
            separate file are interpolated to the stamps of the accelerometer.
        gyro_time: column of the times of the gyro.
        imu_increments: whether the IMU columns are increments of velocity and angle over the interval that ends at each
            stamp, as in files of KF-GINS and of some INS, instead of specific force and angular rate.
        imu_instance_column: column with the number of the sensor, if the file has rows of several sensors.
        imu_instance: number of the sensor whose rows are used, if imu_instance_column is not empty.
        accel_unit: unit of the specific force: g or m/s2.
        gyro_unit: unit of the angular rate: deg/s or rad/s.
        imu_axes: the sensor axis along each body axis x (forward), y (left) and z (up): x, -x, y, -y, z or -z.
        imu_shift_s: time shift that is added to the stamps of the IMU [s].
        static_start_s: duration of the rest at the start of the recording [s], or 0 for no rest.
        remove_gyro_bias: whether to subtract the gyro's mean over the rest at the start (``static_start_s``).
        position_file: file of the fixes, or empty for a recording without fixes.
        position_time: column of the times of the fixes.
        position_time_unit: unit of the times of the fixes: s, ms, us or ns, or empty for time_unit.
        position_quality: accepted values of ``position_quality_column``, or of the quality Q in a .pos file (1 fixed, 2
            float, 4 differential, 5 single), or empty to accept all values. In a .pos file, velocities are selected by
            the same values of Q.
        position_quality_column: column of the quality of each fix, for ``position_quality``.
        position_columns: the three columns of a position, in the order of its frame (latitude, longitude, height).
        position_frame: frame of the fixes: enu, ned, geodetic or ecef.
        position_sigma: columns of standard deviations [m]: one column for all axes, one column for each axis, or six
            columns as in RTKLIB (11, 22, 33, 12, 23, 31: the square root of |c| with the sign of the covariance c). If
            empty, position_covariance is used.
        position_covariance: columns of variances and covariances [m2]: one column for all axes, one column for each
            axis, six columns (11, 22, 33, 12, 13, 23), or nine columns (the matrix row by row). If empty,
            position_sigma_m is used.
        position_covariance_frame: frame of position_sigma and position_covariance: enu, ned or ecef.
        position_sigma_scale: factor on position_sigma. If the columns contain a DOP, the factor is the standard
            deviation of a range measurement [m].
        position_sigma_m: standard deviation of each axis of fixes without columns of sigmas or covariances [m].
        position_shift_s: time shift that is added to the stamps of the fixes [s].
        angle_unit: unit of latitude and longitude: deg, rad, 1e-7 deg (integers of receivers) or ddmm (degrees and
            minutes as in NMEA, ddmm.mmmm).
        height_unit: unit of the height of geodetic positions: m, cm, mm or ft.
        origin: latitude [deg], longitude [deg] and height [m] of the origin of ENU and of local frames, or empty to use
            the first suitable position.
        velocity_file: file of the velocities, or empty for a recording without velocities.
        velocity_time: column of the times of the velocities.
        velocity_time_unit: unit of the times of the velocities: s, ms, us or ns, or empty for time_unit.
        velocity_columns: three columns of the velocity, or one column of a speed.
        velocity_frame: frame of the velocities: enu, ned, ecef, body (FLU) or speed.
        velocity_unit: unit of the velocities: m/s, km/h, knots, cm/s or mm/s.
        velocity_sigma: columns of standard deviations of the velocity in velocity_frame [m/s], as in position_sigma.
        velocity_covariance: columns of variances and covariances of the velocity in velocity_frame [m2/s2], as in
            position_covariance.
        velocity_sigma_mps: standard deviation of each axis of velocities without columns of sigmas or covariances
            [m/s].
        velocity_shift_s: time shift that is added to the stamps of the velocities [s].
        reference_file: file of the reference, or empty to use the fixes as the reference.
        reference_time: column of the times of the reference.
        reference_time_unit: unit of the times of the reference: s, ms, us or ns, or empty for time_unit.
        reference_quality: accepted values of ``reference_quality_column``, or of the quality Q in a .pos file, or empty
            to accept all values.
        reference_quality_column: column of the quality of each row of the reference, for ``reference_quality``.
        reference_offset_m: offset (east, north, up) that is added to the positions of the reference [m], for example if
            the reference was measured with another antenna or another base station.
        reference_position: three columns of the position, or empty for a reference without positions.
        reference_angle_unit: unit of latitude and longitude of the reference, or empty for angle_unit.
        reference_height_unit: unit of the height of the reference, or empty for height_unit.
        reference_velocity: three columns of the velocity [m/s], or empty for a reference without velocities.
        reference_velocity_frame: frame of reference_velocity: enu or ned, or empty for ned if reference_frame is ned,
            and for enu otherwise.
        reference_attitude: three columns (roll, pitch, yaw) or four columns (w, x, y, z) of the rotation from the body
            to the local frame, or empty for a reference without an attitude.
        reference_frame: frame of the reference: enu, ned, geodetic or ecef.
        attitude_unit: unit of roll, pitch and yaw: rad or deg.
        attitude_frame: local frame of the attitude: enu, or ned (yaw clockwise from north), or empty for
            reference_frame.
        reference_body: axes that the attitude describes: flu, frd or sensor (the axes of the IMU).
        reference_shift_s: time shift that is added to the stamps of the reference [s].
        reference_source: phrase that describes the source of the reference.
        reference_independent: whether the reference is independent of the measurements.
        reference_sigma: columns of the standard deviation of the reference position [m]: one for all axes, or east,
            north, up.
        reference_sigma_m: standard deviation of each axis of a reference without reference_sigma [m], or 0 if unknown.
        reference_worst_m: maximum 3-D standard deviation of the reference at which errors are scored [m], or 0 for no
            limit.
        outage_s: minimum length of a gap between fixes that counts as an outage [s], or 0 for no outages. The outage
            metrics compare the estimate in an outage with the reference.
    """

    imu_file: str = "imu.csv"
    imu_time: str = "t"
    imu_accel: tuple[str, ...] = ("ax", "ay", "az")
    imu_gyro: tuple[str, ...] = ("gx", "gy", "gz")
    gyro_file: str = ""
    gyro_time: str = "t"
    imu_increments: bool = False
    imu_instance_column: str = ""
    imu_instance: float = 0.0
    accel_unit: str = "m/s2"
    gyro_unit: str = "rad/s"
    imu_axes: tuple[str, ...] = ("x", "y", "z")
    imu_shift_s: float = 0.0
    static_start_s: float = 0.0
    remove_gyro_bias: bool = False
    position_file: str = ""
    position_time: str = "t"
    position_time_unit: str = ""
    position_quality: tuple[float, ...] = ()
    position_quality_column: str = ""
    position_columns: tuple[str, ...] = ("latitude", "longitude", "height")
    position_frame: str = "geodetic"
    position_sigma: tuple[str, ...] = ()
    position_covariance: tuple[str, ...] = ()
    position_covariance_frame: str = "enu"
    position_sigma_scale: float = 1.0
    position_sigma_m: float = 1.0
    position_shift_s: float = 0.0
    angle_unit: str = "deg"
    height_unit: str = "m"
    origin: tuple[float, ...] = ()
    velocity_file: str = ""
    velocity_time: str = "t"
    velocity_time_unit: str = ""
    velocity_columns: tuple[str, ...] = ("ve", "vn", "vu")
    velocity_frame: str = "enu"
    velocity_unit: str = "m/s"
    velocity_sigma: tuple[str, ...] = ()
    velocity_covariance: tuple[str, ...] = ()
    velocity_sigma_mps: float = 0.1
    velocity_shift_s: float = 0.0
    reference_file: str = ""
    reference_time: str = "t"
    reference_time_unit: str = ""
    reference_quality: tuple[float, ...] = ()
    reference_quality_column: str = ""
    reference_offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    reference_position: tuple[str, ...] = ()
    reference_angle_unit: str = ""
    reference_height_unit: str = ""
    reference_velocity: tuple[str, ...] = ()
    reference_velocity_frame: str = ""
    reference_attitude: tuple[str, ...] = ()
    reference_frame: str = "enu"
    attitude_unit: str = "rad"
    attitude_frame: str = ""
    reference_body: str = "flu"
    reference_shift_s: float = 0.0
    reference_source: str = "a table"
    reference_independent: bool = False
    reference_sigma: tuple[str, ...] = ()
    reference_sigma_m: float = 0.0
    reference_worst_m: float = 0.0
    outage_s: float = 0.0

    def __post_init__(self) -> None:
        require_choices(self, CHOICES)
        require_columns(self, self.velocity_frame)
        require_origin("dataset table", self.origin)
        self._require_one_origin()
        axes_matrix(self.imu_axes)
        require_positive("dataset table", self, ("position_sigma_m", "position_sigma_scale", "velocity_sigma_mps"))
        not_negative = ("static_start_s", "outage_s", "reference_sigma_m", "reference_worst_m")
        require_not_negative("dataset table", self, not_negative)
        if not self.imu_file and not self.position_file:
            raise PluginError("dataset table: imu_file and position_file are both empty; give at least one of them.")

    @property
    def without_imu(self) -> bool:
        """True if the recording has no IMU, so that only filters that do not use IMU samples can run."""
        return not self.imu_file

    def load(self, seed: int = 0) -> Recording:
        """Return the recording in the tables. ``seed`` has no effect.

        Raises:
            RecordingError: a file or a column is missing, a file is damaged, or the streams do not overlap in time.
        """
        solved = {name: self._source(name.partition("_")[0]).solved for name in SOLUTION_SETTINGS}
        changed = {name: value for name, value in SOLUTION_SETTINGS.items() if solved[name]}
        if any(getattr(self, name) != value for name, value in changed.items()):
            return replace(self, **changed).load()
        samples = self._samples()
        first = samples
        if first is None:
            first = self.read(self._source("position")).with_entries(self.position_columns)
        zero_ns = int(first.t_ns[0])
        position, origin, of_fixes = self._fixes(zero_ns)
        reference, origin, of_reference = self._reference(zero_ns, position, origin)
        imu, of_imu = self._imu(samples, zero_ns)
        velocity, of_velocity = self._velocity(zero_ns, origin)
        notes = (*of_imu, *of_fixes, *of_velocity, *of_reference)
        recording = Recording(
            name=named_folder(self.folder).resolve().name,
            imu=imu,
            reference=reference,
            position=position,
            velocity=velocity,
            origin=origin,
            start_utc=self.start_utc(zero_ns),
            static_start_s=self.static_start_s,
            notes=tuple(dict.fromkeys(notes)),
        )
        recording = with_common_time(recording, "check the columns of times and their unit")
        return with_recorded_outages(recording, self.outage_s)

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of all files of the recording."""
        streams = ("imu", "gyro", "position", "velocity", "reference", "time")
        names = (getattr(self, f"{stream}_file") for stream in streams)
        return tuple(path for name in dict.fromkeys(names) if name for path in self.files(name, "folder"))

    def _require_one_origin(self) -> None:
        """Raise a PluginError if ``origin`` is empty and only the fixes or only the reference are in a local frame."""
        reference = self._source("reference")
        if not (self.position_file and self.reference_file and (self.reference_position or reference.solved)):
            return
        solved = self._source("position").solved
        parameter = f"position_file {self.position_file}" if solved else "position_frame"
        frame = "geodetic" if solved else self.position_frame
        of_reference = "geodetic" if reference.solved else self.reference_frame
        if not self.origin and (frame in LOCAL_FRAMES) != (of_reference in LOCAL_FRAMES):
            raise PluginError(
                f"dataset table: {parameter} is {frame} and reference_frame is {of_reference}. One of the two frames is"
                " local, and its position on the Earth is unknown. Give origin (latitude [deg], longitude [deg] and"
                " height [m] of the zero of the local frame), or use two local or two global frames."
            )

    def _source(self, stream: str) -> Source:
        """Return the file and its columns of time and quality for ``stream`` (position, velocity or reference)."""
        file, time, shift_s, unit = (
            getattr(self, f"{stream}_{name}") for name in ("file", "time", "shift_s", "time_unit")
        )
        qualities = self.reference_quality if stream == "reference" else self.position_quality
        if file.endswith(SOLUTION):
            return Source(stream, file, "t", shift_s, "", qualities, POS_QUALITY)
        return Source(stream, file, time, shift_s, unit, qualities, getattr(self, f"{stream}_quality_column", ""))

    def _samples(self) -> Columns | None:
        """Return the rows of the IMU, or None for a recording without an IMU."""
        if not self.imu_file:
            return None
        source = Source("imu", self.imu_file, self.imu_time, self.imu_shift_s)
        stream = self.read(source._replace(qualities=(self.imu_instance,), quality=self.imu_instance_column))
        return stream.with_entries(self.imu_accel if self.gyro_file else (*self.imu_accel, *self.imu_gyro))

    def _rates(self, samples: Columns) -> FloatArray:
        """Return angular rates (n, 3) at the stamps of the samples, with NaN outside the times of a gyro file."""
        if not self.gyro_file:
            return samples.numbers(self.imu_gyro)
        gyro = self.read(Source("gyro", self.gyro_file, self.gyro_time, self.imu_shift_s)).with_entries(self.imu_gyro)
        t_ns = gyro.t_ns - samples.t_ns[0]
        at_ns, rates = samples.t_ns - samples.t_ns[0], gyro.numbers(self.imu_gyro)
        return np.column_stack([np.interp(at_ns, t_ns, rate, left=np.nan, right=np.nan) for rate in rates.T])

    def _imu(self, samples: Columns | None, zero_ns: int) -> tuple[Imu | None, tuple[str, ...]]:
        """Return the IMU samples in body axes (or None without an IMU), and notes about the samples."""
        if samples is None:
            return None, (NO_IMU,)
        units, turn = (self.accel_unit, self.gyro_unit), axes_matrix(self.imu_axes)
        t_s, accel, gyro = samples.t_s(zero_ns), samples.numbers(self.imu_accel), self._rates(samples)
        if self.imu_increments:
            steps_s = np.diff(t_s)
            interval_s = np.concatenate([[np.median(steps_s)], steps_s])[:, None]
            accel, gyro = accel / interval_s, gyro / interval_s
        imu, notes = imu_in_body(samples.where, t_s, accel, gyro, units, turn)
        imu = calibrated_at_rest(imu, self.static_start_s, gyro=self.remove_gyro_bias, accel=False)
        return imu, (*samples.notes, *notes)

    def _fixes(self, zero_ns: int) -> tuple[Position | None, Origin | None, tuple[str, ...]]:
        """Return the fixes, the origin (``origin``, or the first complete fix that does not leap), and notes."""
        source, origin = self._source("position"), Origin(*self.origin) if self.origin else None
        if not source.file:
            return None, origin, ()
        stream, places = self._placed(source, self.position_columns, self.position_frame)
        origin = origin or origin_of(places, self.position_frame)
        named = self.position_sigma, self.position_covariance, self.position_covariance_frame, self.position_sigma_m
        covariance, notes = covariances_of(stream, *named, origin, self.position_sigma_scale)
        position = Position(stream.t_s(zero_ns), in_enu(places, self.position_frame, origin), covariance)
        return position, origin, (*stream.notes, *notes)

    def _velocity(self, zero_ns: int, origin: Origin | None) -> tuple[Velocity | None, tuple[str, ...]]:
        """Return the velocities (or None for a recording without velocities), and notes about the velocities."""
        source, frame = self._source("velocity"), self.velocity_frame
        if not source.file:
            return None, ()
        stream = self.read(source)
        if source.solved and not stream.has(self.velocity_columns):
            raise RecordingError(
                f"dataset table: {source.file} has no velocities; let RTKLIB write velocities (out-outvel=on), or leave"
                " velocity_file empty."
            )
        stream = stream.with_entries(self.velocity_columns)
        unit = "m/s" if source.solved else self.velocity_unit
        values = SPEED_UNITS[unit] * stream.numbers(self.velocity_columns)
        faults = {HELD: held_rows(values), f"a velocity beyond {MAX_MPS:g} m/s": impossible_speeds(values)}
        good = ~np.logical_or.reduce(list(faults.values()))
        stream, values = stream.only(good, drop_notes(stream.name, faults)), values[good]
        axes = frame if frame in COVARIANCE_FRAMES else "enu"
        named = self.velocity_sigma, self.velocity_covariance, axes, self.velocity_sigma_mps
        covariance, notes = covariances_of(stream, *named, origin)
        if frame == "speed":
            values = np.column_stack([values, np.full((len(values), 2), np.nan)])
        elif frame == "ecef":
            if origin is None:
                raise RecordingError(
                    f"{stream.where} has velocities in ECEF, but the origin of ENU on the Earth is unknown; give"
                    " origin."
                )
            values = values @ enu_axes(origin).T
        mps = axes_in_enu(values, frame)
        velocity = Velocity(stream.t_s(zero_ns), mps, covariance, RECORDED_FRAMES.get(frame, "enu"))
        return velocity, (*stream.notes, *notes)

    def _reference(
        self, zero_ns: int, p: Position | None, origin: Origin | None
    ) -> tuple[Reference, Origin | None, tuple[str, ...]]:
        """Return the reference (the fixes if there is no file), the origin of ENU, and notes."""
        source = self._source("reference")
        if not source.file:
            if p is None:
                return Reference(np.array([0.0]), source="none", independent=False), origin, ()
            return Reference(p.t_s, THE_FIXES, independent=False, enu_m=p.enu_m), origin, ()
        stream, frame, places = self.read(source), self.reference_frame, None
        moving = self.reference_velocity if not source.solved or stream.has(self.reference_velocity) else ()
        if named := (*self.reference_position, *moving, *self.reference_attitude):
            stream = stream.with_entries(named)
        if self.reference_position:
            stream, places = self._placed(source, self.reference_position, frame, stream)
            origin = origin or origin_of(places, frame)
        mps = axes_in_enu(stream.numbers(moving), self.reference_velocity_frame or frame) if moving else None
        local, body = self.attitude_frame or frame, self.reference_body
        angles = self.reference_attitude, self.attitude_unit, local, body, self.imu_axes
        reference = Reference(
            stream.t_s(zero_ns),
            self.reference_source,
            self.reference_independent,
            enu_m=None if places is None else in_enu(places, frame, origin) + self.reference_offset_m,
            velocity_mps=mps,
            euler_rad=read_attitude(stream, *angles),
        )
        sigma_m = self._reference_sigma(stream)
        reference, of_sigma = with_sigma(reference, sigma_m, self.reference_worst_m)
        return reference, origin, (*stream.notes, *of_sigma)

    def _placed(
        self, source: Source, names: tuple[str, ...], frame: str, stream: Columns | None = None
    ) -> tuple[Columns, FloatArray]:
        """Return the rows with a position on the Earth that does not leap, and their positions (angles in degrees)."""
        stream = self.read(source).with_entries(names) if stream is None else stream
        units = ("deg", "m") if source.solved else (self.angle_unit, self.height_unit)
        if source.name == "reference" and not source.solved:
            units = self.reference_angle_unit or units[0], self.reference_height_unit or units[1]
        places = in_degrees(stream.numbers(names), frame, *units)
        rows, notes = possible_rows(stream.name, places=places, frame=frame)
        stream, places = stream.only(rows, notes), places[rows]
        if source.name == "reference" and not source.solved:
            return stream, places
        held = held_rows(places)
        stream, places = stream.only(~held, drop_notes(stream.name, {HELD: held})), places[~held]
        if self.drop_leaps:
            steady, notes = steady_rows(stream.name, stream.t_s(int(stream.t_ns[0])), places, frame)
            stream, places = stream.only(steady, notes), places[steady]
        return stream, places

    def _reference_sigma(self, columns: Columns) -> FloatArray | None:
        """Return the standard deviations (n, 3) of the reference positions, or None if they are unknown."""
        if self.reference_sigma:
            return np.asarray(np.broadcast_to(columns.numbers(self.reference_sigma), (len(columns), 3)))
        return np.full((len(columns), 3), self.reference_sigma_m) if self.reference_sigma_m else None
