"""A recording or a trajectory as a table: one row for each stamp of any stream; TUM, KML and GPX."""

import xml.etree.ElementTree as ET
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.files import write_atomically, write_text
from jerkbench.geometry import dcm_from_euler, enu_to_geodetic, quaternion_from_dcm
from jerkbench.io.frames import axes_in_enu, covariance_in_enu
from jerkbench.recording import Recording
from jerkbench.timeline import nanoseconds

if TYPE_CHECKING:
    import pandas as pd

_COORDINATES = ("enu", "geodetic", "ned")
POSITIONS = {
    "enu": ("east_m", "north_m", "up_m"),
    "ned": ("north_m", "east_m", "down_m"),
    "geodetic": ("latitude_deg", "longitude_deg", "height_m"),
}
"""Columns of a position in each kind of coordinates."""

VELOCITIES = {"enu": ("east_mps", "north_mps", "up_mps"), "ned": ("north_mps", "east_mps", "down_mps")}
_BODY = ("forward_mps", "left_mps", "up_mps")
_UPPER = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]

WrittenColumns = dict[str, FloatArray]


def recording_table(recording: Recording, coordinates: str = "enu") -> "pd.DataFrame":
    """Return the table; times are seconds since the recording's start, units are in the names.

    Variances stay in the order of the columns of their stream; with "geodetic" they are of east, north and up.

    Raises:
        RecordingError: "geodetic" without an origin.
    """
    import pandas as pd

    streams = _streams(recording, coordinates)
    t_ns = np.unique(np.concatenate([nanoseconds(t_s) for t_s, _ in streams]))
    table: WrittenColumns = {"t_s": t_ns * 1e-9}
    for t_s, columns in streams:
        rows = np.searchsorted(t_ns, nanoseconds(t_s))
        for name, values in columns.items():
            table[name] = np.full(len(t_ns), np.nan)
            table[name][rows] = values
    return pd.DataFrame(table)


def write_table(recording: Recording, path: Path, coordinates: str = "enu") -> None:
    """Write a .csv or .parquet file."""
    write_frame(recording_table(recording, coordinates), path)


def write_frame(table: "pd.DataFrame", path: Path) -> None:
    """Write any table to a .csv or .parquet file."""
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
    """Return what the reference knows, by column, at its own stamps."""
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


# A trajectory as text: TUM, KML and GPX.

_STREAMS = ("position", "reference")


class Path3D(NamedTuple):
    """A trajectory: times, positions (n, 3) in ENU, quaternions (n, 4) scalar last, body -> ENU."""

    t_s: FloatArray
    enu_m: FloatArray
    xyzw: FloatArray


def trajectory_of(recording: Recording, stream: str | None = None) -> Path3D:
    """Return the reference's trajectory, or that of the fixes (with no rotation); None: the first of these there is.

    Raises:
        RecordingError: it has no such positions.
    """
    reference, position = recording.reference, recording.position
    if stream == "reference" or (stream is None and reference.enu_m is not None):
        t_s, enu_m, euler = reference.t_s, reference.enu_m, reference.euler_rad
    else:
        t_s, enu_m, euler = (reference.t_s, None, None) if position is None else (position.t_s, position.enu_m, None)
    if enu_m is None:
        raise RecordingError(f"{recording.name} has no positions in its {stream or 'streams'}: no trajectory to write.")
    rows = np.isfinite(enu_m).all(axis=1)
    xyzw = np.tile([0.0, 0.0, 0.0, 1.0], (len(enu_m), 1))
    if euler is not None:
        rows &= np.isfinite(euler).all(axis=1)
        xyzw[rows] = quaternion_from_dcm(dcm_from_euler(euler[rows]))
    return Path3D(t_s[rows], enu_m[rows], xyzw[rows])


def write_tum(recording: Recording, path: Path, stream: str | None = None) -> None:
    """Write lines ``t x y z qx qy qz qw``: seconds since 1970 where that is known, ENU [m]."""
    trajectory = trajectory_of(recording, stream)
    start_us = round(recording.start_utc.timestamp() * 1e6) if recording.start_utc else 0
    lines = ["# timestamp x y z qx qy qz qw"]
    for t, p, q in zip(trajectory.t_s, trajectory.enu_m, trajectory.xyzw, strict=True):
        seconds, fraction_ns = divmod(start_us * 1000 + round(t * 1e9), 1_000_000_000)
        lines.append(" ".join([f"{seconds}.{fraction_ns:09d}", *(f"{value:.9g}" for value in (*p, *q))]))
    write_text(path, "\n".join([*lines, ""]))


def write_kml(recording: Recording, path: Path, stream: str | None = None) -> None:
    """Write the trajectory as one line on the ellipsoid.

    Raises:
        RecordingError: it has no origin on the Earth.
    """
    kml = ET.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    placemark = ET.SubElement(ET.SubElement(kml, "Document"), "Placemark")
    ET.SubElement(placemark, "name").text = recording.name
    line = ET.SubElement(placemark, "LineString")
    ET.SubElement(line, "altitudeMode").text = "absolute"
    places = _on_earth(recording, trajectory_of(recording, stream), "KML")
    ET.SubElement(line, "coordinates").text = " ".join(f"{lon:.9f},{lat:.9f},{h:.4f}" for lat, lon, h in places)
    _write_xml(kml, path)


def write_gpx(recording: Recording, path: Path, stream: str | None = None) -> None:
    """Write the trajectory as a track of GPX 1.1, heights above the ellipsoid.

    Raises:
        RecordingError: it has no origin on the Earth, or no date.
    """
    if recording.start_utc is None:
        raise RecordingError(f"{recording.name} has no date, and each point of a GPX has one: write .tum or .csv.")
    trajectory = trajectory_of(recording, stream)
    gpx = ET.Element("gpx", xmlns="http://www.topografix.com/GPX/1/1", version="1.1", creator="jerkbench")
    track = ET.SubElement(gpx, "trk")
    ET.SubElement(track, "name").text = recording.name
    segment = ET.SubElement(track, "trkseg")
    for t, (lat, lon, h) in zip(trajectory.t_s.tolist(), _on_earth(recording, trajectory, "GPX"), strict=True):
        point = ET.SubElement(segment, "trkpt", lat=f"{lat:.9f}", lon=f"{lon:.9f}")
        ET.SubElement(point, "ele").text = f"{h:.4f}"
        time = recording.start_utc + timedelta(seconds=t)
        ET.SubElement(point, "time").text = time.isoformat(timespec="microseconds").replace("+00:00", "Z")
    _write_xml(gpx, path)


def _on_earth(recording: Recording, trajectory: Path3D, kind: str) -> FloatArray:
    """Latitude, longitude [deg] and height [m] of each point (n, 3)."""
    if recording.origin is None:
        raise RecordingError(f"{recording.name} has no origin on the Earth; {kind} needs one: write .tum or .csv.")
    return enu_to_geodetic(trajectory.enu_m, recording.origin)


def _write_xml(root: ET.Element, path: Path) -> None:
    write_atomically(path, lambda partial: ET.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True))


TRAJECTORIES = {".tum": write_tum, ".kml": write_kml, ".gpx": write_gpx}
"""What writes a trajectory into a file of each suffix."""
