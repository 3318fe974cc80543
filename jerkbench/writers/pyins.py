"""A recording as the tables of pyins (python-ins): its names, NED, the body FRD, degrees."""

from functools import partial
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.files import write_atomically
from jerkbench.geometry import dcm_from_euler, enu_to_geodetic, euler_from_dcm
from jerkbench.writers.kf_gins import FLU_FROM_FRD
from jerkbench.readers.frames import axes_in_enu, enu_from
from jerkbench.recording import Recording


PLACE, VELOCITY, ANGLES = ("lat", "lon", "alt"), ("VN", "VE", "VD"), ("roll", "pitch", "heading")
IMU = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")

Frame = dict[str, FloatArray]


def write_pyins(recording: Recording, attitude: Attitude | None, folder: Path) -> list[Path]:
    """Write imu.csv, position.csv and, where there are such, velocity.csv and attitude.csv; returns the files.

    The first column is the time, the index of pyins' tables; ``sd`` is the root of the mean variance, as pyins takes
    one standard deviation for all axes and times.

    Raises:
        RecordingError: the recording has no IMU or no origin.
    """
    frames = pyins_frames(recording, attitude)
    for name, frame in frames.items():
        write_atomically(folder / f"{name}.csv", partial(_write, frame))
    return [folder / f"{name}.csv" for name in frames]


def pyins_frames(recording: Recording, attitude: Attitude | None) -> dict[str, Frame]:
    """Return each table as its columns.

    Raises:
        RecordingError: as above.
    """
    if recording.imu is None or recording.origin is None:
        raise RecordingError(f"{recording.name} cannot be written for pyins, which needs an IMU and an origin.")
    imu, position, velocity = recording.imu, recording.position, recording.velocity
    measured = np.hstack([imu.gyro_radps @ FLU_FROM_FRD, imu.accel_mps2 @ FLU_FROM_FRD])
    frames = {"imu": _frame(imu.t_s, IMU, measured)}
    if position is not None:
        places = _frame(position.t_s, PLACE, enu_to_geodetic(position.enu_m, recording.origin))
        frames["position"] = places | {"sd": _deviations(position.covariance_m2)}
    if velocity is not None and velocity.frame == "enu":
        ned = _frame(velocity.t_s, VELOCITY, axes_in_enu(velocity.mps, "ned"))  # the exchange is its own inverse
        frames["velocity"] = ned | {"sd": _deviations(velocity.covariance_m2ps2)}
    if attitude is not None:
        turns = enu_from("ned").T @ dcm_from_euler(attitude.euler_rad) @ FLU_FROM_FRD
        frames["attitude"] = _frame(attitude.t_s, ANGLES, np.degrees(euler_from_dcm(turns)))
    return frames


def _write(frame: Frame, path: Path) -> None:
    import pandas as pd

    pd.DataFrame(frame).to_csv(path, index=False, float_format="%.14g")


def _frame(t_s: FloatArray, names: tuple[str, ...], values: FloatArray) -> Frame:
    return {"time": t_s, **dict(zip(names, values.T, strict=True))}


def _deviations(covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 3.0))
