"""Readers of fixes in the formats of receivers (NMEA 0183 and GPX) and of RTKLIB (.pos).

Tables of NMEA and GPX have the columns t (UTC), latitude, longitude [deg] and height [m]. If the format has them, the
tables also have sigma_east, sigma_north, sigma_up [m], hdop, quality, and ve, vn [m/s]. Cells of missing values are
empty. `read_pos` states the columns of a solution of RTKLIB.
"""

import math
import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_geodetic, ecef_to_origin, enu_axes
from jerkbench.io.columns import Columns, TextFormat, read_text, times_ns
from jerkbench.io.conversions import GPS_EPOCH_NS, GPST_MINUS_UTC_S, SPEED_UNITS, calendar_ns, ns_since_1970
from jerkbench.io.files import Line, is_number, read_bytes, read_lines
from jerkbench.io.sanitiser import MAX_DATE_NS, possible_rows

if TYPE_CHECKING:
    import pandas as pd

    TrackTable = tuple[pd.DataFrame, tuple[str, ...]]

TrackRow = dict[str, Any]

DAY_MS = 86_400_000
POS_POSITION = ("latitude", "longitude", "height")
ORDER = ("t", *POS_POSITION, "sigma_east", "sigma_north", "sigma_up", "hdop", "quality", "ve", "vn")


MIXED = ".ubx"
"""Ending of logs with NMEA sentences between binary messages."""


def track_reader(path: Path) -> Callable[[Path], "TrackTable"] | None:
    """Return the reader for the format of the first bytes of a file, or None if the file is not a track."""
    if not path.is_file():
        return None
    if path.suffix.lower() == MIXED:
        return read_nmea
    with path.open("rb") as file:
        head = file.read(400).lstrip(b"\xef\xbb\xbf \t\r\n")
    if re.match(rb"[$!][A-Z]{4,5},|\$P[A-Z]", head):
        return read_nmea
    return read_gpx if head.startswith(b"<") and b"<gpx" in head else None


def _number(text: str | None) -> float | None:
    """Return the number in a field, or None if the field is not a finite number."""
    number = float(text) if text and is_number(text) else math.nan
    return number if math.isfinite(number) else None


def _utc_ns(text: str | None) -> int | None:
    """Convert an ISO 8601 date and time to nanoseconds since 1970, or to None if it is invalid."""
    try:
        moment = datetime.fromisoformat(text or "")
        return ns_since_1970(moment if moment.tzinfo else moment.replace(tzinfo=UTC))
    except (ValueError, OverflowError):
        return None


def _table(path: Path, rows: list[TrackRow], notes: tuple[str, ...], what: str) -> "TrackTable":
    """Return a table of the rows with a position on the Earth and a time, without empty columns, and notes."""
    import pandas as pd

    rows = [row for row in rows if row]
    placed = [row for row in rows if None not in map(row.get, ("latitude", "longitude", "t"))]
    if not placed:
        raise RecordingError(f"{path} has {len(rows)} reports, but no report has both a position and a time; {what}.")
    utc_ns = np.array([row["t"] for row in placed], dtype=np.float64)
    table = pd.DataFrame(placed).reindex(columns=list(ORDER))
    places = table[[*POS_POSITION]].to_numpy(dtype=np.float64)
    possible, impossible = possible_rows(path.name, places=places, utc_ns=utc_ns)
    table = table[possible].astype({"t": "int64"}).reset_index(drop=True)
    table["t"], notes = pd.to_datetime(table["t"], utc=True), (*notes, *impossible)
    if table["height"].isna().all():
        table["height"] = 0.0
        notes = (*notes, f"{path.name} has no heights, so all heights are set to 0.")
    columns = [name for name in ORDER if name in POS_POSITION or table[name].notna().any()]
    if others := len(rows) - len(placed):
        notes = (*notes, f"{path.name}: {others} of {len(rows)} reports have no fix or no time and are dropped.")
    return table[columns], notes


# NMEA 0183. The sentences GGA, GNS, RMC, GST and ZDA with the same time of day are combined into one row.


