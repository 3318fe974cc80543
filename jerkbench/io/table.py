"""Streams of a table: times, covariances, attitudes and the columns that contain them."""

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
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, UNIX_EPOCH
from jerkbench.io.columns import SOLUTION, TIME_UNITS, Columns, find_tables, read_columns, read_datetimes_ns, times_ns
from jerkbench.io.files import named_folder
from jerkbench.io.frames import (
    ACCEL_UNITS,
    ANGLE_UNITS,
    FLU_FROM_FRD,
    FRAMES,
    GYRO_UNITS,
    HEIGHT_UNITS,
    SPEED_UNITS,
    axes_matrix,
    covariance_in_enu,
    enu_from,
    turned_covariance,
)
from jerkbench.io.rtklib import POS_COVARIANCE, POS_PLACE, POS_VELOCITY, POS_VELOCITY_COVARIANCE
from jerkbench.io.sanitiser import MIN_DATE_NS, ordered_rows, possible_rows
from jerkbench.io.text import TextFormat, cut_note
from jerkbench.recording import Origin, Reference

_RTKLIB = [0, 3, 5, 3, 1, 4, 5, 4, 2]
_UPPER = [0, 3, 4, 3, 1, 5, 4, 5, 2]
"""Where the nine elements of a matrix stand: of RTKLIB's six (11 22 33 12 23 31), of the upper half's six."""


class CovarianceMap(NamedTuple):
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
    """Return (n, 3, 3) in ENU, and notes that count those that are not positive definite, and rows that have none.

    Of the first the sizes of the variances alone are used: rounding makes them so, or a solution that was no minimum,
    of which RTKLIB writes a negative standard deviation. A row with empty cells has ``sigma_otherwise``.

    Raises:
        RecordingError: there is no such column, a cell is no number, or the axes are those of ECEF and the place on
            Earth is not known.
    """
    otherwise = mapping.sigma_otherwise**2 * np.eye(3)
    if not mapping.covariance and not mapping.sigma:
        return np.tile(otherwise, (len(columns), 1, 1)), ()
    matrices = _matrices(columns, mapping)
    empty = ~columns.rows_of(mapping.covariance or mapping.sigma)
    matrices = np.where(empty[:, None, None], otherwise, matrices)
    diagonal = np.abs(matrices * np.eye(3))
    sound = positive_definite(matrices) | ~positive_definite(diagonal)
    turned = _in_enu(columns.where, np.where(sound[:, None, None], matrices, diagonal), mapping.frame, origin)
    count = int((~sound).sum())
    name, notes = Path(columns.where).name, []
    if count:
        few = f"{count} of {len(columns)} covariances of {name} are not positive definite"
        notes.append(f"{few}: the sizes of their variances alone are used.")
    if empty.any():
        few = f"{int(empty.sum())} of {len(columns)} rows of {name} have no standard deviation"
        notes.append(f"{few}: {mapping.sigma_otherwise:g} is taken.")
    return turned, tuple(notes)


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


def _in_enu(where: str, matrices: FloatArray, frame: str, origin: Origin | None) -> FloatArray:
    """Turned into ENU and symmetric to the bit; of local axes one that is NaN stays alone."""
    if frame in ("enu", "ned"):
        return covariance_in_enu(matrices, frame)
    if origin is None:
        raise RecordingError(f"{where} has axes of ECEF, and where it is on the Earth is not known; give origin.")
    return turned_covariance(enu_axes(origin), matrices)


class AttitudeMap(NamedTuple):
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
    attitude, by_angles = columns.numbers(mapping.angles), len(mapping.angles) == 3
    if by_angles and mapping.unit == "deg":
        attitude = np.radians(attitude)
    known = np.isfinite(attitude).all(axis=1)
    if not by_angles:
        known &= np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0  # a quaternion of zeros is none
    euler_rad = np.full((len(attitude), 3), np.nan)
    if known.any():
        turns = dcm_from_euler(attitude[known]) if by_angles else dcm_from_quaternion(attitude[known][:, [1, 2, 3, 0]])
        axes = axes_matrix(mapping.imu_axes) if mapping.body == "sensor" else np.eye(3)
        flu_from_body = FLU_FROM_FRD if mapping.body == "frd" else axes
        euler_rad[known] = euler_from_dcm(enu_from(mapping.frame) @ turns @ flu_from_body.T)
    return euler_rad


