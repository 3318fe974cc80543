"""A solution of RTKLIB (.pos) as a table in ENU, and the logs that RTKLIB writes with it."""

import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_geodetic, ecef_to_origin, enu_axes, enu_to_geodetic
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS, calendar_ns
from jerkbench.io.sanitiser import possible_rows
from jerkbench.io.text import (
    Line,
    cut_note,
    parse_numbers,
    read_bytes,
    read_lines,
    require_increasing,
    whole_lines,
)
from jerkbench.recording import Origin

if TYPE_CHECKING:
    import pandas as pd

# The header of a .pos file: the options that RTKLIB wrote with, and its columns.

SolutionFrame = Literal["geodetic", "dms", "ecef", "baseline"]

_CLOCKS = ("GPST", "UTC", "JST")
_FRAMES: dict[str, tuple[SolutionFrame, str, str]] = {
    "latitude(deg)": ("geodetic", "latitude(deg) longitude(deg) height(m)", "neu"),
    "latitude(d'\")": ("dms", "latitude(d'\") longitude(d'\") height(m)", "neu"),
    "x-ecef(m)": ("ecef", "x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
    "e-baseline(m)": ("baseline", "e-baseline(m) n-baseline(m) u-baseline(m)", "enu"),
}
"""First column of each kind of position: the frame, its three columns, and the letters of its axes."""

_COLUMNS = (
    "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)
"""The header of degrees with velocities, as an example."""

_REFERENCE = "ref pos"


class PosHeader(NamedTuple):
    """The columns behind the two fields of time.

    Attributes:
        clock: GPST, UTC or JST.
        frame: of the positions; dms: degrees, minutes and seconds in columns of their own.
        axes: letters of the axes, in the order of the columns.
        columns: the number of each by its name; of an angle in degrees, minutes and seconds where it begins.
        width: how many fields a row has behind its time.
        reference: of the base: the three numbers that the header gives, or none.
        ellipsoidal: whether heights are above the ellipsoid, as RTKLIB's line "% (lat/lon/height=WGS84/ellipsoidal,
            ..." says, or above the geoid ("WGS84/geodetic"); None: the header does not say.
    """

    clock: str
    frame: SolutionFrame
    axes: str
    columns: dict[str, int]
    width: int
    reference: tuple[float, ...]
    ellipsoidal: bool | None

    def named(self, *names: str) -> list[int] | None:
        """Return the numbers of columns, None where the file lacks one of them."""
        return [self.columns[name] for name in names] if set(names) <= set(self.columns) else None

    @property
    def crossed(self) -> list[str]:
        """The letters of the six standard deviations a, b, c, ab, bc, ca."""
        return [*self.axes, *(self.axes[k] + self.axes[(k + 1) % 3] for k in range(3))]


def read_header(path: Path, comments: Sequence[Line]) -> PosHeader:
    """Return what the comments (lines that begin with %) say.

    Raises:
        RecordingError: none of them names the columns, or a column is missing; names file and line.
    """
    for number, text in reversed(comments):
        words = text.lstrip("% ").split()
        if len(words) > 1 and words[0] in _CLOCKS and words[1] in _FRAMES:
            return _header(path, number, words, comments)
    number, text = comments[-1] if comments else (1, "no line that begins with %")
    raise RecordingError(
        f"{path}, line {number}: the header is '{' '.join(text.split())}'; it must be like '% {_COLUMNS}': let RTKLIB"
        " write it (out-outhead=on)."
    )


def _header(path: Path, line: int, words: list[str], comments: Sequence[Line]) -> PosHeader:
    frame, names, axes = _FRAMES[words[1]]
    widths = [3 if word.endswith("(d'\")") else 1 for word in words[1:]]
    columns = dict(zip(words[1:], (int(k) for k in np.cumsum([0, *widths])), strict=False))
    text = " ".join(text for _, text in comments)
    datum = next((datum for datum in ("ellipsoidal", "geodetic") if f"WGS84/{datum}" in text), None)
    ellipsoidal = None if datum is None else datum == "ellipsoidal"
    header = PosHeader(words[0], frame, axes, columns, sum(widths), _reference(comments), ellipsoidal)
    wanted = (*names.split(), "Q", *(f"sd{letters}(m)" for letters in header.crossed))
    if missing := [name for name in wanted if name not in columns]:
        raise RecordingError(f"{path}, line {line}: the header lacks {', '.join(missing)}; let RTKLIB write the file.")
    return header


def _reference(comments: Sequence[Line]) -> tuple[float, ...]:
    """The base's place, which RTKLIB writes in the frame of the solution; of baselines latitude, longitude, height."""
    said = [text.lstrip("% ").partition(":") for _, text in comments]
    numbers = next((numbers for name, _, numbers in said if name.strip() == _REFERENCE), "")
    try:
        return tuple(float(number) for number in numbers.split())
    except ValueError:
        return ()


_SEPARATORS = str.maketrans(",;\t", "   ")
_WEEK, _TIME_OF_WEEK = re.compile(r"\d{1,4}", re.ASCII), re.compile(r"\d{1,6}(\.\d{1,12})?", re.ASCII)
_JST_NS = 9 * 3600 * 1_000_000_000
_ENU_FROM = {"neu": [1, 0, 2], "enu": [0, 1, 2], "xyz": [0, 1, 2]}
"""The rows of the file's axes that are east, north, up; x, y, z are turned by the place."""


POS_PLACE = ("latitude", "longitude", "height")
POS_VELOCITY = ("ve", "vn", "vu")
_PAIRS = ("ee", "nn", "uu", "en", "eu", "nu")
POS_COVARIANCE = tuple(f"c{pair}" for pair in _PAIRS)
POS_VELOCITY_COVARIANCE = tuple(f"cv{pair}" for pair in _PAIRS)
"""The columns of a solution: degrees and metres; the covariances are of east, north and up."""

POS_QUALITY = "quality"


def read_pos(path: Path, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Read a .pos file in any format that RTKLIB writes; return the table, and notes on what was dropped.

    Times in GPST, UTC or JST, as dates or as week and time of week; places in degrees, in degrees, minutes and seconds,
    in ECEF, or as a baseline from a base whose place the header gives; velocities or none; any separator. The table has
    the columns t (UTC), `POS_PLACE`, `POS_QUALITY`, `POS_COVARIANCE`, and, where the file has velocities,
    `POS_VELOCITY` and `POS_VELOCITY_COVARIANCE`, all in ENU at each fix.

    A last line that was cut off is dropped. RTKLIB writes each covariance as the root of its absolute value with its
    sign: c = sd |sd|.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Raises:
        RecordingError: no such file, empty, another header, or a line that is damaged; names file and line.
    """
    import pandas as pd

    lines = [(number, text.translate(_SEPARATORS)) for number, text in read_lines(path)]
    header = read_header(path, [line for line in lines if line[1].startswith("%")])
    rows, notes = whole_lines(path, [line for line in lines if not line[1].startswith("%")])
    split = [(number, text.split(maxsplit=2)) for number, text in rows]
    numbers = parse_numbers(path, [(n, fields[2] if len(fields) > 2 else "") for n, fields in split], header.width)
    leap_ns = round(gpst_minus_utc_s * 1e9)
    gpst_ns = np.array([_gpst_ns(path, n, fields[:2], header.clock, leap_ns) for n, fields in split], dtype=np.int64)
    require_increasing(path, rows, gpst_ns, "the time")
    places, turns = _places(path, header, numbers)
    possible, impossible = possible_rows(path.name, places=places, utc_ns=gpst_ns - leap_ns)
    numbers, turns = numbers[possible], turns[possible]
    columns = {"t": pd.to_datetime(gpst_ns[possible] - leap_ns, utc=True)}
    columns |= dict(zip(POS_PLACE, places[possible].T, strict=True)) | {POS_QUALITY: numbers[:, header.columns["Q"]]}
    deviations = header.named(*(f"sd{letters}(m)" for letters in header.crossed))
    columns |= dict(zip(POS_COVARIANCE, _covariance(numbers[:, deviations], turns), strict=True))
    velocity = header.named(*(f"v{axis}(m/s)" for axis in header.axes))
    deviations = header.named(*(f"sdv{letters}" for letters in header.crossed))
    if velocity and deviations:
        mps = np.einsum("nij,nj->ni", turns, numbers[:, velocity])
        columns |= dict(zip(POS_VELOCITY, mps.T, strict=True))
        columns |= dict(zip(POS_VELOCITY_COVARIANCE, _covariance(numbers[:, deviations], turns), strict=True))
    return pd.DataFrame(columns), (*notes, *impossible)


def is_ellipsoidal(path: Path) -> bool | None:
    """Return whether the header says that heights are above the ellipsoid; None: it does not say."""
    return read_header(path, [line for line in read_lines(path) if line[1].startswith("%")]).ellipsoidal


def _columns(header: PosHeader) -> list[int]:
    """The three columns of the places; of an angle in degrees, minutes and seconds the first."""
    names = next(names for frame, names, _ in _FRAMES.values() if frame == header.frame)
    return [header.columns[name] for name in names.split()]


def _places(path: Path, header: PosHeader, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Latitude and longitude [deg] and height [m] (m, 3), and what turns the file's vectors into ENU (m, 3, 3)."""
    columns = _columns(header)
    position = numbers[:, columns]
    turns = np.tile(np.eye(3)[_ENU_FROM[header.axes]], (len(numbers), 1, 1))
    if header.frame == "dms":
        angles = [_degrees(numbers[:, first : first + 3]) for first in columns[:2]]
        return np.column_stack([*angles, position[:, 2]]), turns
    if header.frame == "ecef":
        return ecef_to_geodetic(position), np.array([enu_axes(ecef_to_origin(place)) for place in position])
    if header.frame == "baseline":
        if len(header.reference) != 3:
            raise RecordingError(
                f"{path} has baselines, and its header does not say from where (% ref pos : latitude longitude height);"
                " let RTKLIB write degrees or ECEF."
            )
        return enu_to_geodetic(position, Origin(*header.reference)), turns
    return position, turns


def _degrees(dms: FloatArray) -> FloatArray:
    """Degrees of (m, 3) degrees, minutes, seconds; the sign of the degrees, -0 too, is that of the whole."""
    size = np.abs(dms[:, 0]) + dms[:, 1] / 60 + dms[:, 2] / 3600
    return np.asarray(np.copysign(size, dms[:, 0]))


def _gpst_ns(path: Path, number: int, fields: list[str], clock: str, leap_ns: int) -> int:
    """GPST since 1970 of ``["2025/07/08", "19:34:18.499"]`` or ``["2374", "243258.499"]``."""
    first, second = fields
    stamp_ns = calendar_ns(first.replace("/", "-"), second)
    if stamp_ns is None and _WEEK.fullmatch(first) and _TIME_OF_WEEK.fullmatch(second):
        return GPS_EPOCH_NS + int(first) * WEEK_NS + round(float(second) * 1e9)
    if stamp_ns is None:
        raise RecordingError(
            f"{path}, line {number}: '{first} {second}' is no {clock} stamp; it must look like 2025/07/08 19:34:18.499,"
            " or, week and time of week, like 2374 243258.499."
        )
    return stamp_ns + {"GPST": 0, "UTC": leap_ns, "JST": leap_ns - _JST_NS}[clock]


def _covariance(sd: FloatArray, turns: FloatArray) -> FloatArray:
    """(m, 6) a, b, c, ab, bc, ca in the file's axes -> (6, m) in the order of `POS_COVARIANCE`."""
    a, b, c, ab, bc, ca = (sd * np.abs(sd)).T
    matrices = turns @ np.stack([a, ab, ca, ab, b, bc, ca, bc, c], axis=1).reshape(-1, 3, 3) @ turns.transpose(0, 2, 1)
    return np.asarray(matrices[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].T)


# The time tag that RTKLIB writes beside a stream (.tag): when the stream began and how long it
# lasted.

_MAGIC = b"TIMETAG RTKLIB"
_START = struct.Struct("<60xIId")  # header, tick, time_t, fraction of a second
_RECORD = struct.Struct("<II")  # tick [ms since the start], position in the stream's file


def read_time_tag(path: Path) -> tuple[int, float]:
    """Return when a stream began by the logger's clock (GPST since 1970 [ns]), and how long it lasted [s].

    A time tag is little-endian; 60 B header, u32 tick, u32 time_t, f64 fraction, then (u32 ms, u32 filepos)...

    Raises:
        RecordingError: no such file, empty, not a time tag, or cut short.
    """
    content = read_bytes(path)
    if not content.startswith(_MAGIC):
        raise RecordingError(f"{path} does not begin with '{_MAGIC.decode()}'; it must be a time tag of RTKLIB.")
    records, excess = divmod(len(content) - _START.size, _RECORD.size)
    if records < 1 or excess:
        raise RecordingError(
            f"{path} has {len(content)} bytes; {_START.size} and then {_RECORD.size} for each record are expected:"
            " it was cut short, copy it again."
        )
    _, seconds, fraction = _START.unpack_from(content)
    if not 0.0 <= fraction < 1.0:
        raise RecordingError(f"{path}: the fraction of the start's second is {fraction}; it must lie in [0, 1).")
    last_ms, _ = _RECORD.unpack_from(content, len(content) - _RECORD.size)
    if last_ms == 0:
        raise RecordingError(f"{path}: its last record is at 0 ms; a tag of a recording that ran ends later.")
    start_ns = seconds * 1_000_000_000 + round(fraction * 1e9)
    possible_rows(path.name, utc_ns=[start_ns])
    return start_ns, last_ms * 1e-3


MIN_POS_ROWS = 2
CLOCKS_AGREE = 0.01
"""By how much the sensor's and the logger's clock may differ before the tag is taken for another recording's."""


class ImuLog(NamedTuple):
    """An IMU's samples in its own axes and units.

    Attributes:
        start_gpst_ns: GPST of the first sample, nanoseconds of the calendar since 1970.
        t_s: (n,) time since then.
        accel: (n, 3) specific force, the sensor's axes and unit.
        gyro: (n, 3) angular rate, the sensor's axes and unit.
        notes: what was dropped, in sentences.
    """

    start_gpst_ns: int
    t_s: FloatArray
    accel: FloatArray
    gyro: FloatArray
    notes: tuple[str, ...] = ()


def read_imu_log(path: Path, tag_path: Path) -> ImuLog:
    """Read a log without header: ax, ay, az, gx, gy, gz, milliseconds since power-up.

    A first and a last line that were cut off are dropped; so is a last one whose time, the last of its numbers, was.

    The sensor's clock (ms) drifts; the tag's does not: t = (ms - ms[0]) total / (ms[-1] - ms[0]) from the tag's start.

    Raises:
        RecordingError: a file is missing, empty or damaged (names the line), or the two are not of one recording.
    """
    lines, notes = whole_lines(path, read_lines(path), ",")
    table = parse_numbers(path, lines, 7, ",")
    if not notes and len(table) > MIN_POS_ROWS and table[-1, 6] < table[-2, 6]:
        lines, table, notes = lines[:-1], table[:-1], cut_note(path.name, first=False, last=True)
    milliseconds = table[:, 6]
    require_increasing(path, lines, milliseconds, "the time (field 7)")
    start_ns, total_s = read_time_tag(tag_path)
    elapsed_s = float(milliseconds[-1] - milliseconds[0]) * 1e-3
    if abs(elapsed_s - total_s) > CLOCKS_AGREE * total_s:
        raise RecordingError(
            f"{path} covers {elapsed_s:.3f} s, its time tag {tag_path.name} {total_s:.3f} s;"
            " give the tag of the same recording, and neither of them cut short."
        )
    t_s = (milliseconds - milliseconds[0]) * (1e-3 * total_s / elapsed_s)
    return ImuLog(start_ns, t_s, table[:, :3], table[:, 3:6], notes)