def read_nmea(path: Path) -> "TrackTable":
    """Return the fixes in NMEA sentences: positions of GGA, GNS and RMC, sigmas of GST, velocities of RMC.

    A sentence with a wrong checksum is dropped. Heights are above the ellipsoid if GGA or GNS contains the height of
    the geoid. The dates are read from the sentences RMC or ZDA. A time of day that restarts at zero marks the next day.

    Raises:
        RecordingError: the file is missing, no sentence has a position, or no sentence has a date.
    """
    epochs: dict[int, TrackRow] = {}
    dates: dict[int, int] = {}
    damaged, invalid, day, last_ms = 0, 0, 0, 0
    for line in _sentences(path):
        fields, sound = _parsed(line)
        damaged += not sound
        kind = fields[0][-3:] if sound and fields[0].startswith("$") else ""
        least, read = READ.get(kind, (2, None))
        if read is None or len(fields) < least or not fields[1]:
            continue
        said, time_ms = read(fields), _time_ms(fields[1])
        if time_ms is None or ("date" in said and said["date"] is None):
            invalid += 1
            continue
        day += time_ms < last_ms - DAY_MS / 2
        last_ms = time_ms
        row = epochs.setdefault(DAY_MS * day + time_ms, {})
        row |= {name: value for name, value in said.items() if value is not None}
        if "date" in said:
            dates.setdefault(day, said["date"])
    if not dates:
        damage = f" ({invalid} sentences have no valid time or date)" if invalid else ""
        raise RecordingError(f"{path} has no date{damage}; let the receiver write RMC or ZDA in addition to GGA.")
    first, date_ns = next(iter(dates.items()))
    for since_ms, row in epochs.items():
        if row.get("quality") != 0 and row.get("status") != "V":
            row["t"] = date_ns + 1_000_000 * (since_ms - DAY_MS * first)
    counts = {"a wrong checksum": damaged, "no valid time or date": invalid}
    notes = [f"{path.name}: {count} sentences have {what} and are dropped." for what, count in counts.items() if count]
    return _table(path, list(epochs.values()), tuple(notes), "let the receiver write GGA and RMC")


def _sentences(path: Path) -> list[str]:
    if path.suffix.lower() == MIXED:
        found = re.findall(rb"[$][A-Z]{5},[ -)+-~]{0,100}[*][0-9A-Fa-f]{2}", read_bytes(path))
        return [match.decode("ascii") for match in found]
    return [line for _, line in read_lines(path)]


def _parsed(line: str) -> tuple[list[str], bool]:
    """Return the fields, and whether the checksum (XOR of the characters between $ and *) is correct or absent."""
    body, star, given = line.strip().partition("*")
    checksum = reduce(lambda a, b: a ^ b, body[1:].encode(), 0)
    return body.split(","), not star or given.upper() == f"{checksum:02X}"


def _time_ms(text: str) -> int | None:
    """Convert a time of day hhmmss.ss to milliseconds, or to None if it is invalid."""
    seconds_ns = calendar_ns("1970-01-01", f"{text[:2]}:{text[2:4]}:{text[4:].rstrip('.')}")
    return None if seconds_ns is None else round(seconds_ns / 1e6)


