"""A trajectory's file -> positions, velocities, attitudes and covariances in ENU, on the recording's clock."""

from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.datasets._table_values import AttitudeMap, attitude_of
from jerkbench.errors import RecordingError
from jerkbench.external.file_format import TrajectoryForm, form_of
from jerkbench.external.odometry import BAGS, read_odometry
from jerkbench.external.trajectory import Trajectory
from jerkbench.readers.columns import Columns, read_columns, times_ns
from jerkbench.readers.frames import LOCAL_FRAMES, axes_in_enu, in_degrees, in_enu
from jerkbench.readers.gpst import GPS_EPOCH_NS, GPST_MINUS_UTC_S, UNIX_EPOCH, WEEK_NS
from jerkbench.readers.table_text import TextFormat
from jerkbench.recording import Recording

POSITIONS = {
    "enu": ("east_m", "north_m", "up_m"),
    "ned": ("north_m", "east_m", "down_m"),
    "geodetic": ("latitude_deg", "longitude_deg", "height_m"),
    "ecef": ("x_m", "y_m", "z_m"),
}
VELOCITIES = {"enu": ("east_mps", "north_mps", "up_mps"), "ned": ("north_mps", "east_mps", "down_mps")}
ATTITUDE = ("roll_rad", "pitch_rad", "yaw_rad")
UPPER = [(i, j) for i in range(6) for j in range(i, 6)]
COVARIANCE = tuple(f"P{i + 1}{j + 1}" for i, j in UPPER)
"""Names of columns that nobody has to give."""

LATER_THAN_NS = 100_000_000 * 1_000_000_000
"""Stamps beyond this count from 1970: no recording lasts three years."""

STILL = np.array([0.0, 0.0, 0.0])


def read_trajectory(path: Path, declared: TrajectoryForm, recording: Recording) -> Trajectory:
    """Read the trajectory in ``path``.

    Args:
        path: .tum, .nav, .csv, .parquet, .mat, a ROS bag (.bag, .db3, .mcap), or any text of columns.
        declared: the form of files that do not say it themselves.
        recording: on whose clock, and in whose ENU, it is read.

    Raises:
        RecordingError: there is no such file or column, a cell is no finite number, times do not increase, or clock or
            frame cannot be told.
    """
    if not path.is_file():
        raise RecordingError(f"There is no trajectory {path}; correct its name.")
    if path.suffix in BAGS:
        return read_odometry(path, declared.topic, recording)
    form = form_of(path, declared)
    columns = read_columns([path], TextFormat(form.separator, form.header, form.comment))
    if len(columns) == 0:
        raise RecordingError(f"{path} has no estimate in it; write one line for each stamp.")
    t_s = _seconds(columns, form, recording)
    enu_m = _places(columns, form, recording)
    velocity = _velocity(columns, form)
    return Trajectory(str(path), t_s, enu_m, velocity, _attitude(path, columns, form), _covariance(columns, form, t_s))


def _seconds(columns: Columns, form: TrajectoryForm, recording: Recording) -> FloatArray:
    t_ns = times_ns(columns, form.time, form.time_unit, form.time_week) - _zero_ns(columns, form, recording)
    steps = np.diff(t_ns)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 2
        raise RecordingError(f"{columns.where}, row {row}: its time is not after that of the row above; sort the rows.")
    return np.asarray(t_ns * 1e-9)


def _zero_ns(columns: Columns, form: TrajectoryForm, recording: Recording) -> int:
    """The recording's start on the clock of the file."""
    first_ns = int(times_ns(columns, form.time, form.time_unit, form.time_week)[0])
    if form.clock == "start" or not (form.clock or form.time_week or first_ns > LATER_THAN_NS):
        return 0
    if recording.start_utc is None:
        raise RecordingError(
            f"{columns.where} has stamps of a calendar, and nobody knows when {recording.name} began; write seconds"
            " from its start (filter.clock=start)."
        )
    since = recording.start_utc - UNIX_EPOCH
    unix_ns = (since.days * 86_400_000_000 + since.seconds * 1_000_000 + since.microseconds) * 1000
    if not form.time_week:
        return unix_ns
    gps_ns = unix_ns - GPS_EPOCH_NS + round(GPST_MINUS_UTC_S * 1e9)
    return gps_ns if first_ns >= WEEK_NS else gps_ns % WEEK_NS  # week 0 is KF-GINS's for one that it does not know


