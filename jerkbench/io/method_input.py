"""The input of a method from elsewhere: one table in the order of time, and a JSON that explains it."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Attitude
from jerkbench.files import write_atomically, write_text
from jerkbench.io.writing import recording_table, reference_columns, write_frame
from jerkbench.recording import GRAVITY_MPS2, Recording, Reference
from jerkbench.timeline import nanoseconds

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "jerkbench recording, version 1"
EVALUATED = "evaluated"
ANGLES = ("attitude_roll_rad", "attitude_pitch_rad", "attitude_yaw_rad")
INPUTS = ("attitude_accel_east_mps2", "attitude_accel_north_mps2", "attitude_accel_up_mps2")
"""Columns that are no measurement: what the attitude filter makes of the IMU."""

UNITS = {
    "s": "s",
    "m": "m",
    "mps": "m/s",
    "mps2": "m/s2",
    "radps": "rad/s",
    "rad": "rad",
    "m2": "m2",
    "m2ps2": "m2/s2",
}
"""The unit behind the end of a column's name."""

ABOUT = {
    "imu": "Specific force (gravity included) and angular rate of the body; each the mean over the interval that ends"
    " at its stamp.",
    "position": "Fixes, ENU, with the receiver's covariance (11, 22, 33, 12, 13, 23 of east, north, up).",
    "velocity": "Velocities in the frame that is named, with their covariance. speed: along the course, no other axis.",
    "heading": "Yaw, from east towards north, with its standard deviation.",
    "attitude": "What the attitude filter of the run makes of the IMU: roll, pitch, yaw, and the acceleration in ENU"
    " without gravity, the input of the kinematic filters. A method with an attitude of its own leaves it aside.",
}
FRAMES = {
    "navigation": "ENU, the local tangent plane at the origin (WGS-84)",
    "body": "FLU: forward, left, up; at rest and level the specific force is (0, 0, +g)",
    "attitude": "Rz(yaw) Ry(pitch) Rx(roll) turns body into ENU; positive pitch is nose down",
}
WRITE = (
    "One row for each stamp that is evaluated, or for more: t_s, east_m, north_m, up_m; where the method has them,"
    " east_mps, north_mps, up_mps; roll_rad, pitch_rad, yaw_rad; P11, P12, ..., P16, P22, ..., P66 (covariance of"
    " position and velocity). Or a .tum file."
)


def input_table(recording: Recording, attitude: Attitude | None = None) -> "pd.DataFrame":
    """Return a row for each stamp of any stream and of the reference, empty where a stream has no value.

    ``evaluated`` is 1 where the reference has a stamp; of the reference itself nothing is in it.
    """
    bare = Reference(recording.reference.t_s, "not told", independent=False)
    table = recording_table(replace(recording, reference=bare))
    t_ns = nanoseconds(table["t_s"].to_numpy())
    table.insert(1, EVALUATED, np.isin(t_ns, nanoseconds(bare.t_s)).astype(np.int64))
    if attitude is None or recording.imu is None:
        return table
    rows = np.searchsorted(t_ns, nanoseconds(attitude.t_s))
    for names, values in ((ANGLES, attitude.euler_rad), (INPUTS, attitude.accel_enu_mps2)):
        for name, column in zip(names, values.T, strict=True):
            table[name] = _placed(column, rows, len(t_ns))
    return table


def write_input(table: "pd.DataFrame", recording: Recording, path: Path, more: Mapping[str, Any]) -> list[Path]:
    """Write the table (.csv or .parquet), and beside it the JSON, which tells ``more`` as well; returns the files."""
    write_frame(table, path)
    beside = path.with_suffix(".json")
    write_text(beside, json.dumps({**described(recording, table, path.name), **more}, indent=1) + "\n")
    return [path, beside]


def write_reference(recording: Recording, path: Path) -> None:
    """Write what a method does not get: the reference, and at which of its stamps errors count."""
    import pandas as pd

    reference = recording.reference
    columns = {"t_s": reference.t_s, **reference_columns(recording, "enu"), "scored": reference.scored.astype(int)}
    write_atomically(path, lambda partial: pd.DataFrame(columns).to_csv(partial, index=False, float_format="%.12g"))


def described(recording: Recording, table: "pd.DataFrame", name: str) -> dict[str, Any]:
    """Return what a reader of the table has to know: frames, units, rates, origin, start."""
    return {
        "format": FORMAT,
        "name": recording.name,
        "table": name,
        "time": {
            "column": "t_s",
            "unit": "s",
            "zero": "the recording's start; each value stands at the time at which it was true",
            "start_utc": recording.start_utc.isoformat() if recording.start_utc else None,
        },
        EVALUATED: "1 at the stamps of the reference: an estimate is asked for there, after an update at that time",
        "frames": FRAMES,
        "origin": asdict(recording.origin) if recording.origin else None,
        "gravity_mps2": GRAVITY_MPS2,
        "static_start_s": recording.static_start_s,
        "streams": _streams(recording, [str(column) for column in table.columns]),
        "write": WRITE,
        "notes": list(recording.notes),
    }


def _streams(recording: Recording, columns: list[str]) -> dict[str, Any]:
    stamps = {
        name: stream.t_s
        for name in ("imu", "position", "velocity", "heading")
        if (stream := getattr(recording, name)) is not None
    }
    begins = {"imu": ("accel_", "gyro_")}
    streams = {
        name: _stream(name, t_s, [c for c in columns if c.startswith(begins.get(name, f"{name}_"))])
        for name, t_s in stamps.items()
    }
    if recording.imu is not None and ANGLES[0] in columns:
        streams["attitude"] = _stream("attitude", recording.imu.t_s, [*ANGLES, *INPUTS])
    for name in ("position", "velocity"):
        if name in streams:
            streams[name]["assumed_lever_arm_m"] = [0.0, 0.0, 0.0]
    if recording.velocity is not None:
        streams["velocity"]["frame"] = recording.velocity.frame
    if recording.heading is not None:
        streams["heading"]["source"] = recording.heading.source
    return streams


def _stream(name: str, t_s: FloatArray, columns: list[str]) -> dict[str, Any]:
    rate = round(1.0 / float(np.median(np.diff(t_s))), 6) if len(t_s) > 1 else None
    units = {column: UNITS[column.rpartition("_")[2]] for column in columns}
    return {"about": ABOUT[name], "rows": len(t_s), "rate_hz": rate, "columns": units}


def _placed(values: FloatArray, rows: "np.ndarray[Any, Any]", n: int) -> FloatArray:
    column = np.full(n, np.nan)
    column[rows] = values
    return column
