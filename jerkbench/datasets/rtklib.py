"""A real drive: a receiver's solution in RTKLIB's text, and the IMU's log beside it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, IntArray, require_choices, require_lengths
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, utc_of, velocity_when_true, with_common_time
from jerkbench.io.columns import TIME_UNITS, Columns, read_columns, times_ns
from jerkbench.io.files import FromFiles, find_file, recording_folder
from jerkbench.io.frames import (
    ACCEL_UNITS,
    GYRO_UNITS,
    axes_matrix,
    axes_to_judge,
    body_from_sensor,
    calibrated_at_rest,
    first_rest_s,
    gravity_notes,
    imu_in_body,
    in_enu,
)
from jerkbench.io.rtklib import (
    MIN_POS_ROWS,
    POS_COVARIANCE,
    POS_PLACE,
    POS_QUALITY,
    POS_VELOCITY,
    POS_VELOCITY_COVARIANCE,
    ImuLog,
    is_ellipsoidal,
    read_imu_log,
)
from jerkbench.io.sanitiser import possible_imu, possible_rows, repeat_notes, steady_rows
from jerkbench.io.table import CovarianceMap, accepted, covariances_of
from jerkbench.io.text import TextFormat
from jerkbench.plugins import register
from jerkbench.recording import Origin, Position, Recording, Reference, Velocity


@register("dataset", "rtklib")
@dataclass(frozen=True)
class RtklibDrive(FromFiles):
    """A real drive from an RTKLIB solution (any .pos) and an IMU's log.

    The log is ax, ay, az, gx, gy, gz, ms without header, whose clock its time tag (.tag) sets; or, with ``imu_time``,
    any table with absolute times, read as the data set ``table`` does it: CSV, text or Parquet, by columns.

    The other defaults are those of the public drive that it was written for: ``data/drive_0708`` of
    github.com/rtklibexplorer/GNSS_IMU (BSD-3), a car of 549 s and 4 km. Mounting and latencies were measured on it
    and hold for no other; give your own, or zeros, for another drive.

    Time 0 is when the first IMU sample was true. The public drive's receiver began 3.4 s before; these fixes have
    negative times, and the filters start with the first one that the IMU covers. Everything stands at the time when
    it was true::

        IMU       start + (ms - ms[0]) total / (ms[-1] - ms[0]) + imu_shift      start, total: the time tag's
        position  stamp
        velocity  stamp - velocity_latency, axis by axis; an axis that is not in a row is NaN

    and the IMU is turned into the body::

        f_body = (Rz(yaw) Ry(pitch))' diag(signs) A f_sensor, A from imu_axes    and the same for the gyro

    Two percent of the public drive's IMU rows repeat the row before: the logger asks a little more often than the
    sensor measures. They are kept, for the value holds until the next one comes, and so the intervals of the samples
    stay whole; without them the sample after each gap would stand for 20 ms.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Attributes:
        folder: where the files are; empty: where `jerkbench data fetch rtklib_drive_0708` has put them.
        position_file: name of the solution in it; empty: the one that ends in .pos.
        imu_file: name of the IMU log; empty: the one that ends in .csv.
        tag_file: name of its time tag; empty: the IMU log's name and .tag. Not used with ``imu_time``.
        imu_time: column of absolute times, a name of the header or a number from 1; empty: the time tag's.
        imu_week: column of GPS weeks, where the times are those of the week; empty: they are not.
        imu_time_unit: s, ms, us or ns.
        imu_epoch: what the times count from: gps (1980, GPS time) or unix (1970, UTC).
        imu_accel: columns of the specific force x, y, z.
        imu_gyro: columns of the angular rate x, y, z.
        imu_separator: between the columns of a text; empty: white space.
        imu_header: whether the first line names the columns.
        imu_axes: which axes of the sensor are x, y and z here: x, -x, y, -y, z or -z each.
        accel_unit: of the log: g or m/s2.
        gyro_unit: of the log: deg/s or rad/s.
        imu_axis_signs: of x, y, z, applied after ``imu_axes``.
        mounting_yaw_deg: from the body to the IMU, about z.
        mounting_pitch_deg: from the body to the IMU, about y, after the yaw; positive is nose down.
        imu_shift_s: added to the IMU's stamps.
        velocity_latency_s: how old the velocity is at its stamp: east, north, up.
        gpst_minus_utc_s: leap seconds; 18 since 2017.
        accepted_quality: values of Q that are used (1 fixed, 2 float, 4 differential, 5 single); others are dropped.
        rest_s: how long it stands still from time 0; None: found in the receiver's velocity.
        remove_gyro_bias: subtract the gyro's mean over the rest.
        scale_accel_to_gravity: scale the accelerometer so that its mean over the rest has the magnitude 9.81 m/s2.
        min_speed_mps: errors count only where the receiver's own speed over ground is not below; 0: everywhere.
    """

    folder: str = ""
    position_file: str = ""
    imu_file: str = ""
    tag_file: str = ""
    imu_time: str = ""
    imu_week: str = ""
    imu_time_unit: str = "s"
    imu_epoch: str = "gps"
    imu_accel: tuple[str, ...] = ("1", "2", "3")
    imu_gyro: tuple[str, ...] = ("4", "5", "6")
    imu_separator: str = ","
    imu_header: bool = True
    imu_axes: tuple[str, ...] = ("x", "y", "z")
    accel_unit: str = "g"
    gyro_unit: str = "deg/s"
    imu_axis_signs: tuple[float, ...] = (-1.0, -1.0, 1.0)
    mounting_yaw_deg: float = 5.35
    mounting_pitch_deg: float = -6.79
    imu_shift_s: float = -0.20
    velocity_latency_s: tuple[float, ...] = (0.125, 0.125, 0.275)
    gpst_minus_utc_s: float = GPST_MINUS_UTC_S
    accepted_quality: tuple[float, ...] = (1.0, 2.0)
    rest_s: float | None = None
    remove_gyro_bias: bool = True
    scale_accel_to_gravity: bool = True
    min_speed_mps: float = 0.5

    def __post_init__(self) -> None:
        """Check the units and the three axes."""
        require_choices(self, {"accel_unit": ACCEL_UNITS, "gyro_unit": GYRO_UNITS})
        require_choices(self, {"imu_time_unit": TIME_UNITS, "imu_epoch": ("gps", "unix")})
        axes_matrix(self.imu_axes)
        require_lengths(self, dict.fromkeys(("imu_accel", "imu_gyro", "velocity_latency_s", "imu_axis_signs"), (3,)))
        if any(abs(sign) != 1 for sign in self.imu_axis_signs):
            raise PluginError(f"imu_axis_signs is {self.imu_axis_signs}; give 1 or -1 for each of x, y, z.")

    def load(self, seed: int = 0) -> Recording:
        """Return the drive; ``seed`` changes nothing.

        Raises:
            RecordingError: a file is missing or damaged, no fix is accepted, or there is no rest to calibrate in.
        """
        pos_path, imu_path = self.paths()[:2]
        columns = read_columns((pos_path,), TextFormat(), self.gpst_minus_utc_s)
        of_file, quality = columns.notes, columns.numbers([POS_QUALITY])[:, 0]
        columns = columns.only(accepted(str(pos_path), quality, self.accepted_quality, "accepted_quality"))
        log = self._log()
        zero_ns = log.start_gpst_ns + round(self.imu_shift_s * 1e9)
        t_s = np.asarray((_gpst_ns(columns, self.gpst_minus_utc_s) - zero_ns) * 1e-9, dtype=np.float64)
        places = columns.numbers(POS_PLACE)
        steady, leaps = steady_rows(t_s, axes_to_judge(places, "geodetic"))
        columns, t_s, places = columns.only(steady), t_s[steady], places[steady]
        origin = Origin(*places[0].tolist())
        position = Position(t_s, in_enu(places, "geodetic", origin), _covariances(columns, POS_COVARIANCE))
        speed_mps = _ground_speed(columns, position)
        rest_s = first_rest_s(t_s, speed_mps, log.t_s[-1]) if self.rest_s is None else self.rest_s
        turn = body_from_sensor(self.imu_axis_signs, self.mounting_yaw_deg, self.mounting_pitch_deg)
        turn = turn @ axes_matrix(self.imu_axes)
        imu = imu_in_body(log.t_s, log.accel, log.gyro, (self.accel_unit, self.gyro_unit), turn)
        imu, impossible = possible_imu(str(imu_path), imu)
        imu = calibrated_at_rest(imu, rest_s, gyro=self.remove_gyro_bias, accel=self.scale_accel_to_gravity)
        own, moves = "the receiver's own fixes", speed_mps >= self.min_speed_mps
        of_imu = *gravity_notes(imu.accel_mps2, "imu_axes"), *repeat_notes(imu), *log.notes, *impossible
        recording = Recording(
            name=pos_path.parent.resolve().name,
            imu=imu,
            reference=Reference(t_s, own, independent=False, enu_m=position.enu_m, scored=moves),
            position=position,
            velocity=_velocity_of_fixes(columns, t_s, self.velocity_latency_s),
            origin=origin,
            start_utc=utc_of(zero_ns, self.gpst_minus_utc_s),
            static_start_s=rest_s,
            notes=(*of_imu, *leaps, *of_file, *HEIGHTS[is_ellipsoidal(pos_path)], SAME, *_fitted_notes(self)),
        )
        return with_common_time(recording, f"check that {imu_path.name} is of the same drive, and its times in GPST")

    def paths(self) -> tuple[Path, ...]:
        """The solution, the IMU log, and its time tag where there is one."""
        folder = recording_folder(self.folder, "rtklib_drive_0708")
        pos = find_file(folder, self.position_file, ".pos", "position_file")
        imu = find_file(folder, self.imu_file, ".csv", "imu_file")
        if self.imu_time:
            return pos, imu
        return pos, imu, find_file(folder, self.tag_file or f"{imu.name}.tag", ".tag", "tag_file")

    def _log(self) -> ImuLog:
        _, path, *tag = self.paths()
        if tag:
            return read_imu_log(path, tag[0])
        table = read_columns((path,), TextFormat(self.imu_separator, self.imu_header))
        t_ns = times_ns(table, self.imu_time, self.imu_time_unit, self.imu_week)
        if len(t_ns) < MIN_POS_ROWS:
            raise RecordingError(f"{path} has {len(t_ns)} rows; an IMU's log has at least {MIN_POS_ROWS}.")
        t_ns = t_ns + (GPS_EPOCH_NS if self.imu_epoch == "gps" else round(self.gpst_minus_utc_s * 1e9))
        rows, notes = possible_rows(path.name, utc_ns=t_ns)
        t_ns, table = t_ns[rows], table.only(rows)
        t_s, accel, gyro = (t_ns - t_ns[0]) * 1e-9, table.numbers(self.imu_accel), table.numbers(self.imu_gyro)
        return ImuLog(int(t_ns[0]), np.asarray(t_s), accel, gyro, notes)


# What the solution says about the motion, and the sentences under a table of it.


def _ground_speed(columns: Columns, position: Position) -> FloatArray:
    """Return the speed over ground (m,): the receiver's, or, where it gives none, from fix to fix."""
    if columns.has(POS_VELOCITY):
        return np.asarray(np.hypot(*columns.numbers(POS_VELOCITY[:2]).T))
    if len(position.t_s) < 2:
        return np.zeros(len(position.t_s))
    return np.asarray(np.hypot(*np.gradient(position.enu_m[:, :2], position.t_s, axis=0).T))


