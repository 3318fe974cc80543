"""Writing of recordings as tables and as the input of other programs, and writing of trajectories."""

import json
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.files import write_atomically, write_text
from jerkbench.geometry import dcm_from_euler, enu_to_geodetic, quaternion_from_dcm
from jerkbench.io.bag_writing import write_bag
from jerkbench.io.conversions import axes_in_enu, covariance_in_enu
from jerkbench.recording import GRAVITY_MPS2, Recording, Reference
from jerkbench.timeline import nanoseconds

if TYPE_CHECKING:
    import pandas as pd

POSITIONS = {
    "enu": ("east_m", "north_m", "up_m"),
    "ned": ("north_m", "east_m", "down_m"),
    "geodetic": ("latitude_deg", "longitude_deg", "height_m"),
}
"""Columns of a position in each coordinate system."""

VELOCITIES = {"enu": ("east_mps", "north_mps", "up_mps"), "ned": ("north_mps", "east_mps", "down_mps")}
_BODY = ("forward_mps", "left_mps", "up_mps")
_UPPER = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]

WrittenColumns = dict[str, FloatArray]


def recording_table(
    recording: Recording, coordinates: str = "enu", more: Sequence[tuple[FloatArray, WrittenColumns]] = ()
) -> "pd.DataFrame":
    """Return a table of all streams of a recording and of ``more`` streams, with times in seconds since the start.

    The names of the columns contain the units. The variances are in the order of the position or velocity columns. With
    geodetic coordinates, the position variances are in the order east, north, up.

    Raises:
        RecordingError: ``coordinates`` is "geodetic", and the recording has no origin.
    """
    import pandas as pd

    streams = [*_streams(recording, coordinates), *more]
    t_ns = np.unique(np.concatenate([nanoseconds(t_s) for t_s, _ in streams]))
    table: WrittenColumns = {"t_s": t_ns * 1e-9}
    for t_s, columns in streams:
        rows = np.searchsorted(t_ns, nanoseconds(t_s))
        for name, values in columns.items():
            table[name] = np.full(len(t_ns), np.nan)
            table[name][rows] = values
    return pd.DataFrame(table)


def write_table(recording: Recording, path: Path, coordinates: str = "enu") -> None:
    """Write all streams of a recording to a .csv or .parquet file."""
    write_frame(recording_table(recording, coordinates), path)


def write_frame(table: "pd.DataFrame", path: Path) -> None:
    """Write a data frame to a .csv or .parquet file."""
    if path.suffix == ".parquet":
        write_atomically(path, lambda partial: table.to_parquet(partial, index=False))
    else:
        write_atomically(path, lambda partial: table.to_csv(partial, index=False, float_format="%.12g"))


def _streams(recording: Recording, coordinates: str) -> list[tuple[FloatArray, WrittenColumns]]:
    imu, position, velocity, heading = recording.imu, recording.position, recording.velocity, recording.heading
    streams: list[tuple[FloatArray, WrittenColumns]] = []
    if imu is not None:
        force, rate = (tuple(f"{axis}_{unit}" for axis in ("forward", "left", "up")) for unit in ("mps2", "radps"))
        streams.append((imu.t_s, _three("accel", force, imu.accel_mps2) | _three("gyro", rate, imu.gyro_radps)))
    if position is not None:
        columns = _position("position", position.enu_m, recording, coordinates)
        columns |= _covariance("position", covariance_in_enu(position.covariance_m2, coordinates), "m2")
        streams.append((position.t_s, columns))
    if velocity is not None:
        axes = coordinates if coordinates == "ned" and velocity.frame == "enu" else "enu"
        names = VELOCITIES[axes] if velocity.frame == "enu" else _BODY
        columns = _three("velocity", names, axes_in_enu(velocity.mps, axes))
        columns |= _covariance("velocity", covariance_in_enu(velocity.covariance_m2ps2, axes), "m2ps2")
        streams.append((velocity.t_s, columns))
    if heading is not None:
        streams.append((heading.t_s, {"heading_yaw_rad": heading.yaw_rad, "heading_sigma_rad": heading.sigma_rad}))
    return [*streams, (recording.reference.t_s, reference_columns(recording, coordinates))]


def reference_columns(recording: Recording, coordinates: str) -> WrittenColumns:
    """Return the columns of the reference, with one value for each stamp of the reference."""
    reference = recording.reference
    columns: WrittenColumns = {}
    if reference.enu_m is not None:
        columns |= _position("reference", reference.enu_m, recording, coordinates)
    if reference.velocity_mps is not None:
        axes = "ned" if coordinates == "ned" else "enu"
        columns |= _three("reference", VELOCITIES[axes], axes_in_enu(reference.velocity_mps, axes))
    if reference.euler_rad is not None:
        columns |= _three("reference", ("roll_rad", "pitch_rad", "yaw_rad"), reference.euler_rad)
    return columns


