"""The text of a solution that RTKLIB writes (.pos) -> arrays in ENU order."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_geodetic, ecef_to_origin, enu_axes, enu_to_geodetic, geodetic_to_enu
from jerkbench.readers.cut_lines import whole_lines
from jerkbench.readers.dates import calendar_ns
from jerkbench.readers.gpst import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS
from jerkbench.readers.pos_header import PosHeader, read_header
from jerkbench.readers.text import parse_numbers, read_lines, require_increasing
from jerkbench.recording import Origin, Position

_SEPARATORS = str.maketrans(",;\t", "   ")
_WEEK, _TIME_OF_WEEK = re.compile(r"\d{1,4}", re.ASCII), re.compile(r"\d{1,6}(\.\d{1,12})?", re.ASCII)
_JST_NS = 9 * 3600 * 1_000_000_000
_ENU_FROM = {"neu": [1, 0, 2], "enu": [0, 1, 2], "xyz": [0, 1, 2]}
"""The places of east, north, up among the file's axes; x, y, z are turned afterwards."""


@dataclass(frozen=True, eq=False)
class PosSolution:
    """The content of a .pos file, at its own stamps.

    Attributes:
        gpst_ns: (m,) stamps, nanoseconds of the GPST calendar since 1970.
        latitude_deg: (m,).
        longitude_deg: (m,).
        height_m: (m,) above whatever datum the receiver used.
        quality: (m,) 1 fixed, 2 float, 4 differential, 5 single.
        covariance_m2: (m, 3, 3) of the position, ENU.
        velocity_enu_mps: (m, 3), or None where the file has none.
        velocity_covariance_m2ps2: (m, 3, 3), ENU, or None.
        axes_at: of a file in ECEF, where the vectors' east, north and up are: the first fix; None: at each fix.
        ellipsoidal: whether the header says that heights are above the ellipsoid; None: it does not say.
        notes: what was dropped, in sentences.
    """

    gpst_ns: IntArray
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    height_m: FloatArray
    quality: IntArray
    covariance_m2: FloatArray
    velocity_enu_mps: FloatArray | None
    velocity_covariance_m2ps2: FloatArray | None
    axes_at: Origin | None = None
    ellipsoidal: bool | None = None
    notes: tuple[str, ...] = ()

    @property
    def first(self) -> Origin:
        """The place of the first fix."""
        return Origin(*(float(v[0]) for v in (self.latitude_deg, self.longitude_deg, self.height_m)))

    @property
    def speed_mps(self) -> FloatArray | None:
        """Speed over ground (m,), or None where the file has no velocities."""
        return None if self.velocity_enu_mps is None else np.hypot(*self.velocity_enu_mps[:, :2].T)

    def position(self, t_s: FloatArray, origin: Origin | None = None) -> tuple[Position, Origin]:
        """Return the fixes at the times ``t_s`` (m,), and the origin of their ENU: ``origin``, or the first one."""
        origin = origin or self.first
        enu_m = geodetic_to_enu(self.latitude_deg, self.longitude_deg, self.height_m, origin)
        return Position(t_s, enu_m, self.covariance_m2), origin

    def select(self, rows: BoolArray) -> "PosSolution":
        """Return the solution with only the ``rows`` (m,) that are True; ``axes_at`` is the first of these."""
        names = [name for name, values in vars(self).items() if isinstance(values, np.ndarray)]
        chosen: dict[str, Any] = {name: getattr(self, name)[rows] for name in names}
        kept = replace(self, **chosen)
        return kept.with_axes_at(kept.first) if rows.any() else kept

    def with_axes_at(self, place: Origin) -> "PosSolution":
        """Return the solution with its vectors along east, north and up at ``place``; as it is where they have none."""
        if self.axes_at in (None, place):
            return self
        turn = enu_axes(place) @ enu_axes(self.axes_at).T
        velocity, covariance = self.velocity_enu_mps, self.velocity_covariance_m2ps2
        return replace(
            self,
            covariance_m2=_turned(turn, self.covariance_m2),
            velocity_enu_mps=None if velocity is None else velocity @ turn.T,
            velocity_covariance_m2ps2=None if covariance is None else _turned(turn, covariance),
            axes_at=place,
        )


