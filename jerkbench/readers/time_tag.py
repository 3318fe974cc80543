"""The time tag that RTKLIB writes beside a stream (.tag): when the stream began and how long it lasted."""

import struct
from dataclasses import dataclass
from pathlib import Path

from jerkbench.errors import RecordingError
from jerkbench.readers.text import read_bytes

_MAGIC = b"TIMETAG RTKLIB"
_START = struct.Struct("<60xIId")  # header, tick, time_t, fraction of a second
_RECORD = struct.Struct("<II")  # tick [ms since the start], position in the stream's file


@dataclass(frozen=True)
class TimeTag:
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