EPOCHS = ("gps", "none", "unix")
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
    "velocity_unit": tuple(SPEED_UNITS),
    "epoch": EPOCHS,
    "attitude_frame": ("", "enu", "ned"),
    **dict.fromkeys(("position_frame", "reference_frame"), FRAMES),
    "position_covariance_frame": COVARIANCE_FRAMES,
    "velocity_frame": ("enu", "ned", "ecef", "body", "speed"),
    "reference_body": ("flu", "frd", "sensor"),
}
"""What each parameter may be."""

_SIGMAS = (0, 1, 3, 6)
_COVARIANCES = (0, 1, 3, 6, 9)
"""How many columns there may be of standard deviations and of variances and covariances."""

_COUNTS: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(("imu_accel", "imu_gyro", "position_columns"), (3,)),
    "position_sigma": _SIGMAS,
    "position_covariance": _COVARIANCES,
    "velocity_columns": (3,),
    "velocity_sigma": _SIGMAS,
    "velocity_covariance": _COVARIANCES,
    "reference_position": (0, 3),
    "reference_sigma": (0, 1, 3),
    "reference_velocity": (0, 3),
    "reference_attitude": (0, 3, 4),
    "reference_offset_m": (3,),
}
"""How many columns or numbers each parameter may have."""


def require_columns(table: object, velocity_frame: str) -> None:
    """Raise a PluginError that names the first of the parameters with another number of columns than it may have."""
    speed = {"velocity_columns": (1,), "velocity_sigma": (0, 1), "velocity_covariance": (0, 1)}
    require_lengths(table, _COUNTS | (speed if velocity_frame == "speed" else {}))
    for stream in ("position", "velocity"):
        if getattr(table, f"{stream}_sigma") and getattr(table, f"{stream}_covariance"):
            raise PluginError(
                f"dataset table: {stream}_sigma and {stream}_covariance are both given; leave one of them empty."
            )


MIN_STEPS = 4
"""Of fewer steps nobody can say which is odd."""

SOLUTION_SETTINGS: dict[str, dict[str, Any]] = {
    "position": {
        "position_columns": POS_PLACE,
        "position_frame": "geodetic",
        "position_sigma": (),
        "position_covariance": POS_COVARIANCE,
        "position_covariance_frame": "enu",
    },
    "velocity": {
        "velocity_columns": POS_VELOCITY,
        "velocity_frame": "enu",
        "velocity_sigma": (),
        "velocity_covariance": POS_VELOCITY_COVARIANCE,
    },
    "reference": {
        "reference_position": POS_PLACE,
        "reference_velocity": POS_VELOCITY,
        "reference_attitude": (),
        "reference_frame": "geodetic",
        "reference_sigma": (),
    },
}
"""The parameters of a stream whose file is a solution of RTKLIB."""


