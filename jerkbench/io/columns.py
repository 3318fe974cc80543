"""Columns of numbers, selected by name or number, from one or several files (CSV, Parquet, MATLAB and others)."""

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError, unknown
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS
from jerkbench.io.sanitiser import (
    MAX_DATE_NS,
    MAX_NUMBERS,
    MAX_RATIO,
    MIN_DATE_NS,
    ordered_rows,
    require_fractions,
    require_size,
)
from jerkbench.io.text import MAX_NUMBER, TextFormat, is_number, read_text, require_content
from jerkbench.io.tracks import track_reader

if TYPE_CHECKING:
    import h5py
    import pandas as pd
    import pyarrow as pa


# MATLAB files of the versions 5 to 7, and 7.3 (HDF5). Numeric vectors and matrices become columns of a table.

_MATRIX, _COMPRESSED, _DATA_TYPES = 14, 15, {*range(1, 8), 9, 12, 13, 16, 17, 18}
"""Type codes of arrays, of compressed variables, and of numbers and text in a file of version 5."""

MAX_COLUMNS = 64
"""Maximum number of columns of a matrix of measurements. Matrices with more columns are ignored."""

Array = np.ndarray[Any, Any]


def read_matlab(path: Path) -> "pd.DataFrame":
    """Return a table with a column for each vector and for each column of a matrix in the file.

    The columns of a matrix ``acc`` are named ``acc_1``, ``acc_2``, ... A field ``t`` of a structure ``imu`` is named
    ``imu.t``. If the variables have different lengths, empty cells are appended to the shorter columns.

    Raises:
        RecordingError: the file does not exist, is damaged, or has no numeric array of two rows or more.
    """
    import h5py
    import pandas as pd

    require_content(path)
    try:
        arrays = dict(_version_7_3(path)) if h5py.is_hdf5(path) else dict(_version_5(path))
    except RecordingError:
        raise
    except Exception as error:  # scipy and h5py raise undocumented errors for damaged files
        raise RecordingError(
            f"{path} cannot be read as a MATLAB file ({type(error).__name__}: {error}); copy or save the file again."
        ) from error
    columns = dict(_columns(arrays))
    if not columns:
        raise RecordingError(
            f"{path} has no numeric vector or matrix; save the data (or the columns of a timetable) as numeric arrays."
        )
    require_size(path, max(map(len, columns.values())) * len(columns))
    return pd.DataFrame({name: _series(values) for name, values in columns.items()})


def _version_5(path: Path) -> Iterator[tuple[str, Array]]:
    def walk(prefix: str, value: object) -> Iterator[tuple[str, Array]]:
        """Yield the numeric arrays of a variable and of the fields of a structure."""
        if isinstance(value, dict):
            for name, field in value.items():
                if not name.startswith("__"):
                    yield from walk(f"{prefix}.{name}" if prefix else name, field)
        elif isinstance(value, np.ndarray):
            yield prefix, value

    yield from walk("", load_matlab_5(path, simplify_cells=True))


def load_matlab_5(path: Path, **options: Any) -> dict[str, Any]:  # noqa: ANN401 - options of loadmat
    """Return the variables of a MATLAB file of version 5, after a check of its data types and of its decompressed size.

    Raises:
        RecordingError: the decompressed variables are far larger than the file.
        ValueError: a data type is unknown.
    """
    from scipy.io import loadmat

    content = path.read_bytes()
    _require_types(path, memoryview(content)[128:], "little" if content[126:128] == b"IM" else "big")
    return dict(loadmat(path, **options))


