"""The streams of a table: the column parameters of each stream, and its times, covariances and attitudes."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray, positive_definite, require_lengths
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, enu_axes, euler_from_dcm
from jerkbench.io.columns import TIME_UNITS, Columns, TextFormat, cut_note, times_ns
from jerkbench.io.conversions import (
    ACCEL_UNITS,
    ANGLE_UNITS,
    FLU_FROM_FRD,
    FRAMES,
    GPS_EPOCH_NS,
    GPST_MINUS_UTC_S,
    GYRO_UNITS,
    HEIGHT_UNITS,
    SPEED_UNITS,
    UNIX_EPOCH,
    axes_matrix,
    covariance_in_enu,
    enu_from,
    rotated_covariance,
)
from jerkbench.io.files import find_files, named_folder
from jerkbench.io.readers import SOLUTION, read_columns
from jerkbench.io.sanitiser import MIN_DATE_NS, drop_notes, possible_rows
from jerkbench.io.tracks import POS_COVARIANCE, POS_POSITION, POS_VELOCITY, POS_VELOCITY_COVARIANCE
from jerkbench.recording import Origin, Reference

_RTKLIB = [0, 3, 5, 3, 1, 4, 5, 4, 2]
_UPPER = [0, 3, 4, 3, 1, 5, 4, 5, 2]
"""Indices of the nine elements of a symmetric matrix in a list of six elements: in the order of RTKLIB (11, 22, 33, 12,
23, 31), and in the order of the upper triangle (11, 22, 33, 12, 13, 23)."""


def covariances_of(
    columns: Columns,
    sigma: Sequence[str],
    covariance: Sequence[str],
    frame: str,
    otherwise: float,
    origin: Origin | None,
    scale: float = 1.0,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return covariances (n, 3, 3) in ENU, and notes that count invalid and missing covariances.

    If a covariance is not positive definite, only the absolute values of its variances are used. Such a covariance is
    caused by rounding, or by a negative standard deviation, which RTKLIB writes for a solution that is not a minimum.
    The standard deviation ``otherwise`` is used in a row that has no entry in the columns of the covariance, or a
    variance of zero.

    Args:
        columns: the table.
        sigma: names of columns of standard deviations: one column for all axes, three columns, or six columns in the
            order of RTKLIB (11, 22, 33, 12, 23, 31), which contain the square root of |c| with the sign of the
            covariance c.
        covariance: names of the columns with one variance for all axes, three variances, six elements of the covariance
            matrix (11, 22, 33, 12, 13, 23), or all nine elements row by row.
        frame: frame of the axes: enu, ned or ecef.
        otherwise: standard deviation of rows without a covariance [m or m/s].
        origin: origin of ENU, or None if the origin is unknown.
        scale: factor by which the standard deviations are multiplied. If the columns contain DOP values, the factor is
            the standard deviation of a range measurement [m].

    Raises:
        RecordingError: a column does not exist, a cell is not a number, or the axes are in ECEF and the origin is
            unknown.
    """
    default = otherwise**2 * np.eye(3)
    if not covariance and not sigma:
        return np.tile(default, (len(columns), 1, 1)), ()
    if frame == "ecef" and origin is None:
        raise RecordingError(
            f"{columns.where} has covariances in ECEF, but the origin of ENU on the Earth is unknown; give origin."
        )
    if covariance:
        values, six = columns.numbers(covariance), _UPPER
    else:
        sd = scale * columns.numbers(sigma)
        values, six = sd * np.abs(sd), _RTKLIB
    if values.shape[1] in (1, 3):
        matrices = np.broadcast_to(values, (len(values), 3))[:, :, None] * np.eye(3)
    else:
        matrices = values[:, six if values.shape[1] == 6 else list(range(9))].reshape(-1, 3, 3)
    zero = (np.einsum("nii->ni", matrices) == 0.0).any(axis=1)
    if len(zero) and zero.all():
        names = ", ".join(covariance or sigma)
        raise RecordingError(
            f"{columns.where}: none of the {len(zero)} rows has a standard deviation above 0 in the columns {names};"
            " leave these columns out, and give one standard deviation (position_sigma_m, velocity_sigma_mps)."
        )
    empty = zero | ~columns.rows_of(covariance or sigma)
    matrices = np.where(empty[:, None, None], default, matrices)
    diagonal = np.abs(matrices * np.eye(3))
    sound = positive_definite(matrices) | ~positive_definite(diagonal)
    matrices = np.where(sound[:, None, None], matrices, diagonal)
    if frame == "ecef" and origin is not None:
        matrices = rotated_covariance(enu_axes(origin), matrices)
    else:
        matrices = covariance_in_enu(matrices, frame)
    faults = {
        "a covariance that is not positive definite": (~sound, "only the sizes of their variances are used"),
        "no standard deviation": (empty, f"{otherwise:g} is used"),
    }
    notes = [note for fault, (rows, done) in faults.items() for note in drop_notes(columns.name, {fault: rows}, done)]
    return matrices, tuple(notes)


