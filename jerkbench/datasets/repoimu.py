"""RepoIMU's TStick: a hand-held stick with an IMU beside optical motion capture, as Parquet."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pandas as pd

from jerkbench.datasets.broad import BroadTrial, recording_of
from jerkbench.errors import RecordingError
from jerkbench.io.files import fingerprint, named_folder
from jerkbench.io.text import require_content
from jerkbench.plugins import register
from jerkbench.recording import Recording

RATE_HZ = 100.0
ACCEL, GYRO, ATTITUDE = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["qw", "qx", "qy", "qz"]


@register("dataset", "repoimu")
@dataclass(frozen=True)
class RepoImu:
    """A trial of RepoIMU's TStick: tilt alone, a stick in a hand against optical motion capture, 100 Hz.

    The stick lies still for two to four seconds and is then swung by hand for a minute and a half. Gravity and the
    frame of the motion capture differ by about 1.4 degrees in some tests: no error below that means anything there.

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
    """

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"
    attitude_only: ClassVar[bool] = True

    folder: str = ""
    test: int = 2
    trial: int = 1
    remove_gyro_bias: bool = True

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
        return recording_of(path.stem, t_s, trial, remove_gyro_bias=self.remove_gyro_bias)

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the trial's file."""
        return fingerprint((self._path(),))

    def _path(self) -> Path:
        return named_folder(self.folder) / f"TStick_Test{self.test:02d}_Trial{self.trial}.parquet"
