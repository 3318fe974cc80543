"""Any recording in tables: CSV, text or Parquet, with a map from columns to fields."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.datasets._table_parts import (
    Clock,
    Stream,
    attitude_in_flu,
    covariances,
    fixes_as_reference,
    velocity_of,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import register
from jerkbench.readers.columns import TIME_UNITS, Columns, TextFormat
from jerkbench.readers.files import fingerprint
from jerkbench.readers.frames import ANGLE_UNITS, FRAMES, axes_in_enu, enu_from, in_degrees, in_enu, origin_of
from jerkbench.readers.gpst import GPS_EPOCH_NS, GPST_MINUS_UTC_S, utc_of
from jerkbench.readers.gravity import gravity_notes
from jerkbench.readers.mounting import ACCEL_UNITS, GYRO_UNITS, axes_matrix, imu_in_body
from jerkbench.readers.overlap import with_common_time
from jerkbench.readers.rest import without_gyro_bias
from jerkbench.readers.rtklib_pos import PosSolution, read_rtklib_pos
from jerkbench.recording import Imu, Origin, Position, Recording, Reference, Velocity
from jerkbench.sanitiser.fixes import leap_notes, leaping_rows
from jerkbench.sanitiser.values import possible_imu
from jerkbench.simulation.checks import require_choices, require_not_negative, require_positive

VELOCITY_FRAMES = ("enu", "ned", "body", "speed")
ATTITUDE_BODIES = ("flu", "frd", "sensor")
UNIX = datetime(1970, 1, 1, tzinfo=UTC)
EPOCHS = ("gps", "none", "unix")
SOLUTION = ".pos"
"""Ending of RTKLIB's solutions, which say themselves what their columns are."""


@dataclass(frozen=True)
class TimedColumns:
    """What all streams of a table share: the folder, how text is cut, and the time.

    Attributes:
        folder: where the files are.
        separator: between the columns of a text; empty: white space. Parquet needs none.
        header: whether the first line names the columns; if not, they are numbered from 1.
        comment: what a line to be left out begins with.
        time_unit: of every column of times: s, ms, us or ns.
        time_week: the column of GPS weeks, in every file, where the times are those of the week; empty: they are not.
        time_file: a file of UTC dates and times, one a row, for a stream whose column of times is empty.
        epoch: what the times count from: unix (1970, UTC), gps (1980, GPS time), or none (unknown).
        gpst_minus_utc_s: leap seconds; 18 since 2017.
    """

    folder: str
    separator: str = ","
    header: bool = True
    comment: str = ""
    time_unit: str = "s"
    time_week: str = ""
    time_file: str = ""
    epoch: str = "unix"
    gpst_minus_utc_s: float = GPST_MINUS_UTC_S


