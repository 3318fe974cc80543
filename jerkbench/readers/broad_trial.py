"""A trial of BROAD: a hand-held IMU beside optical motion capture, as HDF5 or as a MATLAB file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.text import require_content, require_possible

COLUMNS = {"imu_acc": 3, "imu_gyr": 3, "opt_quat": 4, "movement": 1}
"""Fields that are read, and how many columns each has; magnetometer and optical position are left alone."""

MOST = {"imu_acc": 1e3, "imu_gyr": 1e2, "opt_quat": 2.0, "movement": 1.0}
"""The largest possible values [m/s2, rad/s]; larger ones are damage."""

LEAST_SAMPLES = 2


@dataclass(frozen=True, eq=False)
class BroadTrial:
    """A trial in the sensor's own axes.

    Attributes:
        rate_hz: samples a second.
        accel_mps2: (n, 3) specific force.
        gyro_radps: (n, 3) angular rate.
        quaternion_wxyz: (n, 4) ENU <- sensor; NaN where markers were lost.
        movement: (n,) whether the sample belongs to the movement, which is what counts.
    """

    rate_hz: float
    accel_mps2: FloatArray
    gyro_radps: FloatArray
    quaternion_wxyz: FloatArray
    movement: BoolArray


def read_broad_trial(path: Path) -> BroadTrial:
    """Read ``path``, which ends in .hdf5 or .mat.

    Raises:
        RecordingError: no such file, it is damaged, or a field is missing or has another shape; names file and field.
    """
    require_content(path)
    fields = _matlab(path) if path.suffix == ".mat" else _hdf5(path)
    samples = len(np.atleast_1d(fields.get("imu_acc", ())))
    arrays = {name: _array(path, fields, name, samples) for name in COLUMNS}
    return BroadTrial(
        rate_hz=_rate(path, fields),
        accel_mps2=arrays["imu_acc"],
        gyro_radps=arrays["imu_gyr"],
        quaternion_wxyz=arrays["opt_quat"],
        movement=arrays["movement"][:, 0] > 0,
    )


def _hdf5(path: Path) -> dict[str, Any]:
    import h5py

    try:
        with h5py.File(path) as file:
            fields = {name: file[name][()] for name in COLUMNS if name in file}
            return {**fields, "sampling_rate": file.attrs.get("sampling_rate")}
    except (OSError, RuntimeError, KeyError, AttributeError, TypeError) as error:  # h5py raises any of them
        raise _damaged(path, "an HDF5 file", error) from error


def _matlab(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        fields: dict[str, Any] = loadmat(path, variable_names=[*COLUMNS, "sampling_rate"])
    except Exception as error:  # scipy documents none of what a damaged file makes it raise
        raise _damaged(path, "a MATLAB file (version 5)", error) from error
    return fields


def _damaged(path: Path, kind: str, error: Exception) -> RecordingError:
    return RecordingError(f"{path} cannot be read as {kind} ({type(error).__name__}: {error}); copy it again.")


def _array(path: Path, fields: Mapping[str, Any], name: str, samples: int) -> FloatArray:
    columns = COLUMNS[name]
    if name not in fields:
        raise RecordingError(f"{path} has no field {name}; a trial of BROAD has {', '.join(COLUMNS)}.")
    try:
        array = np.asarray(fields[name], dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    wanted = (samples, columns)
    if array.size != samples * columns or len(array) != samples or samples < LEAST_SAMPLES:
        raise RecordingError(f"{path}: {name} has shape {array.shape}; it must be {wanted}, numbers, and not empty.")
    require_possible(f"{path}, {name}", array, MOST[name])
    return array.reshape(wanted)


def _rate(path: Path, fields: Mapping[str, Any]) -> float:
    try:
        rate_hz = float(np.asarray(fields.get("sampling_rate"), dtype=np.float64).item())
    except (TypeError, ValueError):
        rate_hz = float("nan")
    if not 0 < rate_hz < np.inf:
        raise RecordingError(f"{path}: sampling_rate is {fields.get('sampling_rate')}; it must be a positive number.")
    return rate_hz
