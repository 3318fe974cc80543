"""Columns of numbers: text files of columns, selection by name or number, and the stamps of the rows."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError, unknown
from jerkbench.io.conversions import GPS_EPOCH_NS, WEEK_NS
from jerkbench.io.files import SAMPLE, is_number, require_content
from jerkbench.io.sanitiser import (
    MAX_DATE_NS,
    MAX_NUMBER,
    MIN_DATE_NS,
    ordered_rows,
    require_fractions,
)

if TYPE_CHECKING:
    import pandas as pd


TIME_UNITS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""Nanoseconds in each unit of time."""

MAX_NANOSECONDS = 9.2e18
"""Maximum number of nanoseconds in 64 bits: 292 years."""


WEEK_AND_TIME = r"\d{1,4}:\d{1,6}(\.\d{1,9})?"
DATE_AND_TIME = r"\d{4}-\d\d-\d\d[T ]\d\d"


class Columns:
    """A table that was read from files, with the stamps of its rows."""

    def __init__(
        self, where: str, table: "pd.DataFrame", notes: tuple[str, ...] = (), t_ns: IntArray | None = None
    ) -> None:
        """Create a table. If the columns of ``table`` have no names, they are numbered from 1.

        Args:
            where: name of the table in messages.
            table: data frame with the columns.
            notes: notes about dropped rows.
            t_ns: (n,) stamps of the rows [ns], or None if the stamps are unknown.
        """
        self.where, self.notes = where, notes
        self.t_ns = np.arange(len(table)) if t_ns is None else t_ns
        numbered = all(not isinstance(name, str) for name in table.columns)
        names = [str(k + 1) if numbered else str(n).strip().lstrip("#").strip() for k, n in enumerate(table.columns)]
        self._table, self._names = table, names

    def __len__(self) -> int:
        return len(self._table)

    @property
    def names(self) -> list[str]:
        """The names of the columns from the header, or numbers from 1 without a header."""
        return list(self._names)

    def has(self, names: Sequence[str]) -> bool:
        """Return whether ``names`` is not empty and the table has all columns in ``names``."""
        return bool(names) and set(names) <= set(self._names)

    def rows_of(self, names: Sequence[str]) -> BoolArray:
        """Return a mask (n,) of the rows in which at least one of the columns ``names`` has an entry.

        Raises:
            RecordingError: a column does not exist.
        """
        entries = self._table.iloc[:, [self._index(name) for name in names]].notna()
        return np.asarray(entries.any(axis=1), dtype=np.bool_)

    def only(self, rows: BoolArray | IntArray, notes: tuple[str, ...] = ()) -> "Columns":
        """Return a table with only ``rows`` and more ``notes``. Error messages contain the original row numbers."""
        return Columns(self.where, self._table.iloc[rows], (*self.notes, *notes), self.t_ns[rows])

    def stamped(self, t_ns: IntArray) -> "Columns":
        """Return a copy of the table whose rows have the stamps ``t_ns`` (n,)."""
        return Columns(self.where, self._table, self.notes, t_ns)

    def with_entries(self, names: Sequence[str]) -> "Columns":
        """Return the rows in which at least one of the columns ``names`` has an entry, sorted by their stamps.

        Rows without an entry in these columns belong to other streams of the recording, for example to another sensor.

        Raises:
            RecordingError: a column does not exist, or all columns are empty.
        """
        rows = self.rows_of(names)
        if not rows.any():
            raise RecordingError(f"{self.where} has no values in the columns {', '.join(names)}; select other columns.")
        columns = self.only(rows)
        entries = self._table.iloc[np.flatnonzero(rows), [self._index(name) for name in names]]
        require_fractions(self.where, columns.t_ns, (entries != entries.shift()).any(axis=1).to_numpy())
        return columns.only(*ordered_rows(self.name, columns.t_ns))

    @property
    def name(self) -> str:
        """The name of the file, for notes."""
        return Path(self.where).name

    def t_s(self, zero_ns: int) -> FloatArray:
        """Return the stamps (n,) in seconds since ``zero_ns``."""
        return np.asarray((self.t_ns - zero_ns) * 1e-9, dtype=np.float64)

    def numbers(self, names: Sequence[str], most: float = MAX_NUMBER) -> FloatArray:
        """Return the values (n, len(names)) of columns, with NaN for empty cells.

        Raises:
            RecordingError: a column does not exist, or a cell is not a number or is larger than ``most``.
        """
        columns = [self._numeric(name) for name in names]
        table = np.column_stack(columns).astype(np.float64) if columns else np.empty((len(self), 0))
        for name, column in zip(names, table.T, strict=True):
            self._require(~(np.abs(column) > most), name, column, "{:g} is too large for a measurement")
        return table

    def finite(self, names: Sequence[str]) -> FloatArray:
        """Return the values (n, len(names)) of columns without empty cells.

        Raises:
            RecordingError: a column does not exist, or a cell is empty, not a finite number, or too large.
        """
        table = self.numbers(names)
        for name, column in zip(names, table.T, strict=True):
            self._require(np.isfinite(column), name, column, "'{}' is not a finite number")
        return table

    def require_increasing(self) -> None:
        """Raise a RecordingError with the number of the first row whose stamp is not later than the previous stamp."""
        back = np.flatnonzero(np.diff(self.t_ns) <= 0)
        if back.size:
            number = int(self._table.index[back[0] + 1]) + 1
            raise RecordingError(
                f"{self.where}, row {number}: the time is not later than in the row above; sort the rows."
            )

    def stamps_ns(self, name: str, unit: str) -> IntArray:
        """Convert a column of times in ``unit`` to nanoseconds (n,), without rounding if the times are integers.

        Raises:
            RecordingError: the column does not exist, or a cell is not a number, empty or too large.
        """
        values = self._numeric(name)
        scale = WEEK_NS if unit == "week" else TIME_UNITS[unit]
        fits = np.abs(values.astype(np.float64)) <= MAX_NANOSECONDS / scale  # NaN fails this comparison
        self._require(fits, name, values, f"'{{}}' is not a time in {unit} (maximum: {MAX_NANOSECONDS / scale:.2g})")
        if np.issubdtype(values.dtype, np.integer):
            return np.asarray(values.astype(np.int64) * scale)
        return np.round(values.astype(np.float64) * scale).astype(np.int64)

    def dates_ns(self, name: str, gpst_minus_utc_s: float) -> IntArray | None:
        """Convert a column of dates to UTC nanoseconds since 1970 (n,). Return None if the column has no dates.

        A cell is a date and time as in ISO 8601 (UTC if it has no time zone), or a GPS week and time of week, for
        example ``2374:243258.5``. Each date outside the valid range (1980 to 2099) becomes the start of 2100, which is
        outside this range, too.

        Raises:
            RecordingError: the column does not exist, or only some cells are dates.
        """
        import pandas as pd

        column = self._table.iloc[:, self._index(name)]
        if pd.api.types.is_numeric_dtype(column) or column.empty:
            return None
        if pd.api.types.is_datetime64_any_dtype(column):
            return _date_ns(pd.to_datetime(column, utc=True))
        text = column.astype(str)
        if text.str.fullmatch(WEEK_AND_TIME).all():
            week, time_s = text.str.split(":", expand=True).to_numpy(dtype=np.float64).T
            gpst_ns = GPS_EPOCH_NS + week.astype(np.int64) * WEEK_NS
            return np.asarray(gpst_ns + np.round((time_s - gpst_minus_utc_s) * 1e9).astype(np.int64))
        dates = text.str.match(DATE_AND_TIME)
        if not dates.any():
            return None
        stamps = pd.to_datetime(column.where(dates), format="ISO8601", utc=True, errors="coerce")
        self._require(stamps.notna(), name, column, "'{}' is not a date, but other cells are dates")
        return _date_ns(stamps)

    def _require(self, fits: npt.ArrayLike, name: str, values: Any, reason: str) -> None:  # noqa: ANN401 - a column
        """Raise a RecordingError with the number of the first row for which ``fits`` is False."""
        wrong = np.flatnonzero(~np.asarray(fits, dtype=np.bool_))
        if wrong.size:
            number, said = int(self._table.index[wrong[0]]) + 1, reason.format(np.asarray(values)[wrong[0]])
            raise RecordingError(f"{self.where}, row {number}, column {name}: {said}.")

    def _numeric(self, name: str) -> np.ndarray[Any, Any]:
        import pandas as pd

        column = self._table.iloc[:, self._index(name)]
        try:
            numeric = pd.to_numeric(column, errors="coerce")
        except OverflowError as error:
            raise RecordingError(f"{self.where}, column {name} has a number that is too large; correct it.") from error
        self._require(numeric.notna() | column.isna(), name, column, "'{}' is not a number")
        integer = pd.api.types.is_integer_dtype(numeric) and not numeric.isna().any()
        fits = integer and (numeric.empty or numeric.max() <= np.iinfo(np.int64).max)
        return numeric.to_numpy(dtype=np.int64 if fits else np.float64)

    def _index(self, name: str) -> int:
        """Return the index of the column with this name, or with this number from 1."""
        if name in self._names:
            return self._names.index(name)
        if name.isascii() and name.isdigit() and 1 <= int(name) <= len(self._names):
            return int(name) - 1
        raise RecordingError(f"{self.where}: {unknown('column', name, self._names)} Column numbers start at 1.")