def _velocity_of_fixes(columns: Columns, t_s: FloatArray, latency_s: tuple[float, ...]) -> Velocity | None:
    """Return the velocities of the fixes at ``t_s`` (m,) when they were true; None where the file has none."""
    if not columns.has(POS_VELOCITY):
        return None
    return velocity_when_true(
        t_s, columns.numbers(POS_VELOCITY), _covariances(columns, POS_VELOCITY_COVARIANCE), latency_s
    )


def _gpst_ns(columns: Columns, gpst_minus_utc_s: float) -> IntArray:
    utc_ns = columns.dates_ns("t", gpst_minus_utc_s)
    assert utc_ns is not None  # noqa: S101 - a solution has dates
    return utc_ns + round(gpst_minus_utc_s * 1e9)


def _covariances(columns: Columns, names: tuple[str, ...]) -> FloatArray:
    return covariances_of(columns, CovarianceMap((), names, "enu", sigma_otherwise=1.0), None)[0]


SAME = "The receiver's fixes are measurement and reference at once unless they are withheld from the filter."

HEIGHTS = {
    True: (),
    False: ("Heights are above mean sea level, not above the ellipsoid, as the solution's header says.",),
    None: ("The solution's header does not say what heights are above, the ellipsoid or mean sea level.",),
}
"""Notes where heights are above the ellipsoid, above mean sea level, or nobody says above what."""

_FITTED = {
    "mounting": ("mounting_yaw_deg", "mounting_pitch_deg"),
    "time shift": ("imu_shift_s",),
    "latencies": ("velocity_latency_s",),
}
"""What was fitted on the public drive itself, and the parameters whose defaults it is."""


def _fitted_notes(drive: object) -> tuple[str, ...]:
    """Return a note that says which parameters of ``drive`` are the defaults, fitted on the public drive; or none."""
    own = type(drive)
    fitted = [subject for subject, names in _FITTED.items() if any(getattr(drive, n) == getattr(own, n) for n in names)]
    if not fitted:
        return ()
    listed = " and ".join([", ".join(fitted[:-1]), fitted[-1]] if fitted[1:] else fitted)
    singular = fitted in (["mounting"], ["time shift"])
    verbs = "is the default, which was" if singular else "are the defaults, which were"
    return (f"{listed.capitalize()} {verbs} fitted on the public drive drive_0708: for no other drive.",)