def read_attitude(
    columns: Columns,
    angles: Sequence[str],
    unit: str,
    frame: str,
    body: str,
    imu_axes: tuple[str, ...] = ("x", "y", "z"),
) -> FloatArray | None:
    """Return roll, pitch, yaw (n, 3) [rad] from FLU body axes to ENU, or None if ``angles`` is empty.

    The angles are NaN in rows without a known attitude.

    Args:
        columns: the table.
        angles: three columns (roll, pitch, yaw) or four columns (w, x, y, z) of the rotation from the body to the local
            frame, or an empty tuple.
        unit: unit of roll, pitch and yaw: rad or deg.
        frame: local frame of the attitude, either enu or ned.
        body: the axes that the attitude describes: flu, frd or sensor.
        imu_axes: the axes of the sensor that point along the body's x, y and z axes.

    Raises:
        RecordingError: a column does not exist, or a cell is not a number.
    """
    if not angles:
        return None
    attitude, by_angles = columns.numbers(angles), len(angles) == 3
    if by_angles and unit == "deg":
        attitude = np.radians(attitude)
    known = np.isfinite(attitude).all(axis=1)
    if not by_angles:
        known &= np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0  # a quaternion of zeros means "unknown"
    euler_rad = np.full((len(attitude), 3), np.nan)
    if known.any():
        turns = dcm_from_euler(attitude[known]) if by_angles else dcm_from_quaternion(attitude[known][:, [1, 2, 3, 0]])
        flu_from_body = {"flu": np.eye(3), "frd": FLU_FROM_FRD, "sensor": axes_matrix(imu_axes)}[body]
        euler_rad[known] = euler_from_dcm(enu_from(frame) @ turns @ flu_from_body.T)
    return euler_rad


COVARIANCE_FRAMES = ("enu", "ned", "ecef")

_STREAMS = ("position", "velocity", "reference")

CHOICES = {
    "accel_unit": tuple(ACCEL_UNITS),
    "gyro_unit": tuple(GYRO_UNITS),
    "time_unit": tuple(TIME_UNITS),
    **dict.fromkeys((f"{stream}_time_unit" for stream in _STREAMS), ("", *TIME_UNITS)),
    "angle_unit": tuple(ANGLE_UNITS),
    "attitude_unit": ("deg", "rad"),
    "height_unit": tuple(HEIGHT_UNITS),
    "reference_angle_unit": ("", *ANGLE_UNITS),
    "reference_height_unit": ("", *HEIGHT_UNITS),
    "reference_velocity_frame": ("", "enu", "ned"),
    "velocity_unit": tuple(SPEED_UNITS),
    "epoch": ("gps", "none", "unix"),
    "attitude_frame": ("", "enu", "ned"),
    **dict.fromkeys(("position_frame", "reference_frame"), FRAMES),
    "position_covariance_frame": COVARIANCE_FRAMES,
    "velocity_frame": ("enu", "ned", "ecef", "body", "speed"),
    "reference_body": ("flu", "frd", "sensor"),
}
"""Allowed values of each parameter."""

_COUNTS: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(("imu_accel", "imu_gyro", "position_columns", "velocity_columns", "reference_offset_m"), (3,)),
    **dict.fromkeys(("position_sigma", "velocity_sigma"), (0, 1, 3, 6)),
    **dict.fromkeys(("position_covariance", "velocity_covariance"), (0, 1, 3, 6, 9)),
    **dict.fromkeys(("reference_position", "reference_velocity"), (0, 3)),
    "reference_sigma": (0, 1, 3),
    "reference_attitude": (0, 3, 4),
}
"""Allowed number of entries (columns or numbers) of each parameter."""


