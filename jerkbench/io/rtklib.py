"""Readers of RTKLIB's solutions (.pos), and of the IMU logs that RTKLIB writes with a time tag."""

import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_geodetic, ecef_to_origin, enu_axes, enu_to_geodetic
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS, calendar_ns
from jerkbench.io.sanitiser import possible_rows
from jerkbench.io.text import (
    Line,
    complete_lines,
    cut_note,
    is_number,
    parse_numbers,
    read_bytes,
    read_lines,
    require_increasing,
)
from jerkbench.recording import Origin

if TYPE_CHECKING:
    import pandas as pd

# Solutions of RTKLIB. The last comment of a .pos file names the columns, which depend on RTKLIB's output options.

_CLOCKS = ("GPST", "UTC", "JST")
_FRAMES = {
    "latitude(deg)": ("latitude(deg) longitude(deg) height(m)", "neu"),
    "latitude(d'\")": ("latitude(d'\") longitude(d'\") height(m)", "neu"),
    "x-ecef(m)": ("x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
    "e-baseline(m)": ("e-baseline(m) n-baseline(m) u-baseline(m)", "enu"),
}
"""For the first column of each position format: the three columns, and the letters of the axes."""

_COLUMNS = (
    "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)
"""Example of a header, for positions in degrees and with velocities."""

_SEPARATORS = str.maketrans(",;\t", "   ")
_WEEK, _TIME_OF_WEEK = re.compile(r"\d{1,4}", re.ASCII), re.compile(r"\d{1,6}(\.\d{1,12})?", re.ASCII)
_JST_NS = 9 * 3600 * 1_000_000_000
_ENU_FROM = {"neu": [1, 0, 2], "enu": [0, 1, 2], "xyz": [0, 1, 2]}
"""Indices of east, north, up in the axes of the file; x, y, z are rotated later, depending on the position."""

_CROSSED = {axes: [*axes, *(axes[k] + axes[(k + 1) % 3] for k in range(3))] for axes in _ENU_FROM}
"""The letters in the names of the six standard deviations: a, b, c, ab, bc, ca for the axes a, b, c."""

POS_POSITION = ("latitude", "longitude", "height")
POS_VELOCITY = ("ve", "vn", "vu")
_PAIRS = ("ee", "nn", "uu", "en", "eu", "nu")
POS_COVARIANCE = tuple(f"c{pair}" for pair in _PAIRS)
POS_VELOCITY_COVARIANCE = tuple(f"cv{pair}" for pair in _PAIRS)
"""Columns of the table of a solution: positions in degrees and metres, velocities and covariances in ENU."""

POS_QUALITY = "quality"


def read_pos(path: Path, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Read a .pos file in any format that RTKLIB writes. Return the table, and notes about dropped rows.

    Times may be in GPST, UTC or JST, as dates or as week and time of week. Positions may be in decimal degrees, in
    degrees, minutes and seconds, in ECEF, or relative to a base station whose position is in the header. Velocities are
    optional, and the columns may be separated by white space, a comma or a semicolon. The table has the columns t
    (UTC), `POS_POSITION`, `POS_QUALITY` and `POS_COVARIANCE`. If the file has velocities, the table also has
    `POS_VELOCITY` and `POS_VELOCITY_COVARIANCE`. Velocities and covariances are in ENU at each fix.

    A truncated first or last line is dropped. For each covariance c, RTKLIB writes sd, the square root of |c| with the
    sign of c. The reader therefore computes c = sd |sd|.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Raises:
        RecordingError: the file does not exist, is empty, has a header that RTKLIB does not write, or has a damaged
            line. The error message names the file and the line.
    """
    import pandas as pd

    lines = [(number, text.translate(_SEPARATORS)) for number, text in read_lines(path)]
    comments = [line for line in lines if line[1].startswith("%")]
    clock, names = _header(path, comments)
    rows, notes = complete_lines(path, [line for line in lines if not line[1].startswith("%")])
    split = [(number, text.split(maxsplit=2)) for number, text in rows]
    numbers = parse_numbers(path, [(n, fields[2] if len(fields) > 2 else "") for n, fields in split], len(names))
    leap_ns = round(gpst_minus_utc_s * 1e9)
    gpst_ns = np.array([_gpst_ns(path, n, fields[:2], clock, leap_ns) for n, fields in split], dtype=np.int64)
    require_increasing(path, rows, gpst_ns, "the time")
    table, axes = pd.DataFrame(dict(zip(names, numbers.T, strict=True))), _FRAMES[names[0]][1]
    places, turns = _places(path, comments, table)
    possible, impossible = possible_rows(path.name, places=places, utc_ns=gpst_ns - leap_ns)
    columns = {"t": pd.to_datetime(gpst_ns - leap_ns, utc=True), **dict(zip(POS_POSITION, places.T, strict=True))}
    columns |= {POS_QUALITY: table["Q"]} | _covariance(POS_COVARIANCE, table, "sd{}(m)", turns)
    velocity = [f"v{axis}(m/s)" for axis in axes]
    if {*velocity, *(f"sdv{letters}" for letters in _CROSSED[axes])} <= set(table):
        mps = np.einsum("nij,nj->ni", turns, table[velocity].to_numpy())
        columns |= dict(zip(POS_VELOCITY, mps.T, strict=True))
        columns |= _covariance(POS_VELOCITY_COVARIANCE, table, "sdv{}", turns)
    return pd.DataFrame(columns)[possible].reset_index(drop=True), (*notes, *impossible)


def is_ellipsoidal(path: Path) -> bool | None:
    """Return whether heights are above the ellipsoid, or None if the header does not state the height datum."""
    text = " ".join(text for _, text in read_lines(path) if text.startswith("%"))
    return next((datum == "ellipsoidal" for datum in ("ellipsoidal", "geodetic") if f"WGS84/{datum}" in text), None)


def _header(path: Path, comments: Sequence[Line]) -> tuple[str, list[str]]:
    """Return the time system of the stamps, and the names of the other columns, with three names for each angle in d'".

    Raises:
        RecordingError: no comment names the columns, or a column is missing. The error message names the file and the
            line.
    """
    for number, text in reversed(comments):
        clock, *names = text.lstrip("% ").split() or [""]
        if not names or clock not in _CLOCKS or names[0] not in _FRAMES:
            continue
        places, axes = _FRAMES[names[0]]
        wanted = (*places.split(), "Q", *(f"sd{letters}(m)" for letters in _CROSSED[axes]))
        if missing := [name for name in wanted if name not in names]:
            raise RecordingError(
                f"{path}, line {number}: the header lacks {', '.join(missing)}; let RTKLIB write the file."
            )
        return clock, [part for name in names for part in ([name, *_parts(name)] if "(d'\")" in name else [name])]
    number, text = comments[-1] if comments else (1, "no line that starts with %")
    raise RecordingError(
        f"{path}, line {number}: the header is '{' '.join(text.split())}', but a header such as '% {_COLUMNS}' is"
        " needed; let RTKLIB write the header (out-outhead=on)."
    )


def _parts(name: str) -> list[str]:
    """Return names for the columns of the minutes and seconds of an angle, which have no names in the header."""
    return [f"{name} minutes", f"{name} seconds"]


def _places(path: Path, comments: Sequence[Line], table: "pd.DataFrame") -> tuple[FloatArray, FloatArray]:
    """Return positions (m, 3) (latitude [deg], longitude [deg], height [m]), and rotations (m, 3, 3) to ENU."""
    names, axes = _FRAMES[table.columns[0]]
    position = np.array(table[names.split()])
    turns = np.tile(np.eye(3)[_ENU_FROM[axes]], (len(table), 1, 1))
    if axes == "xyz":
        return ecef_to_geodetic(position), np.array([enu_axes(ecef_to_origin(ecef_m)) for ecef_m in position])
    if axes == "enu":
        said = [text.lstrip("% ").partition(":") for _, text in comments]
        reference = next((numbers.split() for name, _, numbers in said if name.strip() == "ref pos"), [])
        if len(reference) != 3 or not all(map(is_number, reference)):
            raise RecordingError(
                f"{path} has baselines, but its header lacks the position of the base station (% ref pos : latitude"
                " longitude height); let RTKLIB write positions in degrees or in ECEF."
            )
        return enu_to_geodetic(position, Origin(*map(float, reference))), turns
    for k, name in enumerate(names.split()[:2]):
        if _parts(name)[0] in table:  # the sign of the degrees, even of -0, is the sign of the angle
            minutes, seconds = (table[part] for part in _parts(name))
            position[:, k] = np.copysign(np.abs(position[:, k]) + minutes / 60 + seconds / 3600, position[:, k])
    return position, turns


def _gpst_ns(path: Path, number: int, fields: list[str], clock: str, leap_ns: int) -> int:
    """Return the GPS time [ns since 1970] of ``["2025/07/08", "19:34:18.499"]`` or ``["2374", "243258.499"]``."""
    first, second = fields
    stamp_ns = calendar_ns(first.replace("/", "-"), second)
    if stamp_ns is None and _WEEK.fullmatch(first) and _TIME_OF_WEEK.fullmatch(second):
        return GPS_EPOCH_NS + int(first) * WEEK_NS + round(float(second) * 1e9)
    if stamp_ns is None:
        raise RecordingError(
            f"{path}, line {number}: '{first} {second}' is not a {clock} stamp; expected a date and time such as"
            " 2025/07/08 19:34:18.499, or week and time of week such as 2374 243258.499."
        )
    return stamp_ns + {"GPST": 0, "UTC": leap_ns, "JST": leap_ns - _JST_NS}[clock]


def _covariance(
    names: Sequence[str], table: "pd.DataFrame", deviation: str, turns: FloatArray
) -> dict[str, FloatArray]:
    """Return the columns ``names`` of covariances in ENU, computed from the columns of standard deviations."""
    sd = table[[deviation.format(letters) for letters in _CROSSED[_FRAMES[table.columns[0]][1]]]].to_numpy()
    a, b, c, ab, bc, ca = (sd * np.abs(sd)).T
    matrices = turns @ np.stack([a, ab, ca, ab, b, bc, ca, bc, c], axis=1).reshape(-1, 3, 3) @ turns.transpose(0, 2, 1)
    return dict(zip(names, matrices[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].T, strict=True))


# The time tag (.tag) that RTKLIB writes with a stream, with the start and the duration of the stream.

_MAGIC = b"TIMETAG RTKLIB"
_START = struct.Struct("<60xIId")  # header of 60 bytes, tick, time_t, fraction of a second
_RECORD = struct.Struct("<II")  # tick [ms since the start], position in the stream's file


def read_time_tag(path: Path) -> tuple[int, float]:
    """Return the start of a stream by the logger's clock (GPST since 1970 [ns]), and the duration of the stream [s].

    A time tag is a little-endian binary file with a header of 60 bytes, u32 tick, u32 time_t, f64 fraction, and then
    the records (u32 ms, u32 filepos).

    Raises:
        RecordingError: the file does not exist, is empty, is not a time tag, or is truncated.
    """
    content = read_bytes(path)
    if not content.startswith(_MAGIC):
        raise RecordingError(f"{path} does not begin with '{_MAGIC.decode()}'; it must be a time tag of RTKLIB.")
    records, excess = divmod(len(content) - _START.size, _RECORD.size)
    if records < 1 or excess:
        raise RecordingError(
            f"{path} has {len(content)} bytes, but a time tag has {_START.size} bytes and {_RECORD.size} more bytes for"
            " each record. The file is truncated; copy the file again."
        )
    _, seconds, fraction = _START.unpack_from(content)
    if not 0.0 <= fraction < 1.0:
        raise RecordingError(f"{path}: the fractional second of the start is {fraction}; it must lie in [0, 1).")
    last_ms, _ = _RECORD.unpack_from(content, len(content) - _RECORD.size)
    if last_ms == 0:
        raise RecordingError(f"{path}: the last record is at 0 ms, so the time tag is empty; use another time tag.")
    start_ns = seconds * 1_000_000_000 + round(fraction * 1e9)
    possible_rows(path.name, utc_ns=[start_ns])
    return start_ns, last_ms * 1e-3


MIN_POS_ROWS = 2
CLOCKS_AGREE = 0.01
"""Maximum relative difference of the durations by the sensor's and the logger's clock. A time tag with a larger
difference belongs to another recording."""


class ImuLog(NamedTuple):
    """The samples of an IMU in the axes and units of the sensor.

    Attributes:
        start_gpst_ns: GPS time of the first sample, in nanoseconds since 1970 on the GPS calendar.
        t_s: (n,) time since the first sample [s].
        accel: (n, 3) specific force in the sensor's axes and unit.
        gyro: (n, 3) angular rate in the sensor's axes and unit.
        notes: notes about dropped rows.
    """

    start_gpst_ns: int
    t_s: FloatArray
    accel: FloatArray
    gyro: FloatArray
    notes: tuple[str, ...] = ()


def read_imu_log(path: Path, tag_path: Path) -> ImuLog:
    """Read an IMU log with the columns ax, ay, az, gx, gy, gz and milliseconds since power-up, without a header.

    A truncated first or last line is dropped, even if only the time in the last column is truncated.

    The clock of the sensor (column ms) drifts, so its times are scaled to the duration in the time tag. The time since
    the start is t = (ms - ms[0]) total / (ms[-1] - ms[0]), where total is this duration.

    Raises:
        RecordingError: a file is missing, empty or damaged, or the two files belong to different recordings. For a
            damaged line, the error message contains the line number.
    """
    lines, notes = complete_lines(path, read_lines(path), ",")
    table = parse_numbers(path, lines, 7, ",")
    if not notes and len(table) > MIN_POS_ROWS and table[-1, 6] < table[-2, 6]:
        lines, table, notes = lines[:-1], table[:-1], cut_note(path.name, first=False, last=True)
    milliseconds = table[:, 6]
    require_increasing(path, lines, milliseconds, "the time (field 7)")
    start_ns, total_s = read_time_tag(tag_path)
    elapsed_s = float(milliseconds[-1] - milliseconds[0]) * 1e-3
    if abs(elapsed_s - total_s) > CLOCKS_AGREE * total_s:
        raise RecordingError(
            f"{path} covers {elapsed_s:.3f} s, but its time tag {tag_path.name} covers {total_s:.3f} s;"
            " use the time tag of the same recording, and check that neither file is truncated."
        )
    t_s = (milliseconds - milliseconds[0]) * (1e-3 * total_s / elapsed_s)
    return ImuLog(start_ns, t_s, table[:, :3], table[:, 3:6], notes)