def read_rtklib_pos(path: Path, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> PosSolution:
    """Read a .pos file, whatever RTKLIB was told to write.

    Times in GPST, UTC or JST, as dates or as week and time of week; places in degrees, in degrees, minutes and seconds,
    in ECEF, or as a baseline from a base whose place the header gives; velocities or none; any separator.

    A last line that was cut off is dropped. RTKLIB writes each covariance as the root of its absolute value with its
    sign: c = sd |sd|.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Raises:
        RecordingError: no such file, empty, another header, or a line that is damaged; names file and line.
    """
    lines = [(number, text.translate(_SEPARATORS)) for number, text in read_lines(path)]
    header = read_header(path, [line for line in lines if line[1].startswith("%")])
    rows, notes = whole_lines(path, [line for line in lines if not line[1].startswith("%")])
    split = [(number, text.split(maxsplit=2)) for number, text in rows]
    numbers = parse_numbers(path, [(n, fields[2] if len(fields) > 2 else "") for n, fields in split], header.count)
    leap_ns = round(gpst_minus_utc_s * 1e9)
    gpst_ns = np.array([_gpst_ns(path, n, fields[:2], header.clock, leap_ns) for n, fields in split], dtype=np.int64)
    require_increasing(path, rows, gpst_ns, "the time")
    places, turn = _places(path, header, numbers)
    velocity = numbers[:, header.velocity][:, _ENU_FROM[header.axes]] @ turn.T if header.velocity else None
    return PosSolution(
        gpst_ns=gpst_ns,
        latitude_deg=places[:, 0],
        longitude_deg=places[:, 1],
        height_m=places[:, 2],
        quality=numbers[:, header.quality].astype(np.int64),
        covariance_m2=_covariance(numbers[:, header.sigmas], header.axes, turn),
        velocity_enu_mps=velocity,
        velocity_covariance_m2ps2=(
            _covariance(numbers[:, header.velocity_sigmas], header.axes, turn) if header.velocity else None
        ),
        axes_at=ecef_to_origin(numbers[0, header.position]) if header.frame == "ecef" else None,
        ellipsoidal=True if header.frame == "ecef" else header.ellipsoidal,
        notes=notes,
    )


def _places(path: Path, header: PosHeader, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Latitude and longitude [deg] and height [m] (m, 3), and what turns the file's vectors (3, 3) into ENU."""
    position = numbers[:, header.position]
    if header.frame == "dms":
        angles = [_degrees(numbers[:, begin : begin + 3]) for begin in header.position[:2]]
        return np.column_stack([*angles, position[:, 2]]), np.eye(3)
    if header.frame == "ecef":
        return ecef_to_geodetic(position), enu_axes(ecef_to_origin(position[0]))
    if header.frame == "baseline":
        if len(header.reference) != 3:
            raise RecordingError(
                f"{path} has baselines, and its header does not say from where (% ref pos : latitude longitude height);"
                " let RTKLIB write degrees or ECEF."
            )
        return enu_to_geodetic(position, Origin(*header.reference)), np.eye(3)
    return position, np.eye(3)


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


def _covariance(sd: FloatArray, axes: str, turn: FloatArray) -> FloatArray:
    """(m, 6) a, b, c, ab, bc, ca -> (m, 3, 3) in ENU."""
    a, b, c, ab, bc, ca = (sd * np.abs(sd)).T
    matrices = np.stack([a, ab, ca, ab, b, bc, ca, bc, c], axis=1).reshape(-1, 3, 3)
    order = _ENU_FROM[axes]
    return np.asarray(turn @ matrices[:, order][:, :, order] @ turn.T)


def _turned(turn: FloatArray, covariance: FloatArray) -> FloatArray:
    """T C T' of covariances (m, 3, 3), symmetric to the bit."""
    product = turn @ covariance @ turn.T
    return np.asarray(0.5 * (product + product.transpose(0, 2, 1)))
