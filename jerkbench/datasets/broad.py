"""BROAD: a hand-held IMU beside optical motion capture; the attitude is all there is to estimate."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import euler_from_quaternion
from jerkbench.plugins import register
from jerkbench.readers.broad_trial import BroadTrial, read_broad_trial
from jerkbench.readers.fetched import recording_folder
from jerkbench.readers.files import fingerprint
from jerkbench.readers.standstill import without_gyro_bias
from jerkbench.recording import Imu, Recording, Reference

ENDINGS = (".hdf5", ".mat")
STILL_MARGIN_S = 1.0
"""How long before the marked movement the first rest is taken to end: the hand is at the sensor already."""

NOTES = (
    "There is no position and no heading: the tilt alone is estimated, and yaw is not scored.",
    "Rows count where the trial is marked as movement and the optical attitude is known.",
)


@register("dataset", "broad")
@dataclass(frozen=True)
class Broad:
    """A trial of BROAD: tilt alone, a hand-held IMU against optical motion capture.

    The IMU lies still for half a minute, is then moved by hand, and lies still again; 285.7 Hz. The filter
    ``attitude_only`` evaluates an attitude filter on it, `inclination` measures its error::

        jerkbench run -m dataset=broad dataset.trial=7,16 attitude=real,gyro_only filter=attitude_only

    The sensor's axes are taken as the body's. The reference's yaw is left out (NaN): the recording holds no heading
    (the magnetometer is not read), so no filter could know it.

    Source: D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation
    Estimation", Data 6(7), 2021, doi:10.3390/data6070072; github.com/dlaidig/broad (CC BY 4.0).

    Attributes:
        folder: where the files of the trials are; empty: where `jerkbench data fetch broad` has put them.
        trial: number of the trial: the file whose name begins with it is read (.hdf5 or .mat).
        remove_gyro_bias: subtract the gyro's mean over the first rest.
    """

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"
    attitude_only: ClassVar[bool] = True

    folder: str = ""
    trial: int = 16
    remove_gyro_bias: bool = True

    def load(self, seed: int = 0) -> Recording:
        """Return the trial; ``seed`` changes nothing.

        Raises:
            RecordingError: the file is missing or damaged, or it does not begin with a rest and the gyro's bias is
                asked for.
        """
        path = self._path()
        trial = read_broad_trial(path)
        t_s = np.arange(len(trial.movement)) / trial.rate_hz
        rest_s = _first_rest_s(trial)
        imu = Imu(t_s, trial.accel_mps2, trial.gyro_radps)
        return Recording(
            name=path.stem,
            imu=without_gyro_bias(imu, rest_s) if self.remove_gyro_bias else imu,
            reference=_reference(t_s, trial),
            static_start_s=rest_s,
            notes=NOTES,
        )

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the trial's file."""
        return fingerprint((self._path(),))

    def _path(self) -> Path:
        folder = recording_folder(self.folder, "broad")
        if not folder.is_dir():
            raise RecordingError(f"There is no folder {folder}; give the one that the trials were copied to.")
        trials = sorted(path for path in folder.iterdir() if path.suffix in ENDINGS and path.is_file())
        named = [path for path in trials if path.name.startswith(f"{self.trial:02d}_")]
        if len(named) == 1:
            return named[0]
        names = ", ".join(path.name for path in (named or trials)) or "no .hdf5 or .mat file"
        raise RecordingError(
            f"{folder} has {len(named)} files of trial {self.trial} (a name that begins with '{self.trial:02d}_');"
            f" there: {names}."
        )


def _first_rest_s(trial: BroadTrial) -> float:
    """When the first rest ends: a second before the first movement."""
    first = int(np.argmax(trial.movement)) if trial.movement.any() else len(trial.movement)
    return max(first / trial.rate_hz - STILL_MARGIN_S, 0.0)


def _reference(t_s: FloatArray, trial: BroadTrial) -> Reference:
    known = np.isfinite(trial.quaternion_wxyz).all(axis=1)
    euler_rad = np.full((len(t_s), 3), np.nan)
    euler_rad[known, :2] = euler_from_quaternion(trial.quaternion_wxyz[known])[:, :2]
    return Reference(
        t_s,
        source="optical motion capture",
        independent=True,
        euler_rad=euler_rad,
        scored=trial.movement & known,
    )
