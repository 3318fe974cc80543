"""A minute of comma2k19: NumPy arrays without ending, in a fixed tree of folders."""

from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.text import LARGEST, require_content, require_possible

POSE, LOG = "global_pose", "processed_log"
COLUMNS = {
    f"{POSE}/frame_times": 1,
    f"{POSE}/frame_positions": 3,
    f"{POSE}/frame_velocities": 3,
    f"{POSE}/frame_orientations": 4,
    f"{LOG}/IMU/accelerometer/t": 1,
    f"{LOG}/IMU/accelerometer/value": 3,
    f"{LOG}/IMU/gyro/value": 3,
    f"{LOG}/GNSS/live_gnss_ublox/t": 1,
    f"{LOG}/GNSS/live_gnss_ublox/value": 6,
    f"{LOG}/CAN/speed/t": 1,
    f"{LOG}/CAN/speed/value": 1,
}
"""Arrays that are read, and how many columns each has."""

NO_ARRAY = (ValueError, EOFError, OSError, TypeError, SyntaxError, TokenError, MemoryError, OverflowError)
"""Errors of a damaged NumPy file."""

STREAMS = {
    "frames": (0, 1, 2, 3),
    "imu": (4, 5, 6),
    "gnss": (7, 8),
    "wheel": (9, 10),
}
"""Groups of arrays with the same number of rows."""

MOST = {
    f"{LOG}/IMU/accelerometer/value": 1e3,
    f"{LOG}/IMU/gyro/value": 1e2,
    f"{LOG}/CAN/speed/value": 2e2,
    f"{POSE}/frame_positions": 1e7,
    f"{POSE}/frame_velocities": 2e2,
}
"""The largest possible values [m/s2, rad/s, m/s, m]; larger ones are damage."""


@dataclass(frozen=True, eq=False)
class CommaSegment:
    """The arrays, at the stamps of the log [s since the device started].

    Attributes:
        frame_log_s: (k,) stamps of the camera's frames.
        frame_ecef_m: (k, 3) reference position, ECEF.
        frame_ecef_mps: (k, 3) reference velocity, ECEF.
        frame_wxyz: (k, 4) ECEF <- device (forward, right, down).
        imu_log_s: (n,).
        accel_mps2: (n, 3) specific force, forward, right, down.
        gyro_radps: (n, 3) the same axes, less the bias that the device had found.
        gnss_log_s: (m,) when the fix was logged.
        gnss: (m, 6) latitude, longitude [deg], speed [m/s], UTC [ms], height [m, ellipsoid], bearing [deg].
        wheel_log_s: (w,).
        wheel_mps: (w,) speed on the car's bus.
    """

    frame_log_s: FloatArray
    frame_ecef_m: FloatArray
    frame_ecef_mps: FloatArray
    frame_wxyz: FloatArray
    imu_log_s: FloatArray
    accel_mps2: FloatArray
    gyro_radps: FloatArray
    gnss_log_s: FloatArray
    gnss: FloatArray
    wheel_log_s: FloatArray
    wheel_mps: FloatArray


def read_comma_segment(folder: Path) -> CommaSegment:
    """Read the folder that holds global_pose and processed_log.

    Raises:
        RecordingError: a file is missing, is no NumPy array, or has another shape than the others ask for.
    """
    arrays = [_read(folder / name, columns, MOST.get(name, LARGEST)) for name, columns in COLUMNS.items()]
    names = list(COLUMNS)
    for rows in STREAMS.values():
        lengths = {len(arrays[row]) for row in rows}
        if len(lengths) > 1 or min(lengths) < 2:
            counts = ", ".join(f"{names[row]} {len(arrays[row])}" for row in rows)
            raise RecordingError(f"{folder}: rows of {counts}; they must be the same, 2 or more: copy the files again.")
    flat = [array[:, 0] if columns == 1 else array for array, columns in zip(arrays, COLUMNS.values(), strict=True)]
    return CommaSegment(*flat)


def segment_files(folder: Path) -> tuple[Path, ...]:
    """Return the files that are read.

    Raises:
        RecordingError: one is missing.
    """
    paths = tuple(folder / name for name in COLUMNS)
    for path in paths:
        if not path.is_file():
            raise RecordingError(f"There is no file {path}; give the folder with {POSE} and {LOG} of a segment.")
    return paths


def _read(path: Path, columns: int, most: float) -> FloatArray:
    require_content(path)
    try:
        array = np.asarray(np.load(path, allow_pickle=False), dtype=np.float64)
    except NO_ARRAY as error:
        raise RecordingError(f"{path} cannot be read as a NumPy array ({error}); copy it again.") from error
    table = array.reshape(len(array), -1) if array.ndim in (1, 2) and array.size else np.empty((0, 0))
    if table.shape[1] != columns:
        raise RecordingError(f"{path} has shape {array.shape}; it must have {columns} columns.")
    if not np.isfinite(table).all():
        raise RecordingError(f"{path} holds NaN or infinity; copy it again.")
    require_possible(str(path), table, most)
    return table
