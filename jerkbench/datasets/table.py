"""Any recording in tables: CSV, text, Parquet or MATLAB, with a map from columns to fields.

The plugin: its parameters, and `load`, a stream at a time. Each stream is read from columns or, where its file ends in
.pos, from RTKLIB's solution.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, require_choices, require_not_negative, require_positive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import enu_axes
from jerkbench.io.clocks import with_common_time, with_own_outages
from jerkbench.io.columns import SOLUTION, Columns
from jerkbench.io.files import FromFiles, named_folder
from jerkbench.io.frames import (
    LOCAL_FRAMES,
    SPEED_UNITS,
    axes_in_enu,
    axes_matrix,
    axes_to_judge,
    calibrated_at_rest,
    gravity_notes,
    imu_in_body,
    in_degrees,
    in_enu,
    origin_of,
)
from jerkbench.io.rtklib import POS_QUALITY
from jerkbench.io.sanitiser import (
    HELD,
    MAX_MPS,
    drop_notes,
    held_rows,
    impossible_speeds,
    possible_imu,
    possible_rows,
    repeat_notes,
    require_origin,
    steady_rows,
)
from jerkbench.io.table import (
    CHOICES,
    COVARIANCE_FRAMES,
    SOLUTION_SETTINGS,
    AttitudeMap,
    CovarianceMap,
    Source,
    TableStream,
    TimedColumns,
    covariances_of,
    read_attitude,
    require_columns,
    with_sigma,
)
from jerkbench.plugins import register
from jerkbench.recording import Imu, Origin, Position, Recording, Reference, Velocity

NO_IMU = "There is no IMU: attitude, tilt and yaw do not apply."

KEPT_FRAMES: dict[str, Literal["body", "speed"]] = {"body": "body", "speed": "speed"}
"""Frames of velocities that a recording has too; all others are turned into ENU."""


class Fixes(NamedTuple):
    """What a table says about where it was.

    Attributes:
        position: the fixes that do not leap, or None.
        origin: of their ENU; None where nothing is known of it.
        notes: what was dropped, in sentences.
    """

    position: Position | None
    origin: Origin | None
    notes: tuple[str, ...] = ()


@register("dataset", "table")
@dataclass(frozen=True)
class Tables(FromFiles, TimedColumns):
    """Any recording in tables (CSV, text, Parquet, .mat), with a map from columns to fields.

    A column is a name of the header or a number from 1. A file is a name, or a pattern (``data/*.txt``): all files
    that fit, one after the other, by their names. Time 0 is the first IMU sample, without an IMU the first fix; a
    stream's shift is added to its stamps, so that a value that is .1 s old needs -0.1. An empty cell of a position or
    velocity is an axis that was not measured; a row in which all columns of a stream are empty is none of it, so that
    one file may hold several streams. A file of positions, velocities or the reference that ends in .pos is RTKLIB's:
    it needs no columns, and has its own covariances.

    Rows with a place that is not on Earth, or with a date that is not between 1980 and 2100, are dropped and counted.
    If all stamps are before 1980, they are taken as times since an unknown start. Fixes that leap are dropped
    (``drop_leaps``). A latitude and longitude without a height are a fix of the plane, at a height between those before
    and after.

    In a .mat (version 5 to 7.3) the columns of a matrix ``acc`` are acc_1, acc_2, acc_3, and a field ``t`` of a
    structure ``imu`` is imu.t; variables may be of different lengths. A first and a last row that were cut off are
    dropped.

    Body: FLU, from the sensor's axes by ``imu_axes``. Frames of places: enu, ned (local), geodetic, ecef; the first
    complete fix that does not leap (without fixes, the first place of the reference) is the origin of ENU, unless
    ``origin`` is given. Local places stay as they are, their zero is the origin: where of fixes and reference one is
    local and the other is not, ``origin`` says where that zero is, and without it they are refused. What is not given
    is not there: without a position file, only the filter attitude_only runs, and without an IMU only filters that
    take no acceleration (constant_velocity, acceleration, gnss_only), from fix to fix.

    Presets: kitti, euroc, tum, nclt, urbannav, ppc; of fixes alone: tokyo_1105, hamburg, pixel4, taroz, ppc_fixes,
    uwb_outdoor.

    Attributes:
        imu_file: the file of the IMU; empty: there is none.
        imu_time: its column of times.
        imu_accel: columns of the specific force x, y, z.
        imu_gyro: columns of the angular rate x, y, z.
        gyro_file: the file of the gyro, if it is not that of the accelerometer; its rates are interpolated to the
            accelerometer's stamps.
        gyro_time: its column of times.
        imu_increments: whether the columns are increments over the interval that ends at each stamp (of velocity and
            angle), as KF-GINS and some INS write them.
        imu_instance_column: column with the number of the sensor, if rows of several sensors are mixed.
        imu_instance: the number of the sensor whose rows are used.
        accel_unit: g or m/s2.
        gyro_unit: deg/s or rad/s.
        imu_axes: what the body's x (forward), y (left), z (up) are on the sensor: x, -x, y, -y, z or -z each.
        imu_shift_s: added to its stamps.
        static_start_s: how long it stands still at the start; 0: it moves.
        remove_gyro_bias: subtract the gyro's mean over that time.
        position_file: the file of the fixes; empty: there are none.
        position_time: its column of times.
        position_time_unit: s, ms, us or ns; empty: time_unit.
        position_quality: of a .pos, of velocities too, the values of Q that are used (1 fixed, 2 float, 4 differential,
            5 single), or of ``position_quality_column``; empty: all.
        position_quality_column: column of the kind of each fix, of which position_quality names those that are used.
        position_columns: the three columns of a place, in the order of its frame (latitude, longitude, height).
        position_frame: enu, ned, geodetic or ecef.
        position_sigma: columns of standard deviations [m]: one for all axes, three, or RTKLIB's six (11, 22, 33, 12,
            23, 31: roots with the covariances' signs); none: position_covariance.
        position_covariance: columns of variances and covariances [m2]: one for all axes, three, six (11, 22, 33, 12,
            13, 23), or nine, row by row; none: position_sigma_m.
        position_covariance_frame: of both: enu, ned or ecef.
        position_sigma_scale: what position_sigma is multiplied with: where it names a DOP, one sigma of a range [m].
        position_sigma_m: one standard deviation of an axis, where there are no columns of it.
        position_shift_s: added to its stamps.
        angle_unit: of latitude and longitude: deg, rad, 1e-7 deg (integers of receivers) or ddmm (degrees and minutes
            as in NMEA, ddmm.mmmm).
        height_unit: of the height of a latitude and longitude: m, cm, mm or ft.
        origin: latitude [deg], longitude [deg] and height [m] of ENU, and of the zero of local frames; empty: as above.
        velocity_file: the file of the velocities; empty: there are none.
        velocity_time: its column of times.
        velocity_time_unit: as position_time_unit.
        velocity_columns: three columns, one for a speed.
        velocity_frame: enu, ned, ecef, body (FLU) or speed.
        velocity_unit: of the velocities: m/s, km/h, knots, cm/s or mm/s.
        velocity_sigma: as position_sigma [m/s], in velocity_frame.
        velocity_covariance: as position_covariance [m2/s2], in velocity_frame.
        velocity_sigma_mps: one standard deviation of an axis, where there are no columns of it.
        velocity_shift_s: added to its stamps.
        reference_file: the file of the reference; empty: the fixes themselves.
        reference_time: its column of times.
        reference_time_unit: as position_time_unit.
        reference_quality: of a .pos, or of ``reference_quality_column``, the values with which it knows the truth;
            empty: all.
        reference_quality_column: as position_quality_column.
        reference_offset_m: added to its places: east, north, up; of another antenna or another base.
        reference_position: three columns, or none.
        reference_velocity: three columns, or none; in ENU, or NED with that frame.
        reference_attitude: three columns (roll, pitch, yaw) or four (w, x, y, z), body to local frame, or none.
        reference_frame: enu, ned, geodetic or ecef.
        attitude_unit: of roll, pitch and yaw: rad or deg.
        attitude_frame: local frame of the attitude: enu, or ned (yaw from north, clockwise); empty: as reference_frame.
        reference_body: whose attitude it is: flu, frd or sensor (the IMU's own axes).
        reference_shift_s: added to its stamps.
        reference_source: one phrase: where the reference comes from.
        reference_independent: whether it shares nothing with the measurements.
        reference_sigma: columns of one standard deviation of its place [m]: one for all axes, or east, north, up.
        reference_sigma_m: the same as a number, where there are no columns; 0: not known.
        reference_worst_m: where its sigma (root of the sum of the axes' variances) is larger, errors do not count; 0:
            they count everywhere.
        outage_s: a gap between fixes that is longer is an outage, which the outage metrics score against the reference;
            0: none is.
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
    reference_velocity: tuple[str, ...] = ()
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
        """Check every choice, every number of columns, and every sigma."""
        require_choices(self, CHOICES)
        require_columns(self, self.velocity_frame)
        require_origin("dataset table", self.origin)
        self._require_one_origin()
        axes_matrix(self.imu_axes)
        require_positive("dataset table", self, ("position_sigma_m", "position_sigma_scale", "velocity_sigma_mps"))
        not_negative = ("static_start_s", "outage_s", "reference_sigma_m", "reference_worst_m")
        require_not_negative("dataset table", self, not_negative)
        if not self.imu_file and not self.position_file:
            raise PluginError("dataset table: imu_file and position_file are both empty; name one of them.")

    @property
    def without_imu(self) -> bool:
        """Whether there is no IMU, so that only filters that take no acceleration run."""
        return not self.imu_file

    def load(self, seed: int = 0) -> Recording:
        """Return the recording; ``seed`` changes nothing.

        Raises:
            RecordingError: a file is missing or damaged, a column is not there, or what is in it makes no recording.
        """
        solved = [stream for stream in SOLUTION_SETTINGS if self._source(stream).solved]
        changed = {name: value for stream in solved for name, value in SOLUTION_SETTINGS[stream].items()}
        if any(getattr(self, name) != value for name, value in changed.items()):
            return replace(self, **changed).load()
        samples = self._samples()
        zero_ns = self._first_ns(samples)
        fixes = self._fixes(zero_ns)
        reference, origin, of_reference = self._reference(zero_ns, fixes)
        imu, of_imu = self._imu(samples, zero_ns)
        velocity, of_velocity = self._velocity(zero_ns, origin)
        notes = (*of_imu, *fixes.notes, *of_velocity, *of_reference)
        recording = Recording(
            name=named_folder(self.folder).resolve().name,
            imu=imu,
            reference=reference,
            position=fixes.position,
            velocity=velocity,
            origin=origin,
            start_utc=self.start_utc(zero_ns),
            static_start_s=self.static_start_s,
            notes=tuple(dict.fromkeys(notes)),
        )
        recording = with_common_time(recording, "check the columns of times and their unit")
        return with_own_outages(recording, self.outage_s)

    def paths(self) -> tuple[Path, ...]:
        """Return the files that are read."""
        names = (
            self.imu_file,
            self.gyro_file,
            self.position_file,
            self.velocity_file,
            self.reference_file,
            self.time_file,
        )
        return tuple(path for name in dict.fromkeys(names) if name for path in self.files(name, "folder"))

    def _require_one_origin(self) -> None:
        """Raise a PluginError where fixes and reference are about two origins: one is local, the other is not."""
        reference = self._source("reference")
        if not (self.position_file and self.reference_file and (self.reference_position or reference.solved)):
            return
        solved = self._source("position").solved
        parameter = f"position_file {self.position_file}" if solved else "position_frame"
        frame = "geodetic" if solved else self.position_frame
        of_reference = "geodetic" if reference.solved else self.reference_frame
        if not self.origin and (frame in LOCAL_FRAMES) != (of_reference in LOCAL_FRAMES):
            raise PluginError(
                f"dataset table: {parameter} is {frame} and reference_frame {of_reference}: one is local, and where"
                " its zero is on the Earth is not known; give origin (latitude [deg], longitude [deg], height [m] of"
                " that zero), or fixes and reference of one kind."
            )

    def _source(self, stream: str) -> Source:
        """Return where position, velocity or reference stand."""
        file, time, shift_s, unit = (
            getattr(self, f"{stream}_{name}") for name in ("file", "time", "shift_s", "time_unit")
        )
        qualities = self.reference_quality if stream == "reference" else self.position_quality
        if file.endswith(SOLUTION):
            return Source(stream, file, "t", shift_s, "", qualities, POS_QUALITY)
        return Source(stream, file, time, shift_s, unit, qualities, getattr(self, f"{stream}_quality_column", ""))

    def _samples(self) -> TableStream | None:
        """Return the rows of the IMU; None where there is none."""
        if not self.imu_file:
            return None
        source = Source("imu", self.imu_file, self.imu_time, self.imu_shift_s)
        stream = self.read(source._replace(qualities=(self.imu_instance,), quality=self.imu_instance_column))
        return stream.only(self.imu_accel if self.gyro_file else (*self.imu_accel, *self.imu_gyro))

    def _rates(self, samples: TableStream) -> FloatArray:
        """Return (n, 3) the angular rates at the stamps of the samples; NaN outside the times of a gyro's own file."""
        if not self.gyro_file:
            return samples.columns.numbers(self.imu_gyro)
        gyro = self.read(Source("gyro", self.gyro_file, self.gyro_time, self.imu_shift_s)).only(self.imu_gyro)
        t_ns = gyro.t_ns - samples.t_ns[0]
        at_ns, rates = samples.t_ns - samples.t_ns[0], gyro.columns.numbers(self.imu_gyro)
        return np.column_stack([np.interp(at_ns, t_ns, rate, left=np.nan, right=np.nan) for rate in rates.T])

    def _first_ns(self, samples: TableStream | None) -> int:
        """Return time 0: that of the first sample, or, without an IMU, of the first fix."""
        if samples is None:
            samples = self.read(self._source("position")).only(self.position_columns)
        return int(samples.t_ns[0]) if len(samples.t_ns) else 0

    def _imu(self, samples: TableStream | None, zero_ns: int) -> tuple[Imu | None, tuple[str, ...]]:
        """Return the samples in the body, None where there are none, and what a reader has to know of them."""
        if samples is None:
            return None, (NO_IMU,)
        columns = samples.columns
        units, turn = (self.accel_unit, self.gyro_unit), axes_matrix(self.imu_axes)
        t_s, accel, gyro = samples.t_s(zero_ns), columns.numbers(self.imu_accel), self._rates(samples)
        if self.imu_increments:
            steps_s = np.diff(t_s)
            interval_s = np.concatenate([[np.median(steps_s)], steps_s])[:, None]
            accel, gyro = accel / interval_s, gyro / interval_s
        both = np.isfinite(gyro).all(axis=1) if self.gyro_file else np.ones(len(t_s), dtype=np.bool_)
        imu = imu_in_body(t_s[both], accel[both], gyro[both], units, turn)
        imu = calibrated_at_rest(imu, self.static_start_s, gyro=self.remove_gyro_bias, accel=False)
        imu, impossible = possible_imu(columns.where, imu)
        return imu, (*gravity_notes(imu.accel_mps2, "imu_axes"), *repeat_notes(imu), *columns.notes, *impossible)

    def _fixes(self, zero_ns: int) -> Fixes:
        """Return the fixes about the origin; without one, about the first complete one that does not leap."""
        source, origin = self._source("position"), Origin(*self.origin) if self.origin else None
        if not source.file:
            return Fixes(None, origin)
        stream, places = self._placed(source, self.position_columns, self.position_frame)
        origin = origin or origin_of(places, self.position_frame)
        named = self.position_sigma, self.position_covariance, self.position_covariance_frame
        mapping = CovarianceMap(*named, self.position_sigma_m, self.position_sigma_scale)
        covariance, rounded = covariances_of(stream.columns, mapping, origin)
        position = Position(stream.t_s(zero_ns), in_enu(places, self.position_frame, origin), covariance)
        return Fixes(position, origin, (*stream.columns.notes, *rounded))

    def _velocity(self, zero_ns: int, origin: Origin | None) -> tuple[Velocity | None, tuple[str, ...]]:
        """Return the velocities, None where there are none, and what was dropped."""
        source, frame = self._source("velocity"), self.velocity_frame
        if not source.file:
            return None, ()
        stream = self.read(source)
        if source.solved and not stream.columns.has(self.velocity_columns):
            raise RecordingError(
                f"dataset table: {source.file} has no velocities; let RTKLIB write them (out-outvel=on), or leave"
                f" {source.parameter} empty."
            )
        stream = stream.only(self.velocity_columns)
        unit = "m/s" if source.solved else self.velocity_unit
        values = SPEED_UNITS[unit] * stream.columns.numbers(self.velocity_columns)
        faults = {HELD: held_rows(values), f"a velocity beyond {MAX_MPS:g} m/s": impossible_speeds(values)}
        good = ~np.logical_or.reduce(list(faults.values()))
        stream, values = stream.at(good, drop_notes(stream.name, faults)), values[good]
        columns = stream.columns
        axes = frame if frame in COVARIANCE_FRAMES else "enu"
        mapping = CovarianceMap(self.velocity_sigma, self.velocity_covariance, axes, self.velocity_sigma_mps)
        covariance, notes = covariances_of(columns, mapping, origin)
        if frame == "speed":
            values = np.column_stack([values, np.full((len(values), 2), np.nan)])
        elif frame == "ecef":
            if origin is None:
                raise RecordingError(
                    f"{columns.where} has velocities in ECEF, and where it is on the Earth is not known; give origin."
                )
            values = values @ enu_axes(origin).T
        mps = axes_in_enu(values, frame)
        velocity = Velocity(stream.t_s(zero_ns), mps, covariance, KEPT_FRAMES.get(frame, "enu"))
        return velocity, (*columns.notes, *notes)

    def _reference(self, zero_ns: int, fixes: Fixes) -> tuple[Reference, Origin | None, tuple[str, ...]]:
        """Return the reference, the origin of ENU, and what was dropped; without a file the fixes are their own."""
        source, origin = self._source("reference"), fixes.origin
        if not source.file:
            p = fixes.position
            if p is None:
                return Reference(np.array([0.0]), source="none", independent=False), origin, ()
            return Reference(p.t_s, "the fixes themselves", independent=False, enu_m=p.enu_m), origin, ()
        stream, frame, places = self.read(source), self.reference_frame, None
        moving = self.reference_velocity if not source.solved or stream.columns.has(self.reference_velocity) else ()
        if named := (*self.reference_position, *moving, *self.reference_attitude):
            stream = stream.only(named)
        if self.reference_position:
            stream, places = self._placed(source, self.reference_position, frame, stream)
            origin = origin or origin_of(places, frame)
        columns = stream.columns
        local, body = self.attitude_frame or frame, self.reference_body
        attitude = AttitudeMap(self.reference_attitude, self.attitude_unit, local, body, self.imu_axes)
        reference = Reference(
            stream.t_s(zero_ns),
            self.reference_source,
            self.reference_independent,
            enu_m=None if places is None else in_enu(places, frame, origin) + self.reference_offset_m,
            velocity_mps=axes_in_enu(columns.numbers(moving), frame) if moving else None,
            euler_rad=read_attitude(columns, attitude),
        )
        sigma_m = self._reference_sigma(columns, len(columns))
        reference, of_sigma = with_sigma(reference, sigma_m, self.reference_worst_m)
        return reference, origin, (*columns.notes, *of_sigma)

    def _placed(
        self, source: Source, names: tuple[str, ...], frame: str, stream: TableStream | None = None
    ) -> tuple[TableStream, FloatArray]:
        """Return the rows on the Earth that do not leap, and their places, angles in degrees."""
        stream = self.read(source).only(names) if stream is None else stream
        units = ("deg", "m") if source.solved else (self.angle_unit, self.height_unit)
        places = in_degrees(stream.columns.numbers(names), frame, *units)
        rows, notes = possible_rows(stream.name, places=places, frame=frame)
        stream, places = stream.at(rows, notes), places[rows]
        if source.name == "reference" and not source.solved:
            return stream, places
        held = held_rows(places)
        stream, places = stream.at(~held, drop_notes(stream.name, {HELD: held})), places[~held]
        if self.drop_leaps:
            steady, notes = steady_rows(stream.t_s(int(stream.t_ns[0])), axes_to_judge(places, frame))
            stream, places = stream.at(steady, notes), places[steady]
        return stream, places

    def _reference_sigma(self, columns: Columns | None, rows: int) -> FloatArray | None:
        """Return (rows, 3) one standard deviation of the reference's places; None where nobody says it."""
        if self.reference_sigma and columns is not None:
            return np.asarray(np.broadcast_to(columns.numbers(self.reference_sigma), (rows, 3)))
        return np.full((rows, 3), self.reference_sigma_m) if self.reference_sigma_m else None
