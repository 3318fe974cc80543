"""No navigation, for recordings without position: the attitude filter alone, or a program that writes quaternions."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.command import Command
from jerkbench.io.columns import read_columns
from jerkbench.io.recording_folder import write_recording
from jerkbench.io.table import AttitudeMap, read_attitude
from jerkbench.io.text import TextFormat
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording, Reference
from jerkbench.timeline import nanoseconds


@register("filter", "attitude_only")
@dataclass(frozen=True)
class AttitudeOnlyFilter:
    """Hands the attitude on, and estimates neither position nor velocity.

    With the attitude filter's angles at the IMU's stamps t_i, at each stamp t of the reference from t_0 on::

        (roll, pitch, yaw)(t) = (roll, pitch, yaw)_i,    i = the last with t_i <= t;    p, v, P are NaN

    It is the one filter for a recording that has an attitude reference and nothing to navigate by (`broad`). The
    metrics of position and velocity have no value with it.
    """

    provenance = Provenance("own", "", "Hands the attitude on; it navigates by nothing.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    attitude_only: ClassVar[bool] = True

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the attitude at the reference's stamps that the IMU covers."""
        return attitude_at_reference(attitude.t_s, attitude.euler_rad, recording)


def attitude_at_reference(t_s: FloatArray, euler_rad: FloatArray, recording: Recording) -> Estimate:
    """Return angles (n, 3) at ``t_s`` (n,) as an estimate: at each stamp of the reference those of the last until then.

    Stamps that they do not cover have none.
    """
    imu, stamps = nanoseconds(t_s), nanoseconds(recording.reference.t_s)
    index = np.flatnonzero((stamps >= imu[0]) & (stamps <= imu[-1])).astype(np.int64)
    sample = np.searchsorted(imu, stamps[index], side="right") - 1
    absent = np.full((len(index), 3), np.nan)
    covariance = np.full((len(index), 6, 6), np.nan)
    return Estimate(index, absent, absent, covariance, euler_rad[sample], attitude_only=True)


_SAME_S = 1e-6
"""Stamps that are nearer are the same."""

WRITE = "One row for each row of the table: t_s, qw, qx, qy, qz, body to a frame whose z is up; the heading is free."


@register("filter", "attitude_command")
@dataclass(frozen=True, kw_only=True)
class AttitudeCommand(Command):
    """Runs a program of your own, in any language: it reads an IMU and writes a quaternion for each sample.

    As with `command` it runs once for each seed, without a shell, and a run that fails says why::

        jerkbench run dataset=field filter=attitude_command filter.command="./my_filter {recording} {out}"

    {recording} is a CSV with a row for each sample: t_s [s], gyro_forward_radps, gyro_left_radps, gyro_up_radps,
    accel_forward_mps2, accel_left_mps2, accel_up_mps2 (specific force: +g upwards at rest), each the mean over the
    interval that ends at t_s. {out} is a CSV with a row for each of these stamps, in their order: t_s, qw, qx, qy, qz,
    the unit quaternion from the body (forward, left, up) to a frame whose z is up, after the sample. The heading is
    free. Position, velocity and heading are not told.

    Attributes:
        attitude: the columns of the attitude: four (w, x, y, z) or three (roll, pitch, yaw).
    """

    provenance = Provenance("own", "", "A program of the user's; what it is, its author knows.")
    attitude_only: ClassVar[bool] = True

    attitude: tuple[str, ...] = ("qw", "qx", "qy", "qz")

    def _write(self, recording: Recording, attitude: Attitude, folder: Path) -> None:
        del attitude
        untold = Reference(recording.inertial.t_s, "not told", independent=False)
        alone = replace(recording, reference=untold, position=None, velocity=None, heading=None)
        write_recording(alone, None, folder, self.formats, {"seed": self.seed, "write": WRITE})

    def _read(self, out: Path, recording: Recording) -> Estimate:
        columns = read_columns([out], TextFormat(self.separator, self.header, self.comment))
        form = AttitudeMap(self.attitude, self.attitude_unit, self.attitude_frame or "enu", self.body, ("x", "y", "z"))
        euler_rad, t_s = read_attitude(columns, form), columns.numbers((self.time,))[:, 0]
        samples_s = recording.inertial.t_s
        if euler_rad is None or len(t_s) != len(samples_s) or (np.abs(t_s - samples_s) > _SAME_S).any():
            raise RecordingError(
                f"{columns.where} has {len(t_s)} rows; write one for each of the {len(samples_s)} rows of the"
                " recording, with its t_s, in the same order."
            )
        unknown = ~np.isfinite(euler_rad).all(axis=1)
        if unknown.any():
            raise RecordingError(
                f"{columns.where}, row {int(np.argmax(unknown)) + 1}: the attitude ({', '.join(self.attitude)}) is no"
                " quaternion of finite numbers; write one at each stamp."
            )
        return attitude_at_reference(samples_s, euler_rad, recording)
