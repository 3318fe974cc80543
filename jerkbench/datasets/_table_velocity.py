"""The velocities of a table, in whatever frame they were measured."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.datasets._table_stream import Source
from jerkbench.datasets._timed_columns import TimedColumns
from jerkbench.errors import RecordingError
from jerkbench.readers.frames import axes_in_enu
from jerkbench.recording import Velocity

VELOCITY_FRAMES = ("enu", "ned", "body", "speed")


@dataclass(frozen=True)
class VelocityMap:
    """Which columns of a table are a velocity.

    Attributes:
        source: where they stand.
        axes: three columns, one for a speed.
        frame: enu, ned, body (FLU) or speed.
        sigma_mps: one standard deviation of an axis.
    """

    source: Source
    axes: tuple[str, ...]
    frame: str
    sigma_mps: float


def read_velocity(table: TimedColumns, given: VelocityMap, zero_ns: int) -> Velocity | None:
    """Return the velocities; None where there are none.

    Raises:
        RecordingError: the file is missing or damaged, or has no such column, or is a solution without velocities.
        PluginError: the file is a solution of RTKLIB, and the times of the table are not known.
    """
    if not given.source.file:
        return None
    if given.source.solved:
        return _solved(table, given.source, zero_ns)
    stream = table.read(given.source).only(given.axes)
    return _in_frame(stream.t_s(zero_ns), stream.columns.numbers(given.axes), given.frame, given.sigma_mps)


def _solved(table: TimedColumns, source: Source, zero_ns: int) -> Velocity:
    t_s, solution, _ = table.read_solution(source, zero_ns)
    if solution.velocity_enu_mps is None or solution.velocity_covariance_m2ps2 is None:
        raise RecordingError(
            f"dataset table: {source.file} has no velocities; let RTKLIB write them (out-outvel=on), or leave"
            f" {source.parameter} empty."
        )
    return Velocity(t_s, solution.velocity_enu_mps, solution.velocity_covariance_m2ps2)


def _in_frame(t_s: FloatArray, values: FloatArray, frame: str, sigma_mps: float) -> Velocity:
    if frame == "speed":
        return Velocity.along_course(t_s, values[:, 0], sigma_mps)
    covariance = np.tile(sigma_mps**2 * np.eye(3), (len(t_s), 1, 1))
    if frame == "body":
        return Velocity(t_s, values, covariance, "body")
    return Velocity(t_s, axes_in_enu(values, frame), covariance)
