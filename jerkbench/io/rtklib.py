"""Reader of RTKLIB's solutions (.pos)."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_geodetic, ecef_to_origin, enu_axes
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S
from jerkbench.io.columns import Columns, times_ns
from jerkbench.io.sanitiser import MAX_DATE_NS, possible_rows
from jerkbench.io.text import Line, TextFormat, read_lines, read_text

if TYPE_CHECKING:
    import pandas as pd

# Solutions of RTKLIB. The last comment of a .pos file names the columns, which depend on RTKLIB's output options.

_CLOCKS = ("GPST", "UTC")
_FRAMES = {
    "latitude(deg)": ("latitude(deg) longitude(deg) height(m)", "neu"),
    "x-ecef(m)": ("x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
}
"""For the first column of each position format: the three columns, and the letters of the axes."""

_COLUMNS = (
    "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)
"""Example of a header, for positions in degrees and with velocities."""

_SEPARATORS = str.maketrans(",;\t", "   ")
_CROSSED = {axes: [*axes, *(axes[k] + axes[(k + 1) % 3] for k in range(3))] for _, axes in _FRAMES.values()}
"""The letters in the names of the six standard deviations: a, b, c, ab, bc, ca for the axes a, b, c."""

POS_POSITION = ("latitude", "longitude", "height")
POS_VELOCITY = ("ve", "vn", "vu")
_PAIRS = ("ee", "nn", "uu", "en", "eu", "nu")
POS_COVARIANCE = tuple(f"c{pair}" for pair in _PAIRS)
POS_VELOCITY_COVARIANCE = tuple(f"cv{pair}" for pair in _PAIRS)
"""Columns of the table of a solution: positions in degrees and metres, velocities and covariances in ENU."""

POS_QUALITY = "quality"


def read_pos(path: Path, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> tuple["pd.DataFrame", tuple[str, ...]]:
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
    columns = _columns(path, next((mark for mark in ",;" if mark in row), ""), names)
    utc_ns = _utc_ns(columns, clock, gpst_minus_utc_s)
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
        f"{path}, line {number}: the header is '{' '.join(text.split())}', but a header such as '% {_COLUMNS}' is"
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


def _columns(path: Path, separator: str, names: Sequence[str]) -> Columns:
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


def _utc_ns(columns: Columns, clock: str, gpst_minus_utc_s: float) -> IntArray:
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
    ahead_ns = leap_ns if clock == "GPST" else 0
    return np.where(dates_ns == MAX_DATE_NS, dates_ns, dates_ns - ahead_ns)


def _covariance(
    names: Sequence[str], table: "pd.DataFrame", deviation: str, turns: FloatArray
) -> dict[str, FloatArray]:
    """Return the columns ``names`` of covariances in ENU, computed from the columns of standard deviations."""
    sd = table[[deviation.format(letters) for letters in _CROSSED[_FRAMES[table.columns[0]][1]]]].to_numpy()
    a, b, c, ab, bc, ca = (sd * np.abs(sd)).T
    matrices = turns @ np.stack([a, ab, ca, ab, b, bc, ca, bc, c], axis=1).reshape(-1, 3, 3) @ turns.transpose(0, 2, 1)
    return dict(zip(names, matrices[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].T, strict=True))
