"""The IMU log beside an RTKLIB solution (.csv, with its time tag) -> arrays as the sensor gave them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.columns import read_columns, times_ns
from jerkbench.readers.cut_lines import cut_note, whole_lines
from jerkbench.readers.gpst import GPS_EPOCH_NS
from jerkbench.readers.table_text import TextFormat
from jerkbench.readers.text import parse_numbers, read_lines, require_increasing
from jerkbench.readers.time_tag import read_time_tag

LEAST_ROWS = 2
CLOCKS_AGREE = 0.01
"""By how much the sensor's and the logger's clock may differ before the tag is taken for another recording's."""


@dataclass(frozen=True, eq=False)
class ImuLog:
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


@dataclass(frozen=True)
class ImuMap:
    """The columns of a table of IMU samples.

    Attributes:
        text: how text is cut into columns.
        time: column of the times.
        week: column of GPS weeks, where the times are those of the week; empty: they are not.
        unit: of the times: s, ms, us or ns.
        epoch: what they count from: gps (1980, GPS time) or unix (1970, UTC).
        accel: three columns of the specific force.
        gyro: three columns of the angular rate.
    """

    text: TextFormat
    time: str
    week: str
    unit: str
    epoch: str
    accel: tuple[str, ...]
    gyro: tuple[str, ...]


def read_imu_table(path: Path, columns: ImuMap, gpst_minus_utc_s: float) -> ImuLog:
    """Read any table of IMU samples (CSV, text, Parquet) whose times are absolute.

    Raises:
        RecordingError: the file is missing or damaged, or a column is not there or has fewer than two rows.
    """
    table = read_columns((path,), columns.text)
    t_ns = times_ns(table, columns.time, columns.unit, columns.week)
    if len(t_ns) < LEAST_ROWS:
        raise RecordingError(f"{path} has {len(t_ns)} rows; an IMU's log has at least {LEAST_ROWS}.")
    start_ns = int(t_ns[0]) + (GPS_EPOCH_NS if columns.epoch == "gps" else round(gpst_minus_utc_s * 1e9))
    t_s = np.asarray((t_ns - t_ns[0]) * 1e-9)
    return ImuLog(start_ns, t_s, table.numbers(columns.accel), table.numbers(columns.gyro))


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
