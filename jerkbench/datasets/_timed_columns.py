"""The columns of one stream of a table with their times: the folder, the cutting of text, the clock."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.datasets._rtklib_fixes import accepted_fixes, steady_fixes
from jerkbench.datasets._table_stream import Source, Stream
from jerkbench.errors import PluginError, RecordingError
from jerkbench.readers.columns import Columns, find_tables, read_columns, read_datetimes_ns, times_ns
from jerkbench.readers.fetched import named_folder
from jerkbench.readers.gpst import GPS_EPOCH_NS, GPST_MINUS_UTC_S, UNIX_EPOCH, utc_of
from jerkbench.readers.pos_files import read_pos_files
from jerkbench.readers.rtklib_pos import PosSolution
from jerkbench.readers.table_text import TextFormat

EPOCHS = ("gps", "none", "unix")

MATLAB = ".mat"
"""Ending of MATLAB's files, whose variables may be of different lengths."""


@dataclass(frozen=True)
class TimedColumns:
    """What all streams of a table share: the folder, how text is cut, and the time.

    Attributes:
        folder: where the files are; "fetched:NAME" is what `jerkbench data fetch NAME` has fetched.
        separator: between the columns of a text; empty: white space. Parquet needs none.
        header: whether a line above the data names the columns: the first of as many fields (others, a title or units,
            are left out); if not, they are numbered from 1.
        comment: what a line to be left out begins with.
        time_unit: of every column of times: s, ms, us or ns; a stream may have one of its own.
        time_week: the column of GPS weeks, in every file, where the times are those of the week; empty: they are not.
        time_file: a file, or a pattern, of UTC dates and times, one a row, for a stream whose column of times is empty.
        epoch: what the times count from: unix (1970, UTC), gps (1980, GPS time), or none (unknown).
        gpst_minus_utc_s: leap seconds; 18 since 2017.
        drop_leaps: drop fixes that no vehicle can have reached from their neighbours; false: they are what is studied.
    """

    folder: str
    separator: str = ","
    header: bool = True
    comment: str = ""
    time_unit: str = "s"
    time_week: str = ""
    time_file: str = ""
    epoch: str = "unix"
    gpst_minus_utc_s: float = GPST_MINUS_UTC_S
    drop_leaps: bool = True

    def files(self, pattern: str, parameter: str) -> tuple[Path, ...]:
        """Return the files that fit the pattern.

        Raises:
            RecordingError: there is none; names the ``parameter`` that the pattern is from.
        """
        return find_tables(named_folder(self.folder), pattern, parameter)

    def read(self, source: Source) -> Stream:
        """Return a stream.

        Raises:
            RecordingError: a file is missing or damaged, or there are not as many dates as rows.
        """
        text = TextFormat(self.separator, self.header, self.comment)
        columns = read_columns(self.files(source.file, source.parameter), text)
        if source.file.endswith(MATLAB) and source.time:
            columns = columns.only(columns.rows_of([source.time]))
        t_ns = self._stamps_ns(columns, source)
        if len(t_ns) != len(columns):
            raise RecordingError(
                f"{columns.where} has {len(columns)} rows, {self.time_file} has {len(t_ns)} times; they must be the"
                " same."
            )
        return Stream(columns, t_ns + source.shift_ns).whole()

    def read_solution(self, source: Source, zero_ns: int) -> tuple[FloatArray, PosSolution, tuple[str, ...]]:
        """Return the times of RTKLIB's solution since ``zero_ns``, and `solution_of`."""
        t_ns, solution, notes = self.solution_of(source)
        return np.asarray((t_ns - zero_ns) * 1e-9), solution, notes

    def solution_of(self, source: Source) -> tuple[IntArray, PosSolution, tuple[str, ...]]:
        """Return RTKLIB's solution without fixes that leap, its shifted stamps since the epoch, and what was dropped.

        Raises:
            PluginError: the tables' clock is not known.
            RecordingError: a file is missing or damaged, or several cannot be joined.
        """
        if self.epoch == "none":
            raise PluginError(
                f"dataset table: {source.parameter} is '{source.file}', in GPS time; epoch must be gps or unix."
            )
        files = self.files(source.file, source.parameter)
        solution = read_pos_files(files, self.gpst_minus_utc_s)
        if source.qualities:
            solution = accepted_fixes(solution, source.qualities, files[0])
        solution, leaps = steady_fixes(solution) if self.drop_leaps else (solution, ())
        offset_ns = GPS_EPOCH_NS if self.epoch == "gps" else round(self.gpst_minus_utc_s * 1e9)
        return solution.gpst_ns - offset_ns + source.shift_ns, solution, (*solution.notes, *leaps)

    def start_utc(self, zero_ns: int) -> datetime | None:
        """Return the UTC of ``zero_ns``; None where nobody knows what the times count from."""
        if self.epoch == "gps":
            return utc_of(zero_ns + GPS_EPOCH_NS, self.gpst_minus_utc_s)
        return UNIX_EPOCH + timedelta(microseconds=zero_ns // 1000) if self.epoch == "unix" else None

    def _stamps_ns(self, columns: Columns, source: Source) -> IntArray:
        if source.time:
            return times_ns(columns, source.time, source.unit or self.time_unit, self.time_week)
        return np.concatenate([read_datetimes_ns(path) for path in self.files(self.time_file, "time_file")])