def require_columns(table: object, velocity_frame: str) -> None:
    """Check the number of columns in each parameter of the data set `table`.

    Raises:
        PluginError: a parameter has a wrong number of columns, or a stream has both columns of standard deviations and
            columns of covariances.
    """
    speed = {"velocity_columns": (1,), "velocity_sigma": (0, 1), "velocity_covariance": (0, 1)}
    require_lengths(table, _COUNTS | (speed if velocity_frame == "speed" else {}))
    for stream in ("position", "velocity"):
        if getattr(table, f"{stream}_sigma") and getattr(table, f"{stream}_covariance"):
            raise PluginError(
                f"dataset table: {stream}_sigma and {stream}_covariance are both given; leave one of them empty."
            )


MIN_STEPS = 4
"""Minimum number of time steps among which an unusual step can be identified."""

SOLUTION_SETTINGS: dict[str, Any] = {
    "position_columns": POS_POSITION,
    "position_frame": "geodetic",
    "position_sigma": (),
    "position_covariance": POS_COVARIANCE,
    "position_covariance_frame": "enu",
    "velocity_columns": POS_VELOCITY,
    "velocity_frame": "enu",
    "velocity_sigma": (),
    "velocity_covariance": POS_VELOCITY_COVARIANCE,
    "reference_position": POS_POSITION,
    "reference_velocity": POS_VELOCITY,
    "reference_attitude": (),
    "reference_frame": "geodetic",
    "reference_sigma": (),
}
"""Parameters of each stream if its file is a solution of RTKLIB."""


class Source(NamedTuple):
    """The file of a stream, and its columns for time and quality.

    Attributes:
        name: name of the stream: imu, position, velocity or reference.
        file: name of the file, or a pattern of several files, or empty if the recording does not have this stream.
        time: column of the times, or empty if the times are in the file ``time_file`` of `TimedColumns`.
        shift_s: time shift that is added to the stamps [s].
        unit: unit of the times, or empty to use the unit ``time_unit`` of `TimedColumns`.
        qualities: accepted values of the column ``quality``, or empty to accept all values.
        quality: column with the quality of each row, or empty if the file has no such column.
    """

    name: str
    file: str
    time: str
    shift_s: float
    unit: str = ""
    qualities: tuple[float, ...] = ()
    quality: str = ""

    @property
    def solved(self) -> bool:
        """True if the file is a solution of RTKLIB."""
        return self.file.endswith(SOLUTION)


def accepted(where: str, quality: FloatArray, qualities: tuple[float, ...], parameter: str) -> BoolArray:
    """Return a mask (n,) of the rows whose quality is among the ``qualities``.

    Raises:
        RecordingError: no row has an accepted quality. The error message lists the qualities in the file.
    """
    rows = np.isin(quality, qualities)
    if not rows.any():
        there = ", ".join(f"{q:g}" for q in np.unique(quality))
        raise RecordingError(f"{where} has no fix with Q in {qualities}, only with Q {there}; extend {parameter}.")
    return rows


def without_cut_times(columns: Columns) -> Columns:
    """Drop the first or the last row if its time is truncated, and add a note that counts the dropped rows.

    If the first digits of the first time are missing, the first time step is longer than the rest of the log. If the
    last digits of the last time are missing, the last time is earlier than the previous time.
    """
    steps = np.diff(columns.t_ns)
    if len(steps) < MIN_STEPS or (steps[1:-1] <= 0).any():
        return columns
    first, last = bool(steps[0] > steps[1:-1].sum() + abs(steps[-1])), bool(steps[-1] < 0)
    return columns.only(np.arange(first, len(columns) - last), cut_note(columns.name, first=first, last=last))


MATLAB = ".mat"
"""Ending of MATLAB files. Their variables may have different lengths."""