def _position(stream: str, enu_m: FloatArray, recording: Recording, coordinates: str) -> WrittenColumns:
    places = axes_in_enu(enu_m, coordinates)
    if coordinates == "geodetic":
        if recording.origin is None:
            raise RecordingError(f"{recording.name} has no origin on the Earth; choose --coordinates enu or ned.")
        places = enu_to_geodetic(enu_m, recording.origin)
    return _three(stream, POSITIONS[coordinates], places)


def _three(stream: str, names: tuple[str, ...], values: FloatArray) -> WrittenColumns:
    return {f"{stream}_{name}": values[:, k] for k, name in enumerate(names)}


def _covariance(stream: str, covariance: FloatArray, unit: str) -> WrittenColumns:
    return {f"{stream}_variance_{i + 1}{j + 1}_{unit}": covariance[:, i, j] for i, j in _UPPER}


# A recording without its reference, as the input of other programs.

EVALUATED = "evaluated"
_ANGLES = ("attitude_roll_rad", "attitude_pitch_rad", "attitude_yaw_rad")
INPUTS = ("attitude_accel_east_mps2", "attitude_accel_north_mps2", "attitude_accel_up_mps2")
"""Columns that the attitude filter computes from the IMU."""

_SAID = tomllib.loads(Path(__file__).with_name("recording.toml").read_text(encoding="utf-8"))


def input_table(recording: Recording, attitude: Attitude | None = None) -> "pd.DataFrame":
    """Return a table of all streams except the reference, with a row for each stamp of any stream or the reference.

    The column ``evaluated`` is 1 at stamps of the reference, otherwise 0. Cells of missing values are empty.
    """
    more: list[tuple[FloatArray, WrittenColumns]] = []
    if attitude is not None and recording.imu is not None:
        values = np.hstack([attitude.euler_rad, attitude.accel_enu_mps2])
        more.append((attitude.t_s, dict(zip((*_ANGLES, *INPUTS), values.T, strict=True))))
    table = recording_table(_bare(recording), "enu", more)
    evaluated = np.isin(nanoseconds(table["t_s"].to_numpy()), nanoseconds(recording.reference.t_s))
    table.insert(1, EVALUATED, evaluated.astype(np.int64))
    return table


def _bare(recording: Recording) -> Recording:
    return replace(recording, reference=Reference(recording.reference.t_s, "not given", independent=False))


def write_reference(recording: Recording, path: Path) -> None:
    """Write the reference to a table with a column that marks the scored stamps. Methods must not read this table."""
    import pandas as pd

    reference = recording.reference
    columns = {"t_s": reference.t_s, **reference_columns(recording, "enu"), "scored": reference.scored.astype(int)}
    write_frame(pd.DataFrame(columns), path)


def described(recording: Recording, table: "pd.DataFrame", name: str) -> dict[str, Any]:
    """Return the JSON description of a table: the frames, rates, origin and start."""
    start, origin = recording.start_utc, recording.origin
    return {
        "format": _SAID["format"],
        "name": recording.name,
        "table": name,
        "time": _SAID["time"] | {"start_utc": start.isoformat() if start else None},
        EVALUATED: _SAID[EVALUATED],
        "frames": _SAID["frames"],
        "origin": asdict(origin) if origin else None,
        "gravity_mps2": GRAVITY_MPS2,
        "static_start_s": recording.static_start_s,
        "streams": _described_streams(recording, list(map(str, table.columns))),
        "write": _SAID["write"],
        "notes": list(recording.notes),
    }


def _described_streams(recording: Recording, columns: Sequence[str]) -> dict[str, Any]:
    streams = {}
    for name, about in _SAID["streams"].items():
        stream = getattr(recording, "imu" if name == "attitude" else name)
        begins = ("accel_", "gyro_") if name == "imu" else f"{name}_"
        if stream is not None and any(column.startswith(begins) for column in columns):
            steps_s = np.diff(stream.t_s)
            rate_hz = round(1.0 / float(np.median(steps_s)), 6) if len(steps_s) else None
            streams[name] = {"about": about, "rows": len(stream.t_s), "rate_hz": rate_hz}
            streams[name] |= {key: getattr(stream, key) for key in ("frame", "source") if hasattr(stream, key)}
    return streams


FORMATS = {name: f"recording.{name}" for name in ("csv", "parquet", "bag", "mcap")}
"""The file name for each format."""


