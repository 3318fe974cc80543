"""A quadrotor in the streets of Zurich: 1 Hz fixes and a 10 Hz IMU, with photogrammetry as the reference."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, nearest_rows, require_positive
from jerkbench.errors import PluginError
from jerkbench.io.columns import Columns, read_columns
from jerkbench.io.files import FromFiles, find_file
from jerkbench.io.frames import axes_matrix, imu_in_body
from jerkbench.io.text import TextFormat
from jerkbench.plugins import register
from jerkbench.recording import Imu, Position, Recording, Reference

TRUTH, _ACCEL, _GYRO = "GroundTruthAGL.csv", "RawAccel.csv", "RawGyro.csv"
FIRST_FIX_S, FIX_S = 7.009129, 0.03343357
FIRST_TRUTH_S, TRUTH_S = 13.80, 0.0333667
"""When the fix and the truth of image 1 and of image 0 were true, on the IMU's clock, and the time from image to image.

Found by comparing the fixes with the IMU and the truth with the fixes: the published pairing of an image with its fix
is off by seconds.
"""

FRD = ("x", "-y", "-z")
_NOTES = (
    "The times of fixes and truth were fitted to the IMU's clock: the truth's are known to .15 s.",
    "East and north are those of UTM 32, .4 degrees off.",
    "The IMU is sampled at 10 Hz under vibration, which is aliased: its forces say little.",
)


@register("dataset", "zurich_mav")
@dataclass(frozen=True)
class ZurichMav(FromFiles):
    """A quadrotor between houses, 720 s: fixes 1 Hz, IMU 10 Hz with gaps up to 1.1 s; truth from photogrammetry.

    Row k of the truth is of image k (1, 31, 61, ...); the fix in the same row is not of the same time. On the clock of
    the IMU::

        fix     7.009129 + (k - 1) 0.03343357 s
        truth   13.80 + k 0.0333667 s, give or take .15 s

    The IMU's axes are forward, right, down. The truth's angles are those of a camera that looks sideways; they are not
    read. Time 0 is the first IMU sample.

    Source: A. L. Majdik, C. Till, D. Scaramuzza, "The Zurich urban micro aerial vehicle dataset", Int. J. Robotics
    Research 36(3), 2017, doi:10.1177/0278364917702237.

    Attributes:
        folder: where GroundTruthAGL.csv, RawAccel.csv and RawGyro.csv are.
        position_sigma_m: one standard deviation of an axis; the receiver claims 10 m.
        gyro_bias_radps: subtracted from the gyro, in its own axes.
    """

    folder: str = ""
    position_sigma_m: float = 10.0
    gyro_bias_radps: tuple[float, ...] = (-0.015, -0.027, 0.029)

    def __post_init__(self) -> None:
        """Check the sigma and the three biases."""
        require_positive("dataset zurich_mav", self, ("position_sigma_m",))
        if len(self.gyro_bias_radps) != 3:
            raise PluginError(f"dataset zurich_mav: gyro_bias_radps is {self.gyro_bias_radps}; give x, y, z.")

    def load(self, seed: int = 0) -> Recording:
        """Return the flight; ``seed`` changes nothing.

        Raises:
            RecordingError: a file is missing or damaged.
        """
        truth, *sensors = (read_columns((path,), TextFormat()) for path in self.paths())
        imu, start_s = self._imu(*sensors)
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
            notes=(*truth.notes, *_NOTES),
        )

    def _imu(self, accel: Columns, gyro: Columns) -> tuple[Imu, float]:
        """The samples at the accelerometer's stamps, and the first of these on the IMU's clock [s]."""
        t_s, force = _sensor(accel)
        gyro_s, rate = _sensor(gyro)
        rate = rate[nearest_rows(gyro_s, t_s)] - self.gyro_bias_radps
        return imu_in_body(t_s - t_s[0], force, rate, ("m/s2", "rad/s"), axes_matrix(FRD)), float(t_s[0])

    def paths(self) -> tuple[Path, ...]:
        """Return the files that are read."""
        folder = Path(self.folder).expanduser()
        return tuple(find_file(folder, name, ".csv", "folder") for name in (TRUTH, _ACCEL, _GYRO))


def _sensor(columns: Columns) -> tuple[FloatArray, FloatArray]:
    """Times (n,) [s] on the IMU's clock and values (n, 3); a stamp that repeats is left out."""
    t_s, values = columns.numbers(("1",))[:, 0] * 1e-6, columns.numbers(("x", "y", "z"))
    new = np.diff(t_s, prepend=-np.inf) > 0
    return t_s[new], values[new]
