"""The data set `rtklib`: a real drive, which is read from a solution of RTKLIB and the log of an IMU."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, IntArray, require_choices, require_lengths
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.columns import Columns, TextFormat
from jerkbench.io.conversions import (
    ACCEL_UNITS,
    GPST_MINUS_UTC_S,
    GYRO_UNITS,
    axes_matrix,
    body_from_sensor,
    calibrated_at_rest,
    first_rest_s,
    in_enu,
    utc_of,
    velocity_when_true,
)
from jerkbench.io.files import FromFiles, find_file, named_folder, read_bytes
from jerkbench.io.readers import read_columns
from jerkbench.io.sanitiser import imu_in_body, possible_rows, steady_rows, with_common_time
from jerkbench.io.table import accepted, covariances_of, without_cut_times
from jerkbench.io.tracks import (
    POS_COVARIANCE,
    POS_POSITION,
    POS_QUALITY,
    POS_VELOCITY,
    POS_VELOCITY_COVARIANCE,
    is_ellipsoidal,
)
from jerkbench.plugins import register
from jerkbench.recording import Origin, Position, Recording, Reference


@register("dataset", "rtklib")
@dataclass(frozen=True)
class RtklibDrive(FromFiles):
    """A real drive from an RTKLIB solution (any .pos) and an IMU's log.

    The IMU log has the columns ax, ay, az, gx, gy, gz, ms, without a header. The time tag (a file that ends in .tag)
    contains the start time and the duration of the IMU log. For an IMU log in another format, use the data set
    ``table`` with a ``position_file`` and a ``velocity_file`` that end in .pos.

    The defaults are for the public drive ``data/drive_0708`` of github.com/rtklibexplorer/GNSS_IMU (BSD-3), a car drive
    of 549 s and 4 km. The mounting and the latencies were measured on the public drive and are not valid for other
    drives. For another drive, set the mounting and the latencies to measured values or to zero.

    Time 0 is the time of validity of the first IMU sample. The receiver of the public drive started 3.4 s before the
    IMU. Fixes before the first IMU sample have negative times. The filters start with the first fix after the start of
    the IMU. Each measurement is assigned to the time at which it was valid::

        IMU       start + (ms - ms[0]) total / (ms[-1] - ms[0]) + imu_shift      start, total: the time tag's
        position  stamp
        velocity  stamp - velocity_latency, axis by axis; an axis that is not in a row is NaN

    The IMU samples are rotated into body axes::

        f_body = (Rz(yaw) Ry(pitch))' diag(signs) A f_sensor, A from imu_axes    and the same for the gyro

    Two percent of the IMU rows of the public drive repeat the previous row, because the logger is slightly faster than
    the sensor. Repeated IMU rows are not dropped, because each value is valid until the next value. Without the
    repeated rows, the sample after each dropped row would represent an interval of 20 ms.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Attributes:
        folder: folder of the files, or empty for the folder of `jerkbench data fetch rtklib_drive_0708`.
        position_file: name of the solution in the folder, or empty for the only file that ends in .pos.
        imu_file: name of the IMU log in the folder, or empty for the only file that ends in .csv.
        tag_file: name of the time tag of the IMU log, or empty for the name of the IMU log with .tag appended.
        imu_axes: the three sensor axes that become x, y and z. Each of them is x, -x, y, -y, z or -z.
        accel_unit: unit of the specific force in the log: g or m/s2.
        gyro_unit: unit of the angular rate in the log: deg/s or rad/s.
        imu_axis_signs: signs of x, y, z, applied after ``imu_axes``.
        mounting_yaw_deg: rotation from the body to the IMU about z [deg].
        mounting_pitch_deg: rotation from the body to the IMU about y, after the yaw, positive with the nose down [deg].
        imu_shift_s: time shift that is added to the IMU's stamps [s].
        velocity_latency_s: time from the validity of a velocity to its stamp, on the axes east, north and up [s].
        gpst_minus_utc_s: GPS time minus UTC, which is 18 s since 2017 [s].
        accepted_quality: accepted values of the quality Q of a fix (1 fixed, 2 float, 4 differential, 5 single). Fixes
            with another quality are dropped.
        rest_s: duration of the rest from time 0 on [s], or null to detect the rest in the velocity of the receiver.
        remove_gyro_bias: whether to subtract the mean angular rate over the rest from the gyro.
        scale_accel_to_gravity: whether to scale the accelerometer so that its mean over the rest is 9.81 m/s2.
        min_speed_mps: minimum ground speed of the receiver at which errors are scored [m/s], or 0 to score all errors.
    """

    folder: str = ""
    position_file: str = ""
    imu_file: str = ""
    tag_file: str = ""
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
        require_choices(self, {"accel_unit": ACCEL_UNITS, "gyro_unit": GYRO_UNITS})
        axes_matrix(self.imu_axes)
        require_lengths(self, dict.fromkeys(("velocity_latency_s", "imu_axis_signs"), (3,)))
        if any(abs(sign) != 1 for sign in self.imu_axis_signs):
            raise PluginError(f"imu_axis_signs is {self.imu_axis_signs}; give 1 or -1 for each of x, y, z.")

    def load(self, seed: int = 0) -> Recording:
        """Return the recording of the drive. ``seed`` has no effect.

        Raises:
            RecordingError: a file is missing or damaged, no fix is accepted, or the drive has no rest for calibration.
        """
        pos_path, imu_path, tag_path = self.paths()
        columns = read_columns((pos_path,), TextFormat(), self.gpst_minus_utc_s)
        of_file, quality = columns.notes, columns.numbers([POS_QUALITY])[:, 0]
        columns = columns.only(accepted(str(pos_path), quality, self.accepted_quality, "accepted_quality"))
        start_ns, imu_s, samples = read_imu_log(imu_path, tag_path)
        zero_ns = start_ns + round(self.imu_shift_s * 1e9)
        t_s = np.asarray((_gpst_ns(columns, self.gpst_minus_utc_s) - zero_ns) * 1e-9, dtype=np.float64)
        places = columns.numbers(POS_POSITION)
        steady, leaps = steady_rows(pos_path.name, t_s, places)
        columns, t_s, places = columns.only(steady), t_s[steady], places[steady]
        origin = Origin(*places[0].tolist())
        position = Position(t_s, in_enu(places, "geodetic", origin), _covariances(columns, POS_COVARIANCE))
        speed_mps = _ground_speed(columns, position)
        rest_s = first_rest_s(t_s, speed_mps, imu_s[-1]) if self.rest_s is None else self.rest_s
        turn = body_from_sensor(self.imu_axis_signs, self.mounting_yaw_deg, self.mounting_pitch_deg)
        turn = turn @ axes_matrix(self.imu_axes)
        measured, units = (samples.numbers(LOG_ACCEL), samples.numbers(LOG_GYRO)), (self.accel_unit, self.gyro_unit)
        imu, of_imu = imu_in_body(str(imu_path), imu_s, *measured, units, turn)
        imu = calibrated_at_rest(imu, rest_s, gyro=self.remove_gyro_bias, accel=self.scale_accel_to_gravity)
        source, moves, velocity = "the receiver's own fixes", speed_mps >= self.min_speed_mps, None
        if columns.has(POS_VELOCITY):
            of_velocity = columns.numbers(POS_VELOCITY), _covariances(columns, POS_VELOCITY_COVARIANCE)
            velocity = velocity_when_true(t_s, *of_velocity, self.velocity_latency_s)
        recording = Recording(
            name=pos_path.parent.resolve().name,
            imu=imu,
            reference=Reference(t_s, source, independent=False, enu_m=position.enu_m, scored=moves),
            position=position,
            velocity=velocity,
            origin=origin,
            start_utc=utc_of(zero_ns, self.gpst_minus_utc_s),
            static_start_s=rest_s,
            notes=(
                *of_imu,
                *samples.notes,
                *leaps,
                *of_file,
                *HEIGHTS[is_ellipsoidal(pos_path)],
                SAME,
                *_fitted_notes(self),
            ),
        )
        return with_common_time(recording, f"check that {imu_path.name} is of the same drive and has times in GPST")

    def paths(self) -> tuple[Path, Path, Path]:
        """Return the paths of the solution, of the IMU log, and of the time tag of the IMU log."""
        folder = named_folder(self.folder or "fetched:rtklib_drive_0708")
        pos = find_file(folder, self.position_file, ".pos", "position_file")
        imu = find_file(folder, self.imu_file, ".csv", "imu_file")
        return pos, imu, find_file(folder, self.tag_file or f"{imu.name}.tag", ".tag", "tag_file")


# The log of an IMU, and the time tag (.tag) that RTKLIB writes with it, with the start and the duration of the log.

_MAGIC = b"TIMETAG RTKLIB"
_START = struct.Struct("<60xIId")  # header of 60 bytes, tick, time_t, fraction of a second
_RECORD = struct.Struct("<II")  # tick [ms since the start], position in the stream's file


def read_time_tag(path: Path) -> tuple[int, float]:
    """Return the start of a stream by the logger's clock (GPST since 1970 [ns]), and the duration of the stream [s].

    A time tag is a little-endian binary file with a header of 60 bytes, u32 tick, u32 time_t, f64 fraction, and then
    the records (u32 ms, u32 filepos).

    Raises:
        RecordingError: the file does not exist, is empty, is not a time tag, or is truncated.
    """
    content = read_bytes(path)
    if not content.startswith(_MAGIC):
        raise RecordingError(f"{path} does not begin with '{_MAGIC.decode()}'; it must be a time tag of RTKLIB.")
    records, excess = divmod(len(content) - _START.size, _RECORD.size)
    if records < 1 or excess:
        raise RecordingError(
            f"{path} has {len(content)} bytes, but a time tag has {_START.size} bytes and {_RECORD.size} more bytes for"
            " each record. The file is truncated; copy the file again."
        )
    _, seconds, fraction = _START.unpack_from(content)
    if not 0.0 <= fraction < 1.0:
        raise RecordingError(f"{path}: the fractional second of the start is {fraction}; it must lie in [0, 1).")
    last_ms, _ = _RECORD.unpack_from(content, len(content) - _RECORD.size)
    if last_ms == 0:
        raise RecordingError(f"{path}: the last record is at 0 ms, so the time tag is empty; use another time tag.")
    start_ns = seconds * 1_000_000_000 + round(fraction * 1e9)
    possible_rows(path.name, utc_ns=[start_ns])
    return start_ns, last_ms * 1e-3


CLOCKS_AGREE = 0.01
"""Maximum relative difference of the durations by the sensor's and the logger's clock. A time tag with a larger
difference belongs to another recording."""

LOG_ACCEL, LOG_GYRO, LOG_MS = ("1", "2", "3"), ("4", "5", "6"), "7"
"""Columns of an IMU log."""


def read_imu_log(path: Path, tag_path: Path) -> tuple[int, FloatArray, Columns]:
    """Return the GPS time of the first sample [ns since 1970], the times since this sample [s], and the samples.

    A truncated first or last line is dropped, even if only the time in the last column is truncated.

    The clock of the sensor (column ms) drifts, so its times are scaled to the duration in the time tag. The time since
    the start is t = (ms - ms[0]) total / (ms[-1] - ms[0]), where total is this duration.

    Raises:
        RecordingError: a file is missing, empty or damaged, or the two files belong to different recordings. For a
            damaged row, the error message contains the number of the row.
    """
    columns = read_columns((path,), TextFormat(header=False))
    columns = without_cut_times(columns.stamped(columns.stamps_ns(LOG_MS, "ms")))
    columns.finite((*LOG_ACCEL, *LOG_GYRO))
    columns.require_increasing()
    start_ns, total_s = read_time_tag(tag_path)
    ms = columns.numbers([LOG_MS])[:, 0]
    elapsed_s = 1e-3 * (ms[-1] - ms[0])
    if abs(elapsed_s - total_s) > CLOCKS_AGREE * total_s:
        raise RecordingError(
            f"{path} covers {elapsed_s:.3f} s, but its time tag {tag_path.name} covers {total_s:.3f} s;"
            " use the time tag of the same recording, and check that neither file is truncated."
        )
    return start_ns, (ms - ms[0]) * (1e-3 * total_s / elapsed_s), columns


# The speed, the velocities and the covariances in the solution, and the notes of the recording.


def _ground_speed(columns: Columns, position: Position) -> FloatArray:
    """Return the speed over ground (m,), from the velocities of the solution or, if it has none, from its fixes."""
    if columns.has(POS_VELOCITY):
        return np.asarray(np.hypot(*columns.numbers(POS_VELOCITY[:2]).T))
    if len(position.t_s) < 2:
        return np.zeros(len(position.t_s))
    return np.asarray(np.hypot(*np.gradient(position.enu_m[:, :2], position.t_s, axis=0).T))


def _gpst_ns(columns: Columns, gpst_minus_utc_s: float) -> IntArray:
    utc_ns = columns.dates_ns("t", gpst_minus_utc_s)
    assert utc_ns is not None  # noqa: S101 - a solution has dates
    return utc_ns + round(gpst_minus_utc_s * 1e9)


def _covariances(columns: Columns, names: tuple[str, ...]) -> FloatArray:
    return covariances_of(columns, (), names, "enu", 1.0, None)[0]


SAME = "The receiver's fixes are both measurement and reference, unless they are withheld from the filter."

HEIGHTS = {
    True: (),
    False: ("Heights are above mean sea level, not above the ellipsoid, according to the solution's header.",),
    None: ("The solution's header does not state if heights are above the ellipsoid or above mean sea level.",),
}
"""Notes for heights above the ellipsoid, above mean sea level, or above an unknown surface."""

_FITTED = {
    "mounting": ("mounting_yaw_deg", "mounting_pitch_deg"),
    "time shift": ("imu_shift_s",),
    "latencies": ("velocity_latency_s",),
}
"""Quantities that were fitted on the public drive, and the parameters whose defaults are these quantities."""


def _fitted_notes(drive: object) -> tuple[str, ...]:
    """Return a note that lists the parameters with defaults, because the defaults were fitted on the public drive."""
    defaults = type(drive)
    fitted = [
        subject for subject, names in _FITTED.items() if any(getattr(drive, n) == getattr(defaults, n) for n in names)
    ]
    if not fitted:
        return ()
    listed = " and ".join([", ".join(fitted[:-1]), fitted[-1]] if fitted[1:] else fitted)
    singular = fitted in (["mounting"], ["time shift"])
    predicate = "is the default, which was" if singular else "are the defaults, which were"
    return (f"{listed.capitalize()} {predicate} fitted on the public drive drive_0708; do not use on other drives.",)
