"""The text of a solution that RTKLIB writes (.pos) -> arrays in ENU order."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.readers.dates import calendar_ns
from jerkbench.readers.text import Line, parse_numbers, read_lines, require_increasing

COLUMNS = (
    "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)
"""The only header that is read: GPS time, degrees, velocities written too (``out-outvel=on``)."""

_NUMBERS = len(COLUMNS.split()) - 1
_NORTH_EAST_UP = [1, 0, 2]  # where east, north, up stand in a north, east, up order


@dataclass(frozen=True, eq=False)
class PosSolution:
    """What a .pos file says, at its own stamps.

    Attributes:
        gpst_ns: (m,) stamps, nanoseconds of the GPST calendar since 1970.
        latitude_deg: (m,).
        longitude_deg: (m,).
        height_m: (m,) above whatever datum the receiver used.
        quality: (m,) 1 fixed, 2 float, 4 differential, 5 single.
        covariance_m2: (m, 3, 3) of the position, ENU.
        velocity_enu_mps: (m, 3).
        velocity_covariance_m2ps2: (m, 3, 3), ENU.
    """

    gpst_ns: IntArray
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    height_m: FloatArray
    quality: IntArray
    covariance_m2: FloatArray
    velocity_enu_mps: FloatArray
    velocity_covariance_m2ps2: FloatArray

    @property
    def speed_mps(self) -> FloatArray:
        """Speed over ground (m,)."""
        speed: FloatArray = np.hypot(self.velocity_enu_mps[:, 0], self.velocity_enu_mps[:, 1])
        return speed

    def select(self, rows: BoolArray) -> "PosSolution":
        """Return the solution with only the ``rows`` (m,) that are True."""
        return PosSolution(**{name: values[rows] for name, values in vars(self).items()})


def read_rtklib_pos(path: Path) -> PosSolution:
    """Read a .pos file with GPST calendar stamps, geodetic coordinates and velocities.

    RTKLIB writes each covariance as the root of its absolute value with its sign: c = sd |sd|.

    Raises:
        RecordingError: no such file, empty, another header, or a line that is damaged; names file and line.
    """
    lines = read_lines(path)
    _check_header(path, [line for line in lines if line[1].startswith("%")])
    rows = [line for line in lines if not line[1].startswith("%")]
    split = [(number, text.split(maxsplit=2)) for number, text in rows]
    numbers = parse_numbers(path, [(n, fields[2] if len(fields) > 2 else "") for n, fields in split], _NUMBERS)
    gpst_ns = np.array([_stamp(path, number, fields[:2]) for number, fields in split], dtype=np.int64)
    require_increasing(path, rows, gpst_ns, "the time")
    return PosSolution(
        gpst_ns=gpst_ns,
        latitude_deg=numbers[:, 0],
        longitude_deg=numbers[:, 1],
        height_m=numbers[:, 2],
        quality=numbers[:, 3].astype(np.int64),
        covariance_m2=_covariance(numbers[:, 5:11]),
        velocity_enu_mps=numbers[:, 13:16][:, _NORTH_EAST_UP],
        velocity_covariance_m2ps2=_covariance(numbers[:, 16:22]),
    )


def _check_header(path: Path, comments: list[Line]) -> None:
    if COLUMNS.split() in [text.lstrip("% ").split() for _, text in comments]:
        return
    number, text = comments[-1] if comments else (1, "no line that begins with %")
    raise RecordingError(
        f"{path}, line {number}: the header is '{' '.join(text.split())}'; it must be '% {COLUMNS}':"
        " let RTKLIB write GPST, degrees and velocities."
    )


def _stamp(path: Path, number: int, date_time: list[str]) -> int:
    """Nanoseconds since 1970 of ``["2025/07/08", "19:34:18.499"]``."""
    date, time = date_time
    stamp_ns = calendar_ns(date.replace("/", "-"), time)
    if stamp_ns is None:
        raise RecordingError(
            f"{path}, line {number}: '{date} {time}' is no GPST stamp; it must look like 2025/07/08 19:34:18.499."
        )
    return stamp_ns


def _covariance(sd: FloatArray) -> FloatArray:
    """(m, 6) n, e, u, ne, eu, un -> (m, 3, 3) in ENU."""
    n, e, u, ne, eu, un = (sd * np.abs(sd)).T
    return np.stack([e, ne, eu, ne, n, un, eu, un, u], axis=1).reshape(-1, 3, 3)
