"""The logs beside an RTKLIB solution: the IMU's, the time tag of a stream, the sentences of a receiver."""

import struct
from pathlib import Path
from typing import NamedTuple

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.io.text import (
    cut_note,
    parse_numbers,
    read_bytes,
    read_lines,
    require_increasing,
    whole_lines,
)

# The time tag that RTKLIB writes beside a stream (.tag): when the stream began and how long it
# lasted.

_MAGIC = b"TIMETAG RTKLIB"
_START = struct.Struct("<60xIId")  # header, tick, time_t, fraction of a second
_RECORD = struct.Struct("<II")  # tick [ms since the start], position in the stream's file


class TimeTag(NamedTuple):
    """Begin and length of a stream, by the clock of the logger.

    Attributes:
        start_gpst_ns: nanoseconds of the GPST calendar since 1970.
        total_s: from the start to the last record.
    """

    start_gpst_ns: int
    total_s: float


def read_time_tag(path: Path) -> TimeTag:
    """Read a time tag: little-endian; 60 B header, u32 tick, u32 time_t, f64 fraction, then (u32 ms, u32 filepos)...

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
    return TimeTag(seconds * 1_000_000_000 + round(fraction * 1e9), last_ms * 1e-3)


LEAST_ROWS = 2
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
    if not notes and len(table) > LEAST_ROWS and table[-1, 6] < table[-2, 6]:
        lines, table, notes = lines[:-1], table[:-1], cut_note(path.name, first=False, last=True)
    milliseconds = table[:, 6]
    require_increasing(path, lines, milliseconds, "the time (field 7)")
    tag = read_time_tag(tag_path)
    elapsed_s = float(milliseconds[-1] - milliseconds[0]) * 1e-3
    if abs(elapsed_s - tag.total_s) > CLOCKS_AGREE * tag.total_s:
        raise RecordingError(
            f"{path} covers {elapsed_s:.3f} s, its time tag {tag_path.name} {tag.total_s:.3f} s;"
            " give the tag of the same recording, and neither of them cut short."
        )
    t_s = (milliseconds - milliseconds[0]) * (1e-3 * tag.total_s / elapsed_s)
    return ImuLog(tag.start_gpst_ns, t_s, table[:, :3], table[:, 3:6], notes)


# The sentences `$PSAT,FVI` and `$..GST` of a receiver's log: velocities and standard deviations,
# epoch by epoch.

FVI, GST = "$PSAT,FVI,", "GST,"
FVI_FIELDS, GST_FIELDS = (15, 16, 17), (6, 7, 8)
"""Where east, north and up of the velocity [m/s], and the sigmas of latitude, longitude and height [m], stand."""


def read_epochs(path: Path) -> tuple[FloatArray, FloatArray]:
    """Return the velocities (n, 3) and the standard deviations of the places (n, 3), ENU, at each epoch.

    Sentences of other kinds are left alone.

    Raises:
        RecordingError: no such file, a sentence is damaged, or the two kinds are not of the same epochs.
    """
    lines = read_lines(path)
    fvi = [(number, text) for number, text in lines if text.startswith(FVI)]
    gst = [(number, text) for number, text in lines if text[3:].startswith(GST)]
    stamps = [[_field(path, line, k) for line in kind] for kind, k in ((fvi, 2), (gst, 1))]
    if stamps[0] != stamps[1]:
        raise RecordingError(
            f"{path} has {len(fvi)} sentences {FVI[:-1]} and {len(gst)} GST, which are not of the same epochs; copy it"
            " again."
        )
    return _numbers(path, fvi, FVI_FIELDS), _numbers(path, gst, GST_FIELDS)[:, [1, 0, 2]]


def _numbers(path: Path, lines: list[tuple[int, str]], fields: tuple[int, ...]) -> FloatArray:
    chosen = [(line[0], " ".join(_field(path, line, k) for k in fields)) for line in lines]
    return parse_numbers(path, chosen, len(fields))


def _field(path: Path, line: tuple[int, str], k: int) -> str:
    number, text = line
    fields = text.partition("*")[0].split(",")
    if len(fields) <= k:
        raise RecordingError(f"{path}, line {number} has {len(fields)} fields, and {k + 1} are needed; it is damaged.")
    return fields[k].strip()
