"""Filters that estimate only the attitude, with an attitude filter of jerkbench or with a program of the user."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.trajectory import Command
from jerkbench.io.columns import TextFormat
from jerkbench.io.readers import read_columns
from jerkbench.io.table import read_attitude
from jerkbench.io.writing import write_recording
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording, Reference
from jerkbench.timeline import nanoseconds


@register("filter", "attitude_only")
@dataclass(frozen=True)
class AttitudeOnlyFilter:
    """Returns the attitude of the attitude filter and estimates neither position nor velocity.

    The attitude filter estimates roll, pitch and yaw at the time stamps t_i of the IMU. At each time stamp t of the
    reference between the first and the last t_i, this filter returns the latest angles::

        (roll, pitch, yaw)(t) = (roll, pitch, yaw)_i,    i = the last with t_i <= t;    p, v, P are NaN

    Use this filter for a recording that has a reference for the attitude but not for position and velocity, such as
    `broad`. The metrics of position and velocity are NaN for this filter.
    """

    provenance = Provenance("own", "", "Returns the attitude of the attitude filter; does not navigate.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    attitude_only: ClassVar[bool] = True

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the attitude at each time stamp of the reference between the first and the last sample of the IMU."""
        return attitude_at_reference(attitude.t_s, attitude.euler_rad, recording)


def attitude_at_reference(t_s: FloatArray, euler_rad: FloatArray, recording: Recording) -> Estimate:
    """Return an estimate that contains the latest known attitude at each time stamp of the reference.

    The estimate contains only the time stamps of the reference between the first and the last time in ``t_s``.

    Args:
        t_s: (n,) times of the known attitudes [s].
        euler_rad: (n, 3) known attitudes as roll, pitch and yaw [rad].
        recording: recording whose reference defines the time stamps of the estimate.
    """
    imu, stamps = nanoseconds(t_s), nanoseconds(recording.reference.t_s)
    index = np.flatnonzero((stamps >= imu[0]) & (stamps <= imu[-1])).astype(np.int64)
    sample = np.searchsorted(imu, stamps[index], side="right") - 1
    absent = np.full((len(index), 3), np.nan)
    covariance = np.full((len(index), 6, 6), np.nan)
    return Estimate(index, absent, absent, covariance, euler_rad[sample], attitude_only=True)


_SAME_S = 1e-6
"""Maximum difference of two stamps that are considered equal [s]."""

WRITE = "One row for each row of the table: t_s, qw, qx, qy, qz, body to a frame whose z is up; the heading is free."


@register("filter", "attitude_command")
@dataclass(frozen=True, kw_only=True)
class AttitudeCommand(Command):
    """Runs a program of the user, in any language, that reads IMU samples and writes one quaternion for each sample.

    The program runs once for each seed, without a shell. If the program fails, the run fails with an error message. The
    following command is an example::

        jerkbench run dataset=field filter=attitude_command filter.command="./my_filter {recording} {out}"

    The placeholder {recording} is the path of a CSV file with one row for each IMU sample. The columns of this CSV file
    are t_s [s], gyro_forward_radps, gyro_left_radps, gyro_up_radps, accel_forward_mps2, accel_left_mps2 and
    accel_up_mps2. The accelerometer measures the specific force, which is +g upwards at rest. Each IMU value is the
    mean over the sampling interval that ends at t_s. The CSV file contains no position, velocity or heading.

    The placeholder {out} is the path of the CSV file that the program writes. The output file has the columns t_s, qw,
    qx, qy, qz and one row for each IMU sample, in the same order. The quaternion has the length 1 and rotates from the
    body frame (forward, left, up) to a frame whose z axis points up. The heading of the frame with the z axis up is
    arbitrary.

    Attributes:
        attitude: names of the columns that contain the attitude, either four (w, x, y, z) or three (roll, pitch, yaw).
    """

    provenance = Provenance("own", "", "A program of the user; see its own documentation.")
    attitude_only: ClassVar[bool] = True

    attitude: tuple[str, ...] = ("qw", "qx", "qy", "qz")

    def _write(self, recording: Recording, attitude: Attitude, folder: Path) -> None:
        del attitude
        reference = Reference(recording.inertial.t_s, "withheld", independent=False)
        imu_only = replace(recording, reference=reference, position=None, velocity=None, heading=None)
        write_recording(imu_only, None, folder, self.formats, {"seed": self.seed, "write": WRITE})

    def _read(self, out: Path, recording: Recording) -> Estimate:
        columns = read_columns([out], TextFormat(self.separator, self.header, self.comment))
        euler_rad = read_attitude(columns, self.attitude, self.attitude_unit, self.attitude_frame or "enu", self.body)
        t_s = columns.numbers((self.time,))[:, 0]
        samples_s = recording.inertial.t_s
        if euler_rad is None or len(t_s) != len(samples_s) or (np.abs(t_s - samples_s) > _SAME_S).any():
            raise RecordingError(
                f"{columns.where} has {len(t_s)} rows; write one row for each of the {len(samples_s)} rows of the"
                " recording, with the same t_s and in the same order."
            )
        unknown = ~np.isfinite(euler_rad).all(axis=1)
        if unknown.any():
            raise RecordingError(
                f"{columns.where}, row {int(np.argmax(unknown)) + 1}: the attitude ({', '.join(self.attitude)}) is not"
                " a valid quaternion; write four finite numbers, not all zero, at each stamp."
            )
        return attitude_at_reference(samples_s, euler_rad, recording)
