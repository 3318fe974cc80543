"""Anybody's program as an attitude filter: it reads an IMU and writes quaternions."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.attitude_only import attitude_at_reference
from jerkbench.filters.command import Command
from jerkbench.io.columns import read_columns
from jerkbench.io.recording_folder import write_recording
from jerkbench.io.table_values import AttitudeMap, read_attitude
from jerkbench.io.text import TextFormat
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording, Reference

SAME_S = 1e-6
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
        if euler_rad is None or len(t_s) != len(samples_s) or (np.abs(t_s - samples_s) > SAME_S).any():
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