@dataclass(frozen=True)
class TimedColumns:
    """Parameters that all streams of a table share: the folder, the format of the text, and the time.

    Attributes:
        folder: folder of the files; "fetched:NAME" is the recording that `jerkbench data fetch NAME` has fetched.
        separator: separator of the columns of a text file, or empty for white space.
        header: whether a line above the data names the columns. The header is the first line with as many fields as the
            data, so a title or a line of units is ignored. Without a header, the columns are numbered from 1.
        comment: characters at the start of the lines that are ignored, or empty to ignore no lines.
        time_unit: unit of all columns of times: s, ms, us or ns. A stream may have a different unit.
        time_week: column with the GPS week, or empty if the times do not restart each week. Dates (ISO 8601) and stamps
            such as 2374:243258.5 (week and time of week) do not need this column.
        time_file: name or pattern of files with one UTC date and time per row, for a stream without a column of times.
        epoch: epoch of the times: unix (1970, UTC), gps (1980, GPS time), or none (unknown).
        gpst_minus_utc_s: GPS time minus UTC, which is 18 s since 2017 [s].
        drop_leaps: whether to drop fixes that no vehicle could have reached from the neighbouring fixes. Use false to
            study fixes that leap.
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
    drop_leaps: bool = True

    def files(self, pattern: str, parameter: str) -> tuple[Path, ...]:
        """Return the files in the folder that match the pattern.

        Raises:
            RecordingError: no file matches. The error message names ``parameter``.
        """
        return find_files(named_folder(self.folder), pattern, parameter)

    def read(self, source: Source) -> Columns:
        """Return the rows of a stream with their stamps.

        Raises:
            RecordingError: a file is missing or damaged, or the number of dates differs from the number of rows.
        """
        text = TextFormat(self.separator, self.header, self.comment)
        columns = read_columns(self.files(source.file, f"{source.name}_file"), text, self.gpst_minus_utc_s)
        if source.file.endswith(MATLAB) and source.time:
            columns = columns.only(columns.rows_of([source.time]))
        if source.quality and source.qualities:
            quality = columns.numbers([source.quality])[:, 0]
            columns = columns.only(accepted(columns.where, quality, source.qualities, f"{source.name}_quality"))
        t_ns = self._stamps_ns(columns, source)
        if len(t_ns) != len(columns):
            raise RecordingError(
                f"{columns.where} has {len(columns)} rows, but {self.time_file} has {len(t_ns)} times; the numbers must"
                " be equal."
            )
        columns = without_cut_times(columns.stamped(t_ns + round(source.shift_s * 1e9)))
        epoch_ns = self._epoch_ns
        if epoch_ns is None or (columns.t_ns + epoch_ns < MIN_DATE_NS).all():  # the times are relative
            return columns
        return columns.only(*possible_rows(columns.name, utc_ns=columns.t_ns + epoch_ns))

    def start_utc(self, zero_ns: int) -> datetime | None:
        """Convert the time ``zero_ns`` to UTC. Return None if the epoch is "none".

        If the times are relative, the returned date is close to the epoch. Such a date is not printed, but aligns
        trajectories that have the same relative times.
        """
        epoch_ns = self._epoch_ns
        return None if epoch_ns is None else UNIX_EPOCH + timedelta(microseconds=(zero_ns + epoch_ns) // 1000)

    @property
    def _epoch_ns(self) -> int | None:
        """UTC of time 0 in nanoseconds since 1970, or None if the epoch is "none"."""
        return {"unix": 0, "gps": GPS_EPOCH_NS - round(self.gpst_minus_utc_s * 1e9)}.get(self.epoch)

    def _stamps_ns(self, columns: Columns, source: Source) -> IntArray:
        if not source.time:
            text = TextFormat(header=False)
            columns = read_columns(self.files(self.time_file, "time_file"), text, self.gpst_minus_utc_s)
        name = source.time or "1"
        dates_ns = columns.dates_ns(name, self.gpst_minus_utc_s)
        if dates_ns is None:
            return times_ns(columns, name, source.unit or self.time_unit, self.time_week)
        if self._epoch_ns is None:
            raise PluginError(
                f"dataset table: the times of {source.name}_file '{source.file}' are dates; set epoch to gps or unix."
            )
        return dates_ns - self._epoch_ns


# The accuracy of the reference, and the epochs at which the reference is too inaccurate for scoring.


def with_sigma(reference: Reference, sigma_m: FloatArray | None, worst_m: float) -> tuple[Reference, tuple[str, ...]]:
    """Return the reference with standard deviations, and notes about its accuracy.

    Args:
        reference: the reference with k stamps.
        sigma_m: (k, 3) standard deviations of east, north and up [m], or None if they are unknown.
        worst_m: maximum 3-D standard deviation at which errors are scored [m], or 0 for no limit.
    """
    if sigma_m is None:
        return reference, ()
    size_m = np.sqrt((sigma_m**2).sum(axis=1))
    good = np.isfinite(size_m) & ((size_m <= worst_m) if worst_m else True)
    reference = dataclasses.replace(reference, sigma_m=sigma_m, scored=reference.scored & good)
    floor_m = float(np.sqrt(np.mean(size_m[good] ** 2))) if good.any() else float("nan")
    known = f"The reference has a 3-D standard deviation of {floor_m:.3g} m"
    notes = [f"{known}. A perfect estimate would have this RMSE, and smaller differences are not tested."]
    if not good.all():
        notes.append(f"{int((~good).sum())} of {len(good)} epochs of the reference are too inaccurate and not scored.")
    return reference, tuple(notes)
