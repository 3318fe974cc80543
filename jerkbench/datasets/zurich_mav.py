"""A quadrotor in the streets of Zurich, with 1 Hz fixes, a 10 Hz IMU, and photogrammetry as the reference."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, nearest_rows, require_positive
from jerkbench.errors import PluginError
from jerkbench.io.columns import Columns, read_columns
from jerkbench.io.files import FromFiles, find_file
from jerkbench.io.frames import axes_matrix
from jerkbench.io.sanitiser import imu_in_body
from jerkbench.io.text import TextFormat
from jerkbench.plugins import register
from jerkbench.recording import Imu, Position, Recording, Reference

TRUTH, _ACCEL, _GYRO = "GroundTruthAGL.csv", "RawAccel.csv", "RawGyro.csv"
FIRST_FIX_S, FIX_S = 7.009129, 0.03343357
FIRST_TRUTH_S, TRUTH_S = 13.80, 0.0333667
"""Times of the fix of image 1 and of the truth of image 0 on the IMU's clock, and the intervals between images [s].

These times were found by comparing the fixes with the IMU and the truth with the fixes, because the published pairing
of images and fixes is wrong by seconds.
"""

FRD = ("x", "-y", "-z")
_NOTES = (
    "The times of fixes and truth were fitted to the IMU's clock; the uncertainty of the truth's times is 0.15 s.",
    "East and north are the axes of UTM 32, which are rotated by 0.4 degrees.",
    "The IMU is sampled at 10 Hz under vibration, which is aliased, so its specific forces are inaccurate.",
)


@register("dataset", "zurich_mav")
@dataclass(frozen=True)
class ZurichMav(FromFiles):
    """A quadrotor flight of 720 s between houses: 1 Hz fixes, a 10 Hz IMU with gaps up to 1.1 s, photogrammetric truth.

    Each row of the ground truth belongs to the image with the number k (1, 31, 61, ...). The fix and the truth in a row
    have different times. On the clock of the IMU, the times of row k are::

        fix     7.009129 + (k - 1) 0.03343357 s
        truth   13.80 + k 0.0333667 s, +- 0.15 s

    The axes of the IMU are forward, right, down. The angles of the truth are not read, because they belong to a camera
    that looks sideways. Time 0 is the first IMU sample.

    Source: A. L. Majdik, C. Till, D. Scaramuzza, "The Zurich urban micro aerial vehicle dataset", Int. J. Robotics
    Research 36(3), 2017, doi:10.1177/0278364917702237.

    Attributes:
        folder: folder of GroundTruthAGL.csv, RawAccel.csv and RawGyro.csv.
        position_sigma_m: standard deviation of each axis of the fixes [m]. The default sigma is the value that the
            receiver states.
        gyro_bias_radps: bias that is subtracted from the gyro, in the axes of the gyro [rad/s].
    """

    folder: str = ""
    position_sigma_m: float = 10.0
    gyro_bias_radps: tuple[float, ...] = (-0.015, -0.027, 0.029)

    def __post_init__(self) -> None:
        require_positive("dataset zurich_mav", self, ("position_sigma_m",))
        if len(self.gyro_bias_radps) != 3:
            raise PluginError(
                f"dataset zurich_mav: gyro_bias_radps is {self.gyro_bias_radps}; give three numbers (x, y, z)."
            )

    def load(self, seed: int = 0) -> Recording:
        """Return the recording of the flight. ``seed`` has no effect.

        Raises:
            RecordingError: a file is missing or damaged.
        """
        truth, *sensors = (read_columns((path,), TextFormat()) for path in self.paths())
        imu, start_s, of_imu = self._imu(*sensors)
        image = truth.numbers(("imgid",))[:, 0]
        places, fixes = truth.numbers(("x_gt", "y_gt", "z_gt")), truth.numbers(("x_gps", "y_gps", "z_gps"))
        origin = fixes[0]
        truth_s = FIRST_TRUTH_S + image * TRUTH_S - start_s
        fix_s = FIRST_FIX_S + (image - 1) * FIX_S - start_s
        covariance = np.tile(self.position_sigma_m**2 * np.eye(3), (len(fixes), 1, 1))
        return Recording(
            name="zurich_mav",
            imu=imu,
            reference=Reference(
                truth_s, "photogrammetry of the flight's images", independent=True, enu_m=places - origin
            ),
            position=Position(fix_s, fixes - origin, covariance),
            notes=(*truth.notes, *of_imu, *_NOTES),
        )

    def _imu(self, accel: Columns, gyro: Columns) -> tuple[Imu, float, tuple[str, ...]]:
        """Return the samples at the stamps of the accelerometer, the first stamp [s], and notes about the samples."""
        t_s, force = _sensor(accel)
        gyro_s, rate = _sensor(gyro)
        rate = rate[nearest_rows(gyro_s, t_s)] - self.gyro_bias_radps
        imu, notes = imu_in_body(accel.where, t_s - t_s[0], force, rate, ("m/s2", "rad/s"), axes_matrix(FRD))
        return imu, float(t_s[0]), notes

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of the three files in the folder."""
        folder = Path(self.folder).expanduser()
        return tuple(find_file(folder, name, ".csv", "folder") for name in (TRUTH, _ACCEL, _GYRO))


def _sensor(columns: Columns) -> tuple[FloatArray, FloatArray]:
    """Return the times (n,) on the clock of the IMU [s] and the values (n, 3) of a sensor, without repeated stamps."""
    t_s, values = columns.numbers(("1",))[:, 0] * 1e-6, columns.numbers(("x", "y", "z"))
    new = np.diff(t_s, prepend=-np.inf) > 0
    return t_s[new], values[new]