def _places(columns: Columns, form: TrajectoryForm, recording: Recording) -> FloatArray:
    if form.frame not in LOCAL_FRAMES and recording.origin is None:
        raise RecordingError(
            f"{columns.where} is in the frame {form.frame}, and {recording.name} has no origin on the Earth; write its"
            " local axes (filter.frame=enu or ned)."
        )
    values = _finite(columns, form.position or POSITIONS[form.frame], "position")
    return in_enu(in_degrees(values, form.frame, form.angle_unit), form.frame, recording.origin)


def _velocity(columns: Columns, form: TrajectoryForm) -> FloatArray | None:
    names = form.velocity or _there(columns, VELOCITIES.get(form.local_frame, ()))
    if not names:
        return None
    if form.frame == "ecef":
        raise RecordingError(
            f"{columns.where} is in ECEF, of which positions are read alone; write ENU, NED or geodetic."
        )
    return axes_in_enu(_finite(columns, names, "velocity"), form.local_frame)


def _attitude(path: Path, columns: Columns, form: TrajectoryForm) -> FloatArray | None:
    angles = form.attitude or _there(columns, ATTITUDE)
    frame = form.attitude_frame or ("ned" if form.local_frame == "ned" else "enu")
    mapping = AttitudeMap(
        tuple(angles), form.attitude_unit if form.attitude else "rad", frame, form.body, ("x", "y", "z")
    )
    euler_rad = attitude_of(columns, mapping)
    nothing = path.suffix == ".tum" and euler_rad is not None and bool((np.nan_to_num(euler_rad) == STILL).all())
    return None if nothing else euler_rad  # TUM has no way to leave a rotation out: the identity stands for it


def _covariance(columns: Columns, form: TrajectoryForm, t_s: FloatArray) -> FloatArray | None:
    """(n, 6, 6) in ENU; what is not given of it is NaN."""
    names = form.covariance or _there(columns, COVARIANCE)
    if not names:
        return None
    values, n = _finite(columns, names, "covariance"), len(t_s)
    covariance = np.full((n, 6, 6), np.nan)
    if len(names) == 36:
        covariance = values.reshape(n, 6, 6)
    elif len(names) == 21:
        i, j = np.array(UPPER).T
        covariance[:, i, j] = covariance[:, j, i] = values
    else:
        states = slice(0, len(names))
        covariance[:, states, states] = values[:, :, None] * np.eye(len(names))
    return _in_enu(covariance) if form.local_frame == "ned" else covariance


def _in_enu(covariance: FloatArray) -> FloatArray:
    """Turn (n, 6, 6) from NED into ENU; axes are only exchanged and mirrored, so that one that is NaN stays alone."""
    places, signs = [1, 0, 2, 4, 3, 5], np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
    return np.asarray(covariance[:, places][:, :, places] * np.outer(signs, signs))


def _there(columns: Columns, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return ``names`` if the table has all of them, else none."""
    return names if columns.has(names) else ()


def _finite(columns: Columns, names: tuple[str, ...], quantity: str) -> FloatArray:
    values = columns.numbers(names)
    wrong = ~np.isfinite(values)
    if wrong.any():
        row, place = (int(k[0]) for k in np.nonzero(wrong))
        raise RecordingError(
            f"{columns.where}, row {row + 1}: the {quantity} ({names[place]}) is no finite number; write one at each"
            " stamp, or end the file where the estimate ends."
        )
    return values