class Source(NamedTuple):
    """Where a stream stands.

    Attributes:
        name: imu, position, velocity or reference.
        file: a name, or a pattern of several; empty: there is no such stream.
        time: column of its times; empty: they are in a file of dates.
        shift_s: added to its stamps.
        unit: of its times; empty: that of all streams.
        qualities: of a solution of RTKLIB, or in the column ``quality``, the values that are used; empty: all.
        quality: column of the kind of each fix; empty: there is none.
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
        """Whether it is a solution of RTKLIB."""
        return self.file.endswith(SOLUTION)

    @property
    def parameter(self) -> str:
        """The parameter that names the file."""
        return f"{self.name}_file"

    @property
    def shift_ns(self) -> int:
        """Nanoseconds that are added to its stamps."""
        return round(self.shift_s * 1e9)


def accepted(where: str, quality: FloatArray, qualities: tuple[float, ...], parameter: str) -> BoolArray:
    """Return (n,) which rows have one of the ``qualities``.

    Raises:
        RecordingError: no row has; lists the qualities of the file.
    """
    rows = np.isin(quality, qualities)
    if not rows.any():
        there = ", ".join(f"{q:g}" for q in np.unique(quality))
        raise RecordingError(f"{where} has no fix with Q in {qualities}; there is Q {there}: add it to {parameter}.")
    return rows


class TableStream(NamedTuple):
    """A file's columns with their stamps.

    Attributes:
        columns: the table, in the file's order.
        t_ns: (n,) stamps of the rows, shifted, since the files' own zero.
    """

    columns: Columns
    t_ns: IntArray

    def only(self, names: Sequence[str]) -> "TableStream":
        """Return the rows in which the stream's columns ``names`` are not all empty, in the order of their stamps.

        The other rows belong to other streams.

        Raises:
            RecordingError: there is no such column, or it has no entry at all.
        """
        rows = self.columns.rows_of(names)
        if not rows.any():
            raise RecordingError(f"{self.columns.where} has no entry in {', '.join(names)}; name other columns.")
        stream = self.at(rows)
        return stream.at(*ordered_rows(stream.name, stream.t_ns))

    def at(self, rows: BoolArray | IntArray, notes: tuple[str, ...] = ()) -> "TableStream":
        """Return only ``rows``, with ``notes`` that say why."""
        return TableStream(self.columns.only(rows).noted(notes), self.t_ns[rows])

    def whole(self) -> "TableStream":
        """Return the stream without a first and a last row whose time alone was cut, and with a note that counts them.

        A time that lost its first digits is so early that the step after it is longer than all the rest; one that lost
        its last ones is before the row above.
        """
        steps = np.diff(self.t_ns)
        if len(steps) < MIN_STEPS or (steps[1:-1] <= 0).any():
            return self
        first, last = bool(steps[0] > steps[1:-1].sum() + abs(steps[-1])), bool(steps[-1] < 0)
        rows = np.arange(len(self.t_ns))
        keep = (rows >= first) & (rows < len(rows) - last)
        return self.at(keep, cut_note(self.name, first=first, last=last))

    @property
    def name(self) -> str:
        """The name of the file, for notes."""
        return Path(self.columns.where).name

    def t_s(self, zero_ns: int) -> FloatArray:
        """Return (n,) seconds since ``zero_ns``."""
        return np.asarray((self.t_ns - zero_ns) * 1e-9, dtype=np.float64)


MATLAB = ".mat"
"""Ending of MATLAB's files, whose variables may be of different lengths."""