def _date_ns(stamps: "pd.Series[Any]") -> IntArray:
    """Convert UTC dates to nanoseconds since 1970, and missing or impossible dates to `MAX_DATE_NS`."""
    seconds = stamps.dt.tz_localize(None).to_numpy(dtype="datetime64[s]").astype(np.int64)
    fits = (seconds >= MIN_DATE_NS // 10**9) & (seconds < MAX_DATE_NS // 10**9)
    ns = stamps.where(fits).dt.tz_localize(None).to_numpy(dtype="datetime64[ns]").astype(np.int64)
    return np.where(fits, ns, MAX_DATE_NS)


def times_ns(columns: Columns, name: str, unit: str, week: str) -> IntArray:
    """Convert a column of times to nanoseconds (n,). The weeks in the column ``week``, if any, are added.

    Raises:
        RecordingError: a column does not exist, or a cell is not a time.
    """
    t_ns = columns.stamps_ns(name, unit)
    return t_ns + columns.stamps_ns(week, "week") if week else t_ns


# The first and the last line of a log may be truncated, because the logger was switched on or off.

AROUND = 20
"""Number of neighbouring lines with which the first line and the last line are compared."""

MIN_LINES = 4
"""Minimum number of lines in which a truncated line can be identified."""


def cut_ends(lines: Sequence[str], separator: str | None) -> tuple[bool, bool]:
    """Return whether the first and the last of ``lines`` are truncated.

    A line is truncated if it has fewer fields than each of its neighbours. A line is also truncated if its outer field
    (the first field of the first line, the last field of the last line) is not a number, but the same field of each
    neighbour is a number. A line of column names does not count as truncated.

    Args:
        lines: lines of data, in the order of the file.
        separator: separator of the fields, or None for white space.
    """
    if len(lines) < MIN_LINES:
        return False, False
    around = min(AROUND, len(lines) - 2)
    after = [line.split(separator) for line in lines[: around + 1]]
    before = [line.split(separator) for line in lines[-around - 1 :]]
    return _cut(after[0], after[1:], 0), _cut(before[-1], before[:-1], -1)


def cut_note(name: str, *, first: bool, last: bool) -> tuple[str, ...]:
    """Return a note if the ``first`` or ``last`` row of the file ``name`` was dropped, otherwise an empty tuple."""
    which = [end for end, cut in (("first", first), ("last", last)) if cut]
    if not which:
        return ()
    rows = "rows are" if which[1:] else "row is"
    return (f"{name}: the {' and the '.join(which)} {rows} truncated: {len(which)} dropped.",)


def _cut(row: Sequence[str], neighbours: Sequence[Sequence[str]], end: int) -> bool:
    if len(row) < min(map(len, neighbours)):
        return True
    names = not any(map(is_number, row))
    return not names and not is_number(row[end]) and all(is_number(neighbour[end]) for neighbour in neighbours)


# A text file of columns: header lines, lines of data, and truncated lines.

HEADER_LINES = 100
"""Maximum number of lines above the data."""

PART_OF_NUMBERS = 0.5
"""Minimum fraction of fields of a line of data that are numbers or empty."""

_MARKS = "#%/! "
"""Characters that a line of names may start with."""


@dataclass(frozen=True)
class TextFormat:
    """The format of a text file of columns, which is not used for Parquet and MATLAB files.

    Attributes:
        separator: separator of the columns, or empty for white space.
        header: whether a line above the data names the columns. The header is the first line with as many fields as the
            data. Other lines above the data, such as a title or the units, are ignored. Without a line above the data,
            the columns are numbered.
        comment: start of the lines that are ignored, or empty to ignore no lines.
    """

    separator: str = ","
    header: bool = True
    comment: str = ""

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line without surrounding white space."""
        return [field.strip() for field in line.strip("\r\n").split(self.separator or None)]


def read_text(path: Path, text: TextFormat) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Read a text file of columns. Return the table, and a note that counts truncated rows, if any.

    Raises:
        RecordingError: the file is missing or empty.
        ValueError: pandas cannot read the file (ParserError, UnicodeError and others are subclasses).
    """
    import pandas as pd

    require_content(path)
    lines, tail = _sample(path)
    use = [k for k, line in enumerate(lines) if line.strip() and not (text.comment and line.startswith(text.comment))]
    data = next((k for k in use[:HEADER_LINES] if _is_data(lines[k], text)), None)
    first = last = False
    named, skipped = text.header, []
    if data is not None:
        above = [k for k in use if k < data]
        names = _naming(above, lines, data, text) if text.header else None
        rows = [lines[k] for k in use if k >= data] + [line for line in tail if line.strip()]
        named = names is not None  # the first row below a header is never truncated
        first, last = (cut and not (named and k == 0) for k, cut in enumerate(cut_ends(rows, text.separator or None)))
        skipped = [k for k in above if k != names] + ([data] if first else [])
    table = pd.read_csv(
        path,
        sep=text.separator or r"\s+",
        header=0 if named else None,
        comment=text.comment or None,
        skiprows=skipped,
        skipinitialspace=True,
        index_col=False,
        low_memory=False,
    )
    if last and len(table):
        table = table.iloc[:-1].infer_objects()
    return table, cut_note(path.name, first=first, last=last)


def _sample(path: Path) -> tuple[list[str], list[str]]:
    """Return complete lines from the start of a file and, if the file is long, complete lines from its end."""
    with path.open("rb") as file:
        head = file.read(SAMPLE)
        file.seek(max(len(head), path.stat().st_size - SAMPLE))
        blocks = [block.decode("utf-8", errors="replace") for block in (head, file.read())]
    lines, after = (re.split(r"\r\n|\r|\n", block) for block in blocks)
    return (lines[:-1], after[1:]) if blocks[1] else (lines, [])


def _is_data(line: str, text: TextFormat) -> bool:
    fields = text.fields(line)
    return sum(not field or is_number(field) for field in fields) > PART_OF_NUMBERS * len(fields) and any(fields)


def _naming(above: Sequence[int], lines: Sequence[str], data: int, text: TextFormat) -> int | None:
    """Return the index of the header: the first line with as many fields as the data, or the line above the data."""
    count = len(text.fields(lines[data]))
    fitting = [k for k in above if len(text.fields(lines[k].lstrip(_MARKS))) == count]
    return fitting[0] if fitting else above[-1] if above else None