@register("dataset", "table")
@dataclass(frozen=True)
class Tables(TimedColumns):
    """Any recording in tables (CSV, text, Parquet), with a map from columns to fields.

    A column is a name of the header or a number from 1. A file is a name, or a pattern (``data/*.txt``): all files
    that fit, one after the other. Time 0 is the first IMU sample; a stream's shift is added to its stamps, so that a
    value that is .1 s old needs -0.1. An empty cell of a position or velocity is an axis that was not measured; a row
    in which all columns of a stream are empty is none of it, so that one file may hold several streams. A file of
    positions or velocities that ends in .pos is RTKLIB's: it needs no columns, and has its own covariances.

    Body: FLU, from the sensor's axes by ``imu_axes``. Frames of places: enu, ned (local), geodetic, ecef; the first
    fix (without fixes, the first place of the reference) is the origin of ENU. What is not given is not there: without
    a position file, only the filter attitude_only runs.

    Presets: kitti, euroc, tum, nclt, urbannav.

    Attributes:
        imu_file: the file of the IMU.
        imu_time: its column of times.
        imu_accel: columns of the specific force x, y, z.
        imu_gyro: columns of the angular rate x, y, z.
        accel_unit: g or m/s2.
        gyro_unit: deg/s or rad/s.
        imu_axes: what the body's x (forward), y (left), z (up) are on the sensor: x, -x, y, -y, z or -z each.
        imu_shift_s: added to its stamps.
        static_start_s: how long it stands still at the start; 0: it moves.
        remove_gyro_bias: subtract the gyro's mean over that time.
        position_file: the file of the fixes; empty: there are none.
        position_time: its column of times.
        position_columns: the three columns of a place, in the order of its frame (latitude, longitude, height).
        position_frame: enu, ned, geodetic or ecef.
        position_sigma: three columns of standard deviations, or one for all axes [m], in ENU; none: position_sigma_m.
        position_sigma_m: one standard deviation of an axis, where there are no columns of it.
        position_shift_s: added to its stamps.
        angle_unit: of latitude and longitude: deg or rad.
        velocity_file: the file of the velocities; empty: there are none.
        velocity_time: its column of times.
        velocity_columns: three columns, one for a speed.
        velocity_frame: enu, ned, body (FLU) or speed.
        velocity_sigma_mps: one standard deviation of an axis.
        velocity_shift_s: added to its stamps.
        reference_file: the file of the reference; empty: the fixes themselves.
        reference_time: its column of times.
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
    """

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"

    imu_file: str = "imu.csv"
    imu_time: str = "t"
    imu_accel: tuple[str, ...] = ("ax", "ay", "az")
    imu_gyro: tuple[str, ...] = ("gx", "gy", "gz")
    accel_unit: str = "m/s2"
    gyro_unit: str = "rad/s"
    imu_axes: tuple[str, ...] = ("x", "y", "z")
    imu_shift_s: float = 0.0
    static_start_s: float = 0.0
    remove_gyro_bias: bool = False
    position_file: str = ""
    position_time: str = "t"
    position_columns: tuple[str, ...] = ("latitude", "longitude", "height")
    position_frame: str = "geodetic"
    position_sigma: tuple[str, ...] = ()
    position_sigma_m: float = 1.0
    position_shift_s: float = 0.0
    angle_unit: str = "deg"
    velocity_file: str = ""
    velocity_time: str = "t"
    velocity_columns: tuple[str, ...] = ("ve", "vn", "vu")
    velocity_frame: str = "enu"
    velocity_sigma_mps: float = 0.1
    velocity_shift_s: float = 0.0
    reference_file: str = ""
    reference_time: str = "t"
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

    def __post_init__(self) -> None:
        """Check every choice, every number of columns, and every sigma."""
        self._check_choices()
        self._check_columns()
        axes_matrix(self.imu_axes)
        require_positive("dataset table", self, ("position_sigma_m", "velocity_sigma_mps"))
        require_not_negative("dataset table", self, ("static_start_s",))

    def load(self, seed: int = 0) -> Recording:
        """Return the recording; ``seed`` changes nothing.

        Raises:
            RecordingError: a file is missing or damaged, a column is not there, or what is in it makes no recording.
        """
        imu = self._stream("imu", self.imu_file, self.imu_time, self.imu_shift_s)
        imu = imu.only((*self.imu_accel, *self.imu_gyro))
        zero_ns = int(imu.t_ns[0]) if len(imu.t_ns) else 0
        position, origin = self._position(zero_ns)
        leaps: tuple[str, ...] = ()
        if position is not None:
            wrong = leaping_rows(position.t_s, np.nan_to_num(position.enu_m))  # an axis that is not there leaps nowhere
            position = Position(position.t_s[~wrong], position.enu_m[~wrong], position.covariance_m2[~wrong])
            leaps = leap_notes(wrong)
        reference, origin = self._reference(zero_ns, origin, position)
        samples = possible_imu(imu.columns.where, self._imu(imu, zero_ns))
        recording = Recording(
            name=Path(self.folder).expanduser().resolve().name,
            imu=samples,
            reference=reference,
            position=position,
            velocity=self._velocity(zero_ns),
            origin=origin,
            start_utc=self._start_utc(zero_ns),
            static_start_s=self.static_start_s,
            notes=(*gravity_notes(samples.accel_mps2, "imu_axes"), *leaps),
        )
        return with_common_time(recording, "check the columns of times and their unit")

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the files."""
        names = (self.imu_file, self.position_file, self.velocity_file, self.reference_file, self.time_file)
        found = [path for name in dict.fromkeys(names) if name for path in Stream.files(self.folder, name, "folder")]
        return fingerprint(tuple(found))

    def _check_choices(self) -> None:
        choices = {
            "accel_unit": tuple(ACCEL_UNITS),
            "gyro_unit": tuple(GYRO_UNITS),
            "time_unit": tuple(TIME_UNITS),
            "angle_unit": tuple(ANGLE_UNITS),
            "epoch": EPOCHS,
            "attitude_unit": tuple(ANGLE_UNITS),
            "attitude_frame": ("", "enu", "ned"),
            "position_frame": FRAMES,
            "reference_frame": FRAMES,
            "velocity_frame": VELOCITY_FRAMES,
            "reference_body": ATTITUDE_BODIES,
        }
        require_choices(self, choices)

    def _check_columns(self) -> None:
        wanted = {
            "imu_accel": (3,),
            "imu_gyro": (3,),
            "position_columns": (3,),
            "position_sigma": (0, 1, 3),
            "velocity_columns": (1,) if self.velocity_frame == "speed" else (3,),
            "reference_position": (0, 3),
            "reference_velocity": (0, 3),
            "reference_attitude": (0, 3, 4),
        }
        for name, counts in wanted.items():
            given = getattr(self, name)
            if len(given) not in counts:
                said = " or ".join(map(str, counts))
                raise PluginError(f"dataset table: {name} names {len(given)} columns, {given}; it must name {said}.")

    def _stream(self, name: str, file: str, time: str, shift_s: float) -> Stream:
        text = TextFormat(self.separator, self.header, self.comment)
        clock = Clock(self.time_unit, self.time_week, self.time_file)
        return Stream.read(self.folder, (name, file), text, time, clock, shift_s)

    def _solution(self, name: str, file: str, zero_ns: int, shift_s: float) -> tuple[FloatArray, PosSolution]:
        """RTKLIB's solution, with its times since ``zero_ns`` of the tables' clock."""
        if self.epoch == "none":
            raise PluginError(f"dataset table: {name}_file is '{file}', in GPS time; epoch must be gps or unix.")
        solution = read_rtklib_pos(Stream.files(self.folder, file, f"{name}_file")[0], self.gpst_minus_utc_s)
        offset_ns = GPS_EPOCH_NS if self.epoch == "gps" else round(self.gpst_minus_utc_s * 1e9)
        since_ns = solution.gpst_ns - offset_ns - zero_ns + round(shift_s * 1e9)
        return np.asarray(since_ns * 1e-9), solution

    def _imu(self, stream: Stream, zero_ns: int) -> Imu:
        turn = axes_matrix(self.imu_axes)
        accel, gyro = stream.columns.numbers(self.imu_accel), stream.columns.numbers(self.imu_gyro)
        imu = imu_in_body(stream.t_s(zero_ns), accel, gyro, (self.accel_unit, self.gyro_unit), turn)
        return without_gyro_bias(imu, self.static_start_s) if self.remove_gyro_bias else imu

    def _position(self, zero_ns: int) -> tuple[Position | None, Origin | None]:
        if not self.position_file:
            return None, None
        if self.position_file.endswith(SOLUTION):
            t_s, solution = self._solution("position", self.position_file, zero_ns, self.position_shift_s)
            return solution.position(t_s)
        stream = self._stream("position", self.position_file, self.position_time, self.position_shift_s)
        stream = stream.only(self.position_columns)
        places = in_degrees(stream.columns.numbers(self.position_columns), self.position_frame, self.angle_unit)
        origin = origin_of(places, self.position_frame)
        sigma = stream.columns.numbers(self.position_sigma)
        enu_m = in_enu(places, self.position_frame, origin)
        return Position(stream.t_s(zero_ns), enu_m, covariances(enu_m, sigma, self.position_sigma_m)), origin

    def _velocity(self, zero_ns: int) -> Velocity | None:
        if not self.velocity_file:
            return None
        if self.velocity_file.endswith(SOLUTION):
            return self._solved_velocity(zero_ns)
        stream = self._stream("velocity", self.velocity_file, self.velocity_time, self.velocity_shift_s)
        stream = stream.only(self.velocity_columns)
        values = stream.columns.numbers(self.velocity_columns)
        return velocity_of(stream.t_s(zero_ns), values, self.velocity_frame, self.velocity_sigma_mps)

    def _solved_velocity(self, zero_ns: int) -> Velocity:
        t_s, solution = self._solution("velocity", self.velocity_file, zero_ns, self.velocity_shift_s)
        if solution.velocity_enu_mps is None or solution.velocity_covariance_m2ps2 is None:
            raise RecordingError(
                f"dataset table: {self.velocity_file} has no velocities; let RTKLIB write them (out-outvel=on), or"
                " leave velocity_file empty."
            )
        return Velocity(t_s, solution.velocity_enu_mps, solution.velocity_covariance_m2ps2)

    def _reference(
        self, zero_ns: int, origin: Origin | None, position: Position | None
    ) -> tuple[Reference, Origin | None]:
        if not self.reference_file:
            return fixes_as_reference(position, np.array([0.0])), origin
        stream = self._stream("reference", self.reference_file, self.reference_time, self.reference_shift_s)
        if named := (*self.reference_position, *self.reference_velocity, *self.reference_attitude):
            stream = stream.only(named)
        columns, frame = stream.columns, self.reference_frame
        enu_m = None
        if self.reference_position:
            places = in_degrees(columns.numbers(self.reference_position), frame, self.angle_unit)
            origin = origin or origin_of(places, frame)
            enu_m = in_enu(places, frame, origin)
        velocity = axes_in_enu(columns.numbers(self.reference_velocity), frame) if self.reference_velocity else None
        reference = Reference(
            stream.t_s(zero_ns),
            source=self.reference_source,
            independent=self.reference_independent,
            enu_m=enu_m,
            velocity_mps=velocity,
            euler_rad=self._attitude(stream.columns),
        )
        return reference, origin

    def _attitude(self, columns: Columns) -> FloatArray | None:
        if not self.reference_attitude:
            return None
        body = axes_matrix(self.imu_axes) if self.reference_body == "sensor" else None
        attitude = columns.numbers(self.reference_attitude)
        if len(self.reference_attitude) == 3 and self.attitude_unit == "deg":
            attitude = np.radians(attitude)
        turn = enu_from(self.attitude_frame or self.reference_frame)
        return attitude_in_flu(attitude, turn, self.reference_body, body)

    def _start_utc(self, zero_ns: int) -> datetime | None:
        if self.epoch == "gps":
            return utc_of(zero_ns + GPS_EPOCH_NS, self.gpst_minus_utc_s)
        return UNIX + timedelta(microseconds=zero_ns // 1000) if self.epoch == "unix" else None