def _require_types(path: Path, content: memoryview, order: Literal["little", "big"]) -> None:
    """Check the data type of each element in ``content``, because scipy crashes if a data type is unknown."""
    at = size = 0
    while at + 8 <= len(content):
        first, length = (int.from_bytes(content[k : k + 4], order) for k in (at, at + 4))
        kind, length, start = (first & 0xFFFF, first >> 16, at + 4) if first >> 16 else (first, length, at + 8)
        part = content[start : start + length]
        if kind == _COMPRESSED:
            part = memoryview(zlib.decompressobj().decompress(part, 8 * MAX_NUMBERS + MAX_RATIO * len(part)))
            size += len(part)
            require_size(path, size // 8)
        if kind in {_MATRIX, _COMPRESSED}:
            _require_types(path, part, order)
        elif kind not in _DATA_TYPES:
            raise ValueError(f"unknown data type {kind}")
        at = start + length + (0 if kind == _COMPRESSED else -(start + length) % 8)


def _version_7_3(path: Path) -> Iterator[tuple[str, Array]]:
    """Yield all arrays except internal reference tables, transposed, because MATLAB stores arrays transposed."""
    import h5py

    with h5py.File(path) as file:
        for name, array in hdf5_arrays(path, file).items():
            if not name.startswith("#"):
                yield name.replace("/", "."), array.T


def hdf5_arrays(path: Path, file: "h5py.File") -> dict[str, Array]:
    """Return the numeric arrays of an open HDF5 file by their names.

    Raises:
        RecordingError: the data of an array are in a different file, or the arrays are far larger than the file.
    """
    import h5py

    links: dict[str, object] = {}
    file.visititems_links(links.__setitem__)
    nodes = [(name, file[name]) for name, link in links.items() if isinstance(link, h5py.HardLink)]
    sets = {n: d for n, d in nodes if isinstance(d, h5py.Dataset) and d.dtype.kind in "iufb" and d.shape is not None}
    external = [name for name, link in links.items() if isinstance(link, h5py.ExternalLink)]
    external += [name for name, data in sets.items() if data.external or data.is_virtual]
    if external:
        raise RecordingError(f"{path}: {', '.join(external)} refers to another file; copy the data into this file.")
    require_size(path, sum(max(data.size, math.prod(data.chunks or ())) for data in sets.values()))
    return {name: data[()] for name, data in sets.items()}


def _columns(arrays: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    for name, array in arrays.items():
        if array.dtype.kind not in "iufb" or array.ndim not in (1, 2) or array.size < 2:
            continue
        matrix = array.reshape(len(array), -1)
        if min(matrix.shape) == 1:
            yield name, matrix.ravel()
        elif matrix.shape[1] <= MAX_COLUMNS:
            yield from ((f"{name}_{k + 1}", column) for k, column in enumerate(matrix.T))


def _series(values: Array) -> "pd.Series[Any]":
    """Return a series with a type that allows the empty cells that a data frame appends to shorter columns."""
    import pandas as pd

    plain = values.astype(np.int64 if values.dtype.kind == "b" else values.dtype.newbyteorder("="))
    return pd.Series(plain, dtype={"i": "Int64", "u": "UInt64"}.get(values.dtype.kind))


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

        If all values are integers of at least 2^63, 2^63 is subtracted from all values.

        Raises:
            RecordingError: the column does not exist, or a cell is not a number, empty or too large.
        """
        values = self._numeric(name)
        if values.dtype == np.uint64:  # a counter that started at 2^63; only its differences are used
            values = (values - np.uint64(2**63)).astype(np.int64)
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
        if pd.api.types.is_bool_dtype(column) or pd.api.types.is_complex_dtype(column):
            raise RecordingError(f"{self.where}, column {name} holds {column.dtype} values; numbers are expected.")
        try:
            numeric = pd.to_numeric(column, errors="coerce")
        except OverflowError:  # an integer with hundreds of digits
            numeric = column.map(lambda cell: float(str(cell)) if is_number(str(cell)) else math.nan)
        self._require(numeric.notna() | column.isna(), name, column, "'{}' is not a number")
        integer = pd.api.types.is_integer_dtype(numeric) and not numeric.isna().any()
        fits = integer and (numeric.empty or numeric.max() <= np.iinfo(np.int64).max)
        if integer and not fits and numeric.min() > np.iinfo(np.int64).max:
            return numeric.to_numpy(dtype=np.uint64)
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


SOLUTION = ".pos"
"""Ending of RTKLIB's solutions."""


def read_columns(paths: Sequence[Path], text: TextFormat, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> Columns:
    """Read one or several files, and return one table with the rows of all files in the order of ``paths``.

    Args:
        paths: files with CSV, other text, Parquet, MATLAB, RTKLIB's .pos, or the native format of a receiver.
        text: the format of text files.
        gpst_minus_utc_s: GPS time minus UTC, for the times in a .pos file [s].

    Raises:
        RecordingError: a file is missing, empty or not a table, or the files have different columns.
    """
    import pandas as pd

    read = [_read(path, text, gpst_minus_utc_s) for path in paths]
    tables, notes = [table for table, _ in read], tuple(note for _, of_file in read for note in of_file)
    if not any(map(len, tables)):
        raise RecordingError(f"{paths[0]} has no rows of data; it needs one line for each time stamp.")
    for path, table in zip(paths, tables, strict=True):
        if len(table.columns) != len(tables[0].columns):
            raise RecordingError(
                f"{paths[0]} and {path} have different numbers of columns; remove the file with the wrong columns."
            )
        if missing := [str(name) for name in tables[0].columns if name not in table.columns]:
            raise RecordingError(
                f"{path} cannot be combined with {paths[0]}, because the columns {', '.join(missing)} of {paths[0]} are"
                " missing; select one of the two files, or remove the file that does not belong to the recording."
            )
    where = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more files"
    return Columns(where, tables[0] if len(tables) == 1 else pd.concat(tables, ignore_index=True), notes)


def _read(path: Path, text: TextFormat, gpst_minus_utc_s: float) -> tuple["pd.DataFrame", tuple[str, ...]]:
    from jerkbench.io.rtklib import read_pos  # a solution is computed from columns of the file

    if path.suffix == ".mat":
        return read_matlab(path), ()
    require_content(path)
    if path.suffix != SOLUTION and (reader := track_reader(path)):
        return reader(path)
    kind = "Parquet" if path.suffix == ".parquet" else "text columns"
    try:
        if path.suffix == SOLUTION:
            return read_pos(path, gpst_minus_utc_s)
        return (_read_parquet(path), ()) if path.suffix == ".parquet" else read_text(path, text)
    except RecordingError:
        raise
    except Exception as error:  # for damaged files, pandas and pyarrow raise many types of exceptions
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise RecordingError(f"{path} cannot be read as {kind} ({reason}); correct the file.") from error


def _read_parquet(path: Path) -> "pd.DataFrame":
    """Return the columns that are not nested. Columns of text remain dictionary-encoded to save memory."""
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

    file = ParquetFile(path)
    about, schema = file.metadata, file.schema_arrow
    groups = [about.row_group(k) for k in range(about.num_row_groups)]
    parts = [group.column(k) for group in groups for k in range(group.num_columns)]
    require_size(path, sum(max(part.num_values, part.total_uncompressed_size // 8) for part in parts))
    flat = [field.name for field in schema if _is_flat(field.type)]
    text = [name for name in flat if pa.types.is_string(schema.field(name).type)]
    batches, size = [], 0
    for batch in ParquetFile(path, read_dictionary=text).iter_batches(columns=flat):
        size += batch.nbytes
        require_size(path, size // 8)
        batches.append(batch)
    table: pd.DataFrame = pa.Table.from_batches(batches, batches[0].schema if batches else schema).to_pandas()
    return table


def _is_flat(kind: "pa.DataType") -> bool:
    from pyarrow import types

    tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_temporal, types.is_string)
    return any(test(kind) for test in tests)
