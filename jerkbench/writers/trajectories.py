"""A trajectory as text: TUM and KML."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.files import write_atomically, write_text
from jerkbench.geometry import dcm_from_euler, enu_to_geodetic, quaternion_from_dcm
from jerkbench.recording import Recording

STREAMS = ("position", "reference")


@dataclass(frozen=True)
class Path3D:
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
        t_s, enu_m, euler = reference.t_s, None, None
        if position is not None:
            t_s, enu_m = position.t_s, position.enu_m
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
    if recording.origin is None:
        raise RecordingError(f"{recording.name} has no origin on the Earth; KML needs one: convert it to .tum.")
    places = enu_to_geodetic(trajectory_of(recording, stream).enu_m, recording.origin)
    kml = ET.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    placemark = ET.SubElement(ET.SubElement(kml, "Document"), "Placemark")
    ET.SubElement(placemark, "name").text = recording.name
    line = ET.SubElement(placemark, "LineString")
    ET.SubElement(line, "altitudeMode").text = "absolute"
    ET.SubElement(line, "coordinates").text = " ".join(f"{lon:.9f},{lat:.9f},{h:.4f}" for lat, lon, h in places)
    write_atomically(path, lambda partial: ET.ElementTree(kml).write(partial, encoding="utf-8", xml_declaration=True))
