"""Parts of a recording from the columns of a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.readers.columns import Columns, TextFormat, find_tables, read_columns, read_datetimes_ns, times_ns
from jerkbench.readers.frames import axes_in_enu
from jerkbench.recording import Position, Reference, Velocity

_FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Clock:
    """How the times of a table are to be read.

    Attributes:
        unit: of the columns of times: s, ms, us or ns.
        week: column of GPS weeks, where the times are of the week; empty: they are not.
        dates: a file of dates and times for a stream without such a column.
    """

    unit: str
    week: str
    dates: str


@dataclass(frozen=True, eq=False)
class Stream:
    """A file's columns with their stamps.

    Attributes:
        columns: the table, in the file's order.
        t_ns: (n,) stamps of the rows, shifted, since the files' own zero.
    """

    columns: Columns
    t_ns: IntArray

    @classmethod
    def read(
        cls, folder: str, named: tuple[str, str], text: TextFormat, column: str, clock: Clock, shift_s: float
    ) -> Self:
        """Read a stream.

        Args:
            folder: where its files are.
            named: what it is called, and the name or pattern of its files.
            text: how text is cut into columns.
            column: of its times.
            clock: how these are to be read.
            shift_s: added to the stamps.

        Raises:
            RecordingError: a file is missing or damaged, or there are not as many dates as rows.
        """
        name, file = named
        columns = read_columns(cls.files(folder, file, f"{name}_file"), text)
        if column:
            t_ns = times_ns(columns, column, clock.unit, clock.week)
        else:
            t_ns = read_datetimes_ns(cls.files(folder, clock.dates, "time_file")[0])
        if len(t_ns) != len(columns):
            raise RecordingError(
                f"{columns.where} has {len(columns)} rows, {clock.dates} has {len(t_ns)} times; they must be the same."
            )
        return cls(columns, t_ns + round(shift_s * 1e9))

    def only(self, names: Sequence[str]) -> "Stream":
        """Return the rows in which the stream's columns ``names`` are not all empty: others belong to other streams.

        Raises:
            RecordingError: there is no such column, or it has no entry at all.
        """
        rows = self.columns.rows_of(names)
        if not rows.any():
            raise RecordingError(f"{self.columns.where} has no entry in {', '.join(names)}; name other columns.")
        return self if rows.all() else Stream(self.columns.only(rows), self.t_ns[rows])

    @staticmethod
    def files(folder: str, pattern: str, parameter: str) -> tuple[Path, ...]:
        """Return the files that fit the pattern."""
        return find_tables(Path(folder).expanduser(), pattern, parameter)

    def t_s(self, zero_ns: int) -> FloatArray:
        """Return (n,) seconds since ``zero_ns``."""
        return np.asarray((self.t_ns - zero_ns) * 1e-9, dtype=np.float64)


def covariances(values: FloatArray, sigma: FloatArray, otherwise: float) -> FloatArray:
    """Return (n, 3, 3) diagonal covariances from columns of sigmas: three, one for all axes, or none."""
    sigmas = np.broadcast_to(sigma, values.shape) if sigma.shape[1] else np.full(values.shape, otherwise)
    return np.asarray(np.einsum("ki,ij->kij", sigmas**2, np.eye(3)))


def velocity_of(t_s: FloatArray, values: FloatArray, frame: str, sigma_mps: float) -> Velocity:
    """Return a velocity given in enu, ned, body (FLU) or as a speed."""
    if frame == "speed":
        return Velocity.along_course(t_s, values[:, 0], sigma_mps)
    covariance = np.tile(sigma_mps**2 * np.eye(3), (len(t_s), 1, 1))
    if frame == "body":
        return Velocity(t_s, values, covariance, "body")
    return Velocity(t_s, axes_in_enu(values, frame), covariance)


def attitude_in_flu(attitude: FloatArray, turn: FloatArray, body: str, sensor: FloatArray | None) -> FloatArray:
    """Return (n, 3) roll, pitch, yaw of the FLU body in ENU.

    Args:
        attitude: (n, 3) roll, pitch, yaw [rad], or (n, 4) w, x, y, z: from the body to the local frame; NaN: unknown.
        turn: (3, 3) from the local frame to ENU.
        body: "flu", "frd" or "sensor".
        sensor: (3, 3) f_flu = M f_sensor, where the body is the sensor.
    """
    known = np.isfinite(attitude).all(axis=1)
    euler_rad = np.full((len(attitude), 3), np.nan)
    if attitude.shape[1] == 4:
        known &= np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0
    if known.any():
        by_angles = attitude.shape[1] == 3
        angles_or_wxyz = attitude[known]
        given = dcm_from_euler(angles_or_wxyz) if by_angles else dcm_from_quaternion(angles_or_wxyz[:, [1, 2, 3, 0]])
        euler_rad[known] = euler_from_dcm(turn @ given @ _flu_from(body, sensor).T)
    return euler_rad


def _flu_from(body: str, sensor: FloatArray | None) -> FloatArray:
    """Return (3, 3) f_flu = M f_body."""
    if body == "frd":
        return _FLU_FROM_FRD
    return sensor if body == "sensor" and sensor is not None else np.eye(3)


def fixes_as_reference(position: Position | None, t_s: FloatArray) -> Reference:
    """Return the fixes as their own reference; without any, a reference that knows nothing at ``t_s``."""
    if position is None:
        return Reference(t_s, source="none", independent=False)
    return Reference(position.t_s, source="the fixes themselves", independent=False, enu_m=position.enu_m)