def write_recording(
    recording: Recording, attitude: Attitude | None, folder: Path, formats: Sequence[str], more: Mapping[str, Any]
) -> list[Path]:
    """Write a recording without its reference in each of the ``formats``, and return the paths of the files.

    Args:
        recording: the recording to write.
        attitude: estimated attitude, which is added to tables, or None to omit the attitude.
        folder: folder in which the files are written.
        formats: names of the formats, which are keys of `FORMATS`.
        more: additional entries of the JSON file that describes the table.

    Raises:
        RecordingError: the recording lacks a stream that a format needs.
    """
    written: list[Path] = []
    for name in formats:
        path = folder / FORMATS[name]
        if name in ("csv", "parquet"):
            table, about = input_table(recording, attitude), path.with_suffix(".json")
            write_frame(table, path)
            write_text(about, json.dumps({**described(recording, table, path.name), **more}, indent=1) + "\n")
            written += [path, about]
        elif recording.imu is None:
            raise RecordingError(f"{recording.name} has no IMU, which a bag needs; write csv or parquet.")
        else:
            write_bag(_bare(recording), path)
            written.append(path)
    return written


# Writing of a trajectory in the text formats TUM and GPX.


def trajectory_of(recording: Recording, stream: str | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the trajectory of the reference, or the trajectory of the position fixes with the identity as rotation.

    The trajectory consists of times, positions (n, 3) in ENU, and quaternions (n, 4) from body to ENU with the scalar
    last. If ``stream`` is "reference", or is None and the reference has positions, the reference is returned.

    Raises:
        RecordingError: the selected stream has no positions.
    """
    reference, position = recording.reference, recording.position
    if stream == "reference" or (stream is None and reference.enu_m is not None):
        t_s, enu_m, euler = reference.t_s, reference.enu_m, reference.euler_rad
    else:
        t_s, enu_m, euler = (reference.t_s, None, None) if position is None else (position.t_s, position.enu_m, None)
    if enu_m is None:
        raise RecordingError(f"{recording.name} has no trajectory: there are no positions in {stream or 'any stream'}.")
    rows = np.isfinite(enu_m).all(axis=1)
    xyzw = np.tile([0.0, 0.0, 0.0, 1.0], (len(enu_m), 1))
    if euler is not None:
        rows &= np.isfinite(euler).all(axis=1)
        xyzw[rows] = quaternion_from_dcm(dcm_from_euler(euler[rows]))
    return t_s[rows], enu_m[rows], xyzw[rows]


def write_tum(recording: Recording, path: Path, stream: str | None = None) -> None:
    """Write lines ``t x y z qx qy qz qw`` with positions in ENU [m] and times since 1970 (or the start if unknown)."""
    start_us = round(recording.start_utc.timestamp() * 1e6) if recording.start_utc else 0
    lines = ["# timestamp x y z qx qy qz qw"]
    for t, p, q in zip(*trajectory_of(recording, stream), strict=True):
        seconds, fraction_ns = divmod(start_us * 1000 + round(t * 1e9), 1_000_000_000)
        lines.append(" ".join([f"{seconds}.{fraction_ns:09d}", *(f"{value:.9g}" for value in (*p, *q))]))
    write_text(path, "\n".join([*lines, ""]))


def write_gpx(recording: Recording, path: Path, stream: str | None = None) -> None:
    """Write the trajectory to a GPX 1.1 file as one track with heights above the ellipsoid.

    The points have no times if the date of the recording is unknown.

    Raises:
        RecordingError: the recording has no origin on the Earth.
    """
    if recording.origin is None:
        raise RecordingError(f"{recording.name} has no origin on the Earth, which GPX needs; write .tum or .csv.")
    t_s, enu_m, _ = trajectory_of(recording, stream)
    gpx = ET.Element("gpx", xmlns="http://www.topografix.com/GPX/1/1", version="1.1", creator="jerkbench")
    track = ET.SubElement(gpx, "trk")
    ET.SubElement(track, "name").text = recording.name
    segment = ET.SubElement(track, "trkseg")
    for t, (lat, lon, h) in zip(t_s.tolist(), enu_to_geodetic(enu_m, recording.origin), strict=True):
        point = ET.SubElement(segment, "trkpt", lat=f"{lat:.9f}", lon=f"{lon:.9f}")
        ET.SubElement(point, "ele").text = f"{h:.4f}"
        if recording.start_utc is not None:
            time = recording.start_utc + timedelta(seconds=t)
            ET.SubElement(point, "time").text = time.isoformat(timespec="microseconds").replace("+00:00", "Z")
    write_atomically(path, lambda partial: ET.ElementTree(gpx).write(partial, encoding="utf-8", xml_declaration=True))


TRAJECTORIES = {".tum": write_tum, ".gpx": write_gpx}
"""The function that writes a trajectory, for each suffix."""