@dataclass(frozen=True)
class TimedColumns:
    """What all streams of a table share: the folder, how text is cut, and the time.

    Attributes:
        folder: where the files are; "fetched:NAME" is what `jerkbench data fetch NAME` has fetched.
        separator: between the columns of a text; empty: white space. Parquet needs none.
        header: whether a line above the data names the columns: the first of as many fields (others, a title or units,
            are left out). If not, and in a file without such a line, they are numbered from 1.
        comment: what a line to be left out begins with.
        time_unit: of every column of times: s, ms, us or ns; a stream may have one of its own.
        time_week: the column of GPS weeks, where the times are those of the week; empty: they are not. Dates (ISO 8601)
            and stamps such as 2374:243258.5 (week and time of week) say all themselves.
        time_file: a file, or a pattern, of UTC dates and times, one a row, for a stream whose column of times is empty.
        epoch: what the times count from: unix (1970, UTC), gps (1980, GPS time), or none (unknown).
        gpst_minus_utc_s: leap seconds; 18 since 2017.
        drop_leaps: drop fixes that no vehicle can have reached from their neighbours; false: they are what is studied.
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
        """Return the files that fit the pattern.

        Raises:
            RecordingError: there is none; names the ``parameter`` that the pattern is from.
        """
        return find_tables(named_folder(self.folder), pattern, parameter)

    def read(self, source: Source) -> TableStream:
        """Return a stream.

        Raises:
            RecordingError: a file is missing or damaged, or there are not as many dates as rows.
        """
        text = TextFormat(self.separator, self.header, self.comment)
        columns = read_columns(self.files(source.file, source.parameter), text, self.gpst_minus_utc_s)
        if source.file.endswith(MATLAB) and source.time:
            columns = columns.only(columns.rows_of([source.time]))
        if source.quality and source.qualities:
            quality = columns.numbers([source.quality])[:, 0]
            columns = columns.only(accepted(columns.where, quality, source.qualities, f"{source.name}_quality"))
        t_ns = self._stamps_ns(columns, source)
        if len(t_ns) != len(columns):
            rows = f"{columns.where} has {len(columns)} rows, {self.time_file} has {len(t_ns)} times"
            raise RecordingError(f"{rows}; they must be the same.")
        stream = TableStream(columns, t_ns + source.shift_ns).whole()
        utc_ns = self._utc_ns(stream.t_ns)
        return stream if utc_ns is None else stream.at(*possible_rows(stream.name, utc_ns=utc_ns))

    def _zero_gpst_ns(self, source: Source) -> int:
        """The GPST, in nanoseconds of its calendar since 1970, from which the tables' times count.

        Raises:
            PluginError: nobody knows.
        """
        if self.epoch == "none":
            raise PluginError(
                f"dataset table: {source.parameter} is '{source.file}', in GPS time or UTC; epoch must be gps or unix."
            )
        return GPS_EPOCH_NS if self.epoch == "gps" else round(self.gpst_minus_utc_s * 1e9)

    def start_utc(self, zero_ns: int) -> datetime | None:
        """Return the UTC of ``zero_ns``, or None if the epoch is "none".

        Relative times give a date in 1970. It is not printed, but trajectories with the same times are aligned by it.
        """
        epoch_ns = self._epoch_ns
        return None if epoch_ns is None else UNIX_EPOCH + timedelta(microseconds=(zero_ns + epoch_ns) // 1000)

    @property
    def _epoch_ns(self) -> int | None:
        """UTC of time 0 since 1970."""
        return {"unix": 0, "gps": GPS_EPOCH_NS - round(self.gpst_minus_utc_s * 1e9)}.get(self.epoch)

    def _utc_ns(self, t_ns: IntArray) -> IntArray | None:
        """UTC since 1970; None where it is unknown: the epoch is "none", or no stamp is as late as a date."""
        zero_ns = self._epoch_ns
        return None if zero_ns is None or (t_ns + zero_ns < MIN_DATE_NS).all() else t_ns + zero_ns

    def _stamps_ns(self, columns: Columns, source: Source) -> IntArray:
        if source.time:
            dates_ns = columns.dates_ns(source.time, self.gpst_minus_utc_s)
            if dates_ns is not None:
                return dates_ns + round(self.gpst_minus_utc_s * 1e9) - self._zero_gpst_ns(source)
            return times_ns(columns, source.time, source.unit or self.time_unit, self.time_week)
        return np.concatenate([read_datetimes_ns(path) for path in self.files(self.time_file, "time_file")])


# How good the reference is: its own sigma, and the epochs at which it is too bad to count.


def with_sigma(reference: Reference, sigma_m: FloatArray | None, worst_m: float) -> tuple[Reference, tuple[str, ...]]:
    """Return the reference with its sigma (k, 3), and what a reader of a table has to know of it.

    Args:
        reference: with its k stamps.
        sigma_m: one standard deviation of east, north and up; None: not known.
        worst_m: errors do not count where sqrt(sum of sigma^2) is larger, or is no number; 0: they count everywhere.
    """
    if sigma_m is None:
        return reference, ()
    size_m = np.sqrt((sigma_m**2).sum(axis=1))
    good = np.isfinite(size_m) & ((size_m <= worst_m) if worst_m else True)
    reference = dataclasses.replace(reference, sigma_m=sigma_m, scored=reference.scored & good)
    floor_m = float(np.sqrt(np.mean(size_m[good] ** 2))) if good.any() else float("nan")
    known = f"The reference is known to {floor_m:.3g} m (3-D, one sigma)"
    notes = [f"{known}: a perfect estimate has that RMSE, and smaller differences get no verdict."]
    if not good.all():
        notes.append(f"{int((~good).sum())} of {len(good)} epochs of the reference are too bad: they do not count.")
    return reference, tuple(notes)