def _latitude_longitude(*fields: str) -> TrackRow:
    """Return latitude and longitude [deg] from two pairs of fields: ddmm.mmmm with N or S, dddmm.mmmm with E or W."""
    row: TrackRow = {}
    for name, text, side in zip(("latitude", "longitude"), fields[::2], fields[1::2], strict=True):
        value = _number(text)
        if value is not None and side:
            row[name] = (value // 100 + value % 100 / 60) * (-1 if side in "SW" else 1)
    return row


def _fix(fields: list[str]) -> TrackRow:
    """Return the fix in a sentence GGA or GNS, which have different quality codes and indices of the geoid height."""
    is_gga = fields[0].endswith("GGA")
    letters = (GNS_QUALITY.get(letter, 0.0) for letter in fields[6])
    quality = _number(fields[6]) if is_gga else max(letters, default=0.0)
    height_m, geoid_m = _number(fields[9]), _number(fields[11 if is_gga else 10])
    row = _latitude_longitude(*fields[2:6]) | {"quality": quality, "hdop": _number(fields[8])}
    return row | {"height": None if height_m is None else height_m + (geoid_m or 0.0)}


def _rmc(fields: list[str]) -> TrackRow:
    speed, course = _number(fields[7]), _number(fields[8])
    row: TrackRow = {"status": fields[2], **_latitude_longitude(*fields[3:7])}
    if date := fields[9]:
        row["date"] = calendar_ns(f"20{date[4:]}-{date[2:4]}-{date[:2]}", "00:00:00")
    if speed is not None and (course is not None or speed == 0):
        mps, course_rad = speed * SPEED_UNITS["knots"], math.radians(course or 0.0)  # clockwise from north
        row |= {"ve": mps * math.sin(course_rad), "vn": mps * math.cos(course_rad)}
    return row


def _gst(fields: list[str]) -> TrackRow:
    return dict(zip(("sigma_north", "sigma_east", "sigma_up"), map(_number, fields[6:9]), strict=True))


def _zda(fields: list[str]) -> TrackRow:
    day, month, year = fields[2:5]
    return {"date": calendar_ns(f"{year}-{month:0>2}-{day:0>2}", "00:00:00")} if day + month + year else {}


GNS_QUALITY = {"A": 1.0, "D": 2.0, "R": 4.0, "F": 5.0}
"""The quality, as in GGA, of each letter of GNS's mode."""

READ = {"GGA": (12, _fix), "GNS": (11, _fix), "RMC": (10, _rmc), "GST": (9, _gst), "ZDA": (5, _zda)}
"""Minimum number of fields of each sentence, and the function that parses them."""


# GPX 1.0 and 1.1. The points of all tracks become the rows of one table.


def read_gpx(path: Path) -> "TrackTable":
    """Return the points of all tracks in a GPX file. Points without a time are dropped.

    Raises:
        RecordingError: the file is missing or damaged, or no point has a time.
    """
    if b"<!ENTITY" in read_bytes(path):
        raise RecordingError(f"{path} has XML entities, which are not allowed in tracks; remove the entities.")
    rows = []
    try:
        for _, node in ET.iterparse(path):  # noqa: S314 - a file without entities
            if _tag(node) == "trkpt":
                said = {_tag(child): (child.text or "").strip() for child in node}
                row = {"latitude": node.get("lat"), "longitude": node.get("lon"), "t": said.get("time")}
                row |= {"height": said.get("ele"), "hdop": said.get("hdop")}
                rows.append({name: _utc_ns(text) if name == "t" else _number(text) for name, text in row.items()})
                node.clear()
    except ET.ParseError as error:
        raise RecordingError(f"{path} cannot be read as GPX ({error}); export the track again.") from error
    return _table(path, rows, (), "each <trkpt> of a recorded track needs a <time>")


def _tag(node: ET.Element) -> str:
    """Return the name of an element without its namespace."""
    return node.tag.rpartition("}")[2]


# Solutions of RTKLIB. The last comment of a .pos file names the columns, which depend on RTKLIB's output options.

_CLOCKS = ("GPST", "UTC")
_FRAMES = {
    "latitude(deg)": ("latitude(deg) longitude(deg) height(m)", "neu"),
    "x-ecef(m)": ("x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
}
"""For the first column of each position format: the three columns, and the letters of the axes."""

_POS_HEADER = (
    "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)
"""Example of a header, for positions in degrees and with velocities."""

_SEPARATORS = str.maketrans(",;\t", "   ")
_CROSSED = {axes: [*axes, *(axes[k] + axes[(k + 1) % 3] for k in range(3))] for _, axes in _FRAMES.values()}
"""The letters in the names of the six standard deviations: a, b, c, ab, bc, ca for the axes a, b, c."""

POS_VELOCITY = ("ve", "vn", "vu")
_PAIRS = ("ee", "nn", "uu", "en", "eu", "nu")
POS_COVARIANCE = tuple(f"c{pair}" for pair in _PAIRS)
POS_VELOCITY_COVARIANCE = tuple(f"cv{pair}" for pair in _PAIRS)
"""Columns of the table of a solution: positions in degrees and metres, velocities and covariances in ENU."""

POS_QUALITY = "quality"


def read_pos(path: Path, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> "TrackTable":
    """Read a .pos file of RTKLIB. Return the table, and notes about dropped rows.

    Times may be in GPST or UTC, as dates or as week and time of week. Positions may be in decimal degrees or in ECEF.
    Velocities are optional, and the columns may be separated by white space, a comma or a semicolon. The table has the
    columns t (UTC), `POS_POSITION`, `POS_QUALITY` and `POS_COVARIANCE`. If the file has velocities, the table also has
    `POS_VELOCITY` and `POS_VELOCITY_COVARIANCE`. Velocities and covariances are in ENU at each fix.

    A truncated first or last line is dropped. For each covariance c, RTKLIB writes sd, the square root of |c| with the
    sign of c. The reader therefore computes c = sd |sd|.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Raises:
        RecordingError: the file does not exist, is empty, has a header that RTKLIB does not write, or has a damaged
            row. The error message names the file, and the line of the header or the row.
    """
    import pandas as pd

    lines = read_lines(path)
    comments = [(number, text.translate(_SEPARATORS)) for number, text in lines if text.startswith("%")]
    clock, names = _header(path, comments)
    row = next((text for _, text in lines if not text.startswith("%")), None)
    if row is None:
        raise RecordingError(f"{path} has no rows of data; it needs one line for each fix.")
    columns = _pos_columns(path, next((mark for mark in ",;" if mark in row), ""), names)
    utc_ns = _pos_utc_ns(columns, clock, gpst_minus_utc_s)
    columns.stamped(utc_ns).require_increasing()
    table, axes = pd.DataFrame(dict(zip(names, columns.finite(names).T, strict=True))), _FRAMES[names[0]][1]
    places, turns = _places(table)
    possible, impossible = possible_rows(path.name, places=places, utc_ns=utc_ns)
    known = {"t": pd.to_datetime(utc_ns, utc=True), **dict(zip(POS_POSITION, places.T, strict=True))}
    known |= {POS_QUALITY: table["Q"]} | _covariance(POS_COVARIANCE, table, "sd{}(m)", turns)
    velocity = [f"v{axis}(m/s)" for axis in axes]
    if {*velocity, *(f"sdv{letters}" for letters in _CROSSED[axes])} <= set(table):
        mps = np.einsum("nij,nj->ni", turns, table[velocity].to_numpy())
        known |= dict(zip(POS_VELOCITY, mps.T, strict=True))
        known |= _covariance(POS_VELOCITY_COVARIANCE, table, "sdv{}", turns)
    return pd.DataFrame(known)[possible].reset_index(drop=True), (*columns.notes, *impossible)


def is_ellipsoidal(path: Path) -> bool | None:
    """Return whether heights are above the ellipsoid, or None if the header does not state the height datum."""
    text = " ".join(text for _, text in read_lines(path) if text.startswith("%"))
    return next((datum == "ellipsoidal" for datum in ("ellipsoidal", "geodetic") if f"WGS84/{datum}" in text), None)


def _header(path: Path, comments: Sequence[Line]) -> tuple[str, list[str]]:
    """Return the time system of the stamps, and the names of the other columns.

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
        return clock, names
    number, text = comments[-1] if comments else (1, "no line that starts with %")
    raise RecordingError(
        f"{path}, line {number}: the header is '{' '.join(text.split())}', but a header such as '% {_POS_HEADER}' is"
        " needed; let RTKLIB write the header (out-outhead=on), and positions in ECEF or in decimal degrees"
        " (out-degform=deg)."
    )


def _places(table: "pd.DataFrame") -> tuple[FloatArray, FloatArray]:
    """Return positions (m, 3) (latitude [deg], longitude [deg], height [m]), and rotations (m, 3, 3) to ENU."""
    names, axes = _FRAMES[table.columns[0]]
    position = np.array(table[names.split()])
    if axes == "xyz":
        return ecef_to_geodetic(position), np.array([enu_axes(ecef_to_origin(ecef_m)) for ecef_m in position])
    return position, np.tile(np.eye(3)[[1, 0, 2]], (len(table), 1, 1))


def _pos_columns(path: Path, separator: str, names: Sequence[str]) -> Columns:
    """Return the columns ``names``, and the stamps as the columns "week" and "time of week", or as the column "t".

    Raises:
        RecordingError: the number of columns does not agree with the number of names.
    """
    import pandas as pd

    table, notes = read_text(path, TextFormat(separator, header=False, comment="%"))
    stamps = table.shape[1] - len(names)
    if stamps not in (1, 2):  # a date and a time may be in one column
        raise RecordingError(
            f"{path} has {table.shape[1]} columns, but its header names {len(names)} columns after the stamp; let"
            " RTKLIB write the file."
        )
    first, *others = (table.iloc[:, k] for k in range(table.shape[1]))
    known = dict(zip(names, others[stamps - 1 :], strict=True))
    if stamps == 2 and pd.api.types.is_numeric_dtype(first):
        known |= {"week": first, "time of week": others[0]}
    else:
        text = first.astype(str).str.replace("/", "-")
        known["t"] = (text if stamps == 1 else text + " " + others[0].astype(str)).str.strip()
    return Columns(str(path), pd.DataFrame(known), notes)


def _pos_utc_ns(columns: Columns, clock: str, gpst_minus_utc_s: float) -> IntArray:
    """Return the UTC of the stamps, in nanoseconds since 1970.

    Raises:
        RecordingError: the stamps are neither dates nor weeks with a time of week.
    """
    leap_ns = round(gpst_minus_utc_s * 1e9)
    if columns.has(["week"]):
        return times_ns(columns, "time of week", "s", "week") + GPS_EPOCH_NS - leap_ns
    dates_ns = columns.dates_ns("t", gpst_minus_utc_s)
    if dates_ns is None:
        raise RecordingError(
            f"{columns.where}: the first columns are not {clock} stamps; expected a date and a time such as 2025/07/08"
            " 19:34:18.499, or a week and a time of week such as 2374 243258.499."
        )
    return np.where(dates_ns == MAX_DATE_NS, dates_ns, dates_ns - (leap_ns if clock == "GPST" else 0))


def _covariance(
    names: Sequence[str], table: "pd.DataFrame", deviation: str, turns: FloatArray
) -> dict[str, FloatArray]:
    """Return the columns ``names`` of covariances in ENU, computed from the columns of standard deviations."""
    sd = table[[deviation.format(letters) for letters in _CROSSED[_FRAMES[table.columns[0]][1]]]].to_numpy()
    a, b, c, ab, bc, ca = (sd * np.abs(sd)).T
    matrices = turns @ np.stack([a, ab, ca, ab, b, bc, ca, bc, c], axis=1).reshape(-1, 3, 3) @ turns.transpose(0, 2, 1)
    return dict(zip(names, matrices[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].T, strict=True))
