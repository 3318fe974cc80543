"""The velocities of a table, in whatever frame they were measured."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from jerkbench.datasets._table_covariance import CovarianceMap, covariances_of
from jerkbench.datasets._table_stream import Source
from jerkbench.datasets._timed_columns import TimedColumns
from jerkbench.errors import RecordingError
from jerkbench.geometry import enu_axes
from jerkbench.readers.frames import axes_in_enu
from jerkbench.recording import Origin, Velocity

FRAMES: dict[str, Literal["body", "speed"]] = {"body": "body", "speed": "speed"}
"""Those that a recording has too; all others are turned into ENU."""

VELOCITY_FRAMES = ("enu", "ned", "ecef", "body", "speed")


@dataclass(frozen=True)
class VelocityMap:
    """Which columns of a table are a velocity.

    Attributes:
        source: where they stand.
        axes: three columns, one for a speed.
        frame: enu, ned, ecef, body (FLU) or speed.
        covariance: the columns of the covariance, in the frame.
    """

    source: Source
    axes: tuple[str, ...]
    frame: str
    covariance: CovarianceMap


def read_velocity(
    table: TimedColumns, mapping: VelocityMap, zero_ns: int, origin: Origin | None
) -> tuple[Velocity | None, tuple[str, ...]]:
    """Return the velocities, None where there are none, and what was dropped, in sentences.

    Raises:
        RecordingError: the file is missing or damaged, has no such column, is a solution without velocities, or is in
            ECEF and the ``origin`` is not known.
        PluginError: the file is a solution of RTKLIB, and the times of the table are not known.
    """
    if not mapping.source.file:
        return None, ()
    if mapping.source.solved:
        return _solved(table, mapping.source, zero_ns)
    stream = table.read(mapping.source).only(mapping.axes)
    columns, t_s = stream.columns, stream.t_s(zero_ns)
    covariance, notes = covariances_of(columns, mapping.covariance, origin)
    values = columns.numbers(mapping.axes)
    if mapping.frame == "speed":
        values = np.column_stack([values, np.full((len(values), 2), np.nan)])
    elif mapping.frame == "ecef":
        values = values @ enu_axes(_place(columns.where, origin)).T
    velocity = Velocity(t_s, axes_in_enu(values, mapping.frame), covariance, FRAMES.get(mapping.frame, "enu"))
    return velocity, (*columns.notes, *notes)


def _place(where: str, origin: Origin | None) -> Origin:
    if origin is None:
        raise RecordingError(f"{where} has velocities in ECEF, and where it is on the Earth is not known; give origin.")
    return origin


def _solved(table: TimedColumns, source: Source, zero_ns: int) -> tuple[Velocity, tuple[str, ...]]:
    t_s, solution, notes = table.read_solution(source, zero_ns)
    if solution.velocity_enu_mps is None or solution.velocity_covariance_m2ps2 is None:
        raise RecordingError(
            f"dataset table: {source.file} has no velocities; let RTKLIB write them (out-outvel=on), or leave"
            f" {source.parameter} empty."
        )
    return Velocity(t_s, solution.velocity_enu_mps, solution.velocity_covariance_m2ps2), notes
