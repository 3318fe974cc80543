"""RepoIMU's TStick: a hand-held stick with an IMU beside optical motion capture, as Parquet."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.datasets.broad import BroadTrial, recording_of
from jerkbench.errors import RecordingError
from jerkbench.geometry import best_rotation, dcm_from_euler, roll_pitch
from jerkbench.io.files import fingerprint, named_folder
from jerkbench.io.text import require_content
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording

RATE_HZ = 100.0
SATURATED_RADPS = 7.3
"""The gyro shows no more."""

WINDOW_S, SOUND = 10.0, 0.05
"""Over so long the mean specific force is gravity, but for such a share."""

ACCEL, GYRO, ATTITUDE = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["qw", "qx", "qy", "qz"]


@register("dataset", "repoimu")
@dataclass(frozen=True)
class RepoImu:
    """A trial of RepoIMU's TStick: tilt alone, a stick in a hand against optical motion capture, 100 Hz.

    The stick lies still for two to four seconds and is then swung by hand for a minute and a half. As published, the
    reference shows a body that is turned by 2.8 degrees to the IMU, in a frame that is tilted by 1.7 degrees: every
    filter then has the same error. Both are constant, and need no filter to be found::

        B = the rotation with the least sum of |w_k - B y_G,k|^2,  w_k the rate that the reference shows
        T u = e3,  u = mean of q_k B y_A,k, normalised;   reference = T q_k B

    After marks were lost (Test05) the reference is wrong for up to a minute. A sample counts where the mean of q_k y_A
    over ten seconds around it has the length of gravity, within 5 %: no hand accelerates for that long. In Test05 the
    gyro saturates as well, at 7.36 rad/s.

    Each trial is a Parquet file ``TStick_Test02_Trial1.parquet`` with the columns t_s; ax, ay, az [m/s2]; gx, gy, gz
    [rad/s], in the sensor's axes; qw, qx, qy, qz, sensor to a frame whose z is up; movement (1: scored). No licence of
    the original is stated, so that it cannot be fetched: export the published CSV to these columns.

    Source: A. Szczesna and others, Annals of Computer Science and Information Systems 8, 2016;
    github.com/agnieszkaszczesna/RepoIMU.

    Attributes:
        folder: where the files of the trials are.
        test: number of the test.
        trial: number of the trial within it.
        remove_gyro_bias: subtract the gyro's mean over the first rest.
        align_reference: turn the reference by T and B, and score it where it is sound; otherwise as published.
    """

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"
    attitude_only: ClassVar[bool] = True

    folder: str = ""
    test: int = 2
    trial: int = 1
    remove_gyro_bias: bool = True
    align_reference: bool = True

    def load(self, seed: int = 0) -> Recording:
        """Return the trial; ``seed`` changes nothing.

        Raises:
            RecordingError: the file is missing or damaged, or lacks a column.
        """
        path = self._path()
        require_content(path)
        try:
            table = pd.read_parquet(path, columns=["t_s", *ACCEL, *GYRO, *ATTITUDE, "movement"]).astype(float)
        except (OSError, ValueError, KeyError) as error:  # pyarrow's errors are of the first two
            raise RecordingError(f"{path} cannot be read as a trial of RepoIMU ({error}).") from error
        accel, gyro, attitude = (table[columns].to_numpy() for columns in (ACCEL, GYRO, ATTITUDE))
        trial = BroadTrial(RATE_HZ, accel, gyro, attitude, table["movement"].to_numpy() > 0)
        t_s = (table["t_s"] - table["t_s"].iloc[0]).to_numpy()
        if self.align_reference:
            without_bias = recording_of(path.stem, t_s, trial, remove_gyro_bias=True).inertial
            trial = aligned(trial, without_bias)
        return recording_of(path.stem, t_s, trial, remove_gyro_bias=self.remove_gyro_bias)

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the trial's file."""
        return fingerprint((self._path(),))

    def _path(self) -> Path:
        return named_folder(self.folder) / f"TStick_Test{self.test:02d}_Trial{self.trial}.parquet"


def aligned(trial: BroadTrial, imu: Imu) -> BroadTrial:
    """Return the trial with its reference in the axes of the IMU, upright, scored where it agrees with gravity."""
    known: BoolArray = np.asarray(np.isfinite(trial.quaternion_wxyz).all(axis=1))
    q = Rotation.from_quat(np.where(known[:, None], trial.quaternion_wxyz, [1.0, 0.0, 0.0, 0.0]), scalar_first=True)
    accel, gyro = imu.accel_mps2.copy(), imu.gyro_radps[1:]
    mean = uniform_filter1d(q.apply(accel), round(WINDOW_S * RATE_HZ), axis=0, mode="nearest")
    sound = known & (np.abs(np.linalg.norm(mean, axis=1) / GRAVITY_MPS2 - 1) < SOUND)
    rate: FloatArray = (q[:-1].inv() * q[1:]).as_rotvec() * RATE_HZ
    use = sound[1:] & sound[:-1] & (np.abs(gyro).max(axis=1) < SATURATED_RADPS)
    turned = q * Rotation.from_matrix(best_rotation(rate[use], gyro[use]))
    up = turned.apply(accel)[sound].mean(axis=0)
    upright = Rotation.from_matrix(dcm_from_euler(np.array([*roll_pitch(up), 0.0])))
    reference = np.where(known[:, None], (upright * turned).as_quat(scalar_first=True), np.nan)
    return replace(trial, quaternion_wxyz=reference, movement=trial.movement & sound)
