"""Any table, CSV, Parquet or MATLAB, one file or many -> columns of numbers, by name or number."""

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError, unknown
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS, calendar_ns
from jerkbench.io.rtklib import read_pos
from jerkbench.io.sanitiser import MAX_DATE_NS, MIN_DATE_NS, require_size
from jerkbench.io.text import MAX_NUMBER, TextFormat, is_number, read_lines, read_text, require_content
from jerkbench.io.tracks import track_reader

if TYPE_CHECKING:
    import h5py
    import pandas as pd
    import pyarrow as pa


# A MATLAB file (version 5 to 7, or 7.3, which is HDF5) -> a table of its numeric vectors and
# matrices.

_COMPRESSED = 15
"""The type of a compressed variable in a file of version 5."""

MAX_COLUMNS = 64
"""A matrix with more columns is no stream of measurements."""

Array = np.ndarray[Any, Any]


def read_matlab(path: Path) -> "pd.DataFrame":
    """Return a column for each vector, and for each column of a matrix, of the file.

    The columns of a matrix ``acc`` are ``acc_1``, ``acc_2`` ...; a field ``t`` of a structure ``imu`` is ``imu.t``.
    Variables may be of different lengths, each with a time of its own: the shorter ones end with empty cells.

    Raises:
        RecordingError: no such file, it is damaged, or it holds no numeric array of two rows or more.
    """
    import h5py
    import pandas as pd

    require_content(path)
    try:
        arrays = dict(_version_7_3(path)) if h5py.is_hdf5(path) else dict(_version_5(path))
    except RecordingError:
        raise
    except Exception as error:  # scipy and h5py document none of what a damaged file makes them raise
        raise RecordingError(
            f"{path} cannot be read as a MATLAB file ({type(error).__name__}: {error}); copy it again, or save it anew."
        ) from error
    columns = dict(_columns(arrays))
    if not columns:
        raise RecordingError(
            f"{path} holds no numeric vector or matrix; save the measurements as such (a timetable: its columns)."
        )
    rows = max(map(len, columns.values()))
    require_size(path, rows * len(columns))
    return pd.DataFrame({name: _padded(values, rows) for name, values in columns.items()})


def _version_5(path: Path) -> Iterator[tuple[str, Array]]:
    def walk(prefix: str, value: object) -> Iterator[tuple[str, Array]]:
        """Yield the numeric arrays of a variable, those of a structure's fields too."""
        if isinstance(value, dict):
            for name, field in value.items():
                if not name.startswith("__"):
                    yield from walk(f"{prefix}.{name}" if prefix else name, field)
        elif isinstance(value, np.ndarray):
            yield prefix, value

    yield from walk("", load_matlab_5(path, simplify_cells=True))


def load_matlab_5(path: Path, **options: Any) -> dict[str, Any]:  # noqa: ANN401 - those of loadmat
    """Return the variables of a MATLAB file of version 5, whose compressed variables are not too large.

    Raises:
        RecordingError: they are far larger than the file.
    """
    from scipy.io import loadmat

    content, size, at = path.read_bytes(), 0, 128
    order: Literal["little", "big"] = "little" if content[126:128] == b"IM" else "big"
    while at < len(content):
        kind, length = (int.from_bytes(content[k : k + 4], order) for k in (at, at + 4))
        if kind == 0:  # no element; loadmat raises an error
            break
        if kind == _COMPRESSED:
            unpacker, packed = zlib.decompressobj(), content[at + 8 : at + 8 + length]
            with suppress(zlib.error):  # of damaged data, for which loadmat raises an error too
                while packed and not unpacker.eof:
                    size += len(unpacker.decompress(packed, 1 << 24))
                    require_size(path, size // 8)
                    packed = unpacker.unconsumed_tail
        at += 8 + length
    return dict(loadmat(path, **options))


def _version_7_3(path: Path) -> Iterator[tuple[str, Array]]:
    """The arrays, which MATLAB stores with their axes the other way round; its own tables of references aside."""
    import h5py

    with h5py.File(path) as file:
        for name, array in hdf5_arrays(path, file).items():
            if not name.startswith("#"):
                yield name.replace("/", "."), array.T


def hdf5_arrays(path: Path, file: "h5py.File") -> dict[str, Array]:
    """Return the numeric arrays of an open HDF5 file by their names.

    Raises:
        RecordingError: data are in another file, or the arrays are far larger than the file.
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


def _padded(values: Array, rows: int) -> "pd.Series[Any]":
    import pandas as pd

    plain = values.astype(np.int64 if values.dtype.kind == "b" else values.dtype.newbyteorder("="))
    return pd.Series(plain, dtype={"i": "Int64", "u": "UInt64"}.get(values.dtype.kind)).reindex(range(rows))


TIME_UNITS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""Nanoseconds in each unit of time."""

MAX_NANOSECONDS = 9.2e18
"""Nanoseconds that fit into 64 bits: 292 years."""


WEEK_AND_TIME = r"\d{1,4}:\d{1,6}(\.\d{1,9})?"
DATE_AND_TIME = r"\d{4}-\d\d-\d\d[T ]\d\d"


class Columns:
    """A table that was read."""

    def __init__(self, where: str, table: "pd.DataFrame", notes: tuple[str, ...] = ()) -> None:
        """Keep the table; ``where`` names it in errors, ``notes`` say what was dropped of it."""
        self.where, self.notes = where, notes
        numbered = all(not isinstance(name, str) for name in table.columns)
        names = [str(k + 1) if numbered else str(n).strip().lstrip("#").strip() for k, n in enumerate(table.columns)]
        self._table, self._names = table, names

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._table)

    @property
    def names(self) -> list[str]:
        """The names of the header, or numbers from 1."""
        return list(self._names)

    def has(self, names: Sequence[str]) -> bool:
        """Whether the header names all of ``names``, and there is one."""
        return bool(names) and set(names) <= set(self._names)

    def rows_of(self, names: Sequence[str]) -> BoolArray:
        """Return (n,) in which rows at least one of the columns ``names`` has an entry.

        Raises:
            RecordingError: there is no such column.
        """
        entries = self._table.iloc[:, [self._place(name) for name in names]].notna()
        return np.asarray(entries.any(axis=1), dtype=np.bool_)

    def only(self, rows: BoolArray | IntArray) -> "Columns":
        """Return the table with only ``rows``; they keep their numbers in errors."""
        return Columns(self.where, self._table.iloc[rows], self.notes)

    def noted(self, notes: tuple[str, ...]) -> "Columns":
        """Return the table with ``notes`` beside those that it has."""
        return Columns(self.where, self._table, (*self.notes, *notes))

    def numbers(self, names: Sequence[str], most: float = MAX_NUMBER) -> FloatArray:
        """Return (n, len(names)); an empty cell is NaN.

        Raises:
            RecordingError: there is no such column, or a cell is no number, or larger than ``most``.
        """
        columns = [self._numeric(name) for name in names]
        table = np.column_stack(columns).astype(np.float64) if columns else np.empty((len(self), 0))
        for name, column in zip(names, table.T, strict=True):
            self._require(~(np.abs(column) > most), name, column, "{:g} is no measurement")
        return table

    def stamps_ns(self, name: str, unit: str) -> IntArray:
        """Return (n,) a column of times in ``unit`` as whole nanoseconds; whole numbers stay exact.

        If all are unsigned numbers from 2^63 on, they count from there.

        Raises:
            RecordingError: as in `numbers`, or a time is missing or does not fit.
        """
        values = self._numeric(name)
        if values.dtype == np.uint64:  # a counter that started at 2^63: the differences count
            values = (values - np.uint64(2**63)).astype(np.int64)
        scale = WEEK_NS if unit == "week" else TIME_UNITS[unit]
        fits = np.abs(values.astype(np.float64)) <= MAX_NANOSECONDS / scale  # NaN does not
        self._require(fits, name, values, f"'{{}}' is no time in {unit}, at most {MAX_NANOSECONDS / scale:.2g}")
        if np.issubdtype(values.dtype, np.integer):
            return np.asarray(values.astype(np.int64) * scale)
        return np.round(values.astype(np.float64) * scale).astype(np.int64)

    def dates_ns(self, name: str, gpst_minus_utc_s: float) -> IntArray | None:
        """Return (n,) UTC nanoseconds since 1970 of a column of dates; None where it holds numbers.

        A cell is a date and time as in ISO 8601 (without a zone: UTC), or GPS week and time of week, ``2374:243258.5``.
        A date that is not between 1980 and 2100 becomes the first moment of 2100, which is not either.

        Raises:
            RecordingError: there is no such column, or some cells are dates and another one is none.
        """
        import pandas as pd

        column = self._table.iloc[:, self._place(name)]
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
        self._require(stamps.notna(), name, column, "'{}' is no date, others are")
        return _date_ns(stamps)

    def _require(self, fits: npt.ArrayLike, name: str, values: Any, reason: str) -> None:  # noqa: ANN401 - a column
        """Raise a RecordingError that names the first row, by its number when it was read, where ``fits`` is False."""
        wrong = np.flatnonzero(~np.asarray(fits, dtype=np.bool_))
        if wrong.size:
            number, said = int(self._table.index[wrong[0]]) + 1, reason.format(np.asarray(values)[wrong[0]])
            raise RecordingError(f"{self.where}, row {number}, column {name}: {said}.")

    def _numeric(self, name: str) -> np.ndarray[Any, Any]:
        import pandas as pd

        column = self._table.iloc[:, self._place(name)]
        if pd.api.types.is_bool_dtype(column) or pd.api.types.is_complex_dtype(column):
            raise RecordingError(f"{self.where}, column {name} holds {column.dtype} values; numbers are expected.")
        try:
            numeric = pd.to_numeric(column, errors="coerce")
        except OverflowError:  # a whole number with hundreds of digits
            numeric = column.map(lambda cell: float(str(cell)) if is_number(str(cell)) else math.nan)
        self._require(numeric.notna() | column.isna(), name, column, "'{}' is no number")
        whole = pd.api.types.is_integer_dtype(numeric) and not numeric.isna().any()
        fits = whole and (numeric.empty or numeric.max() <= np.iinfo(np.int64).max)
        if whole and not fits and numeric.min() > np.iinfo(np.int64).max:
            return numeric.to_numpy(dtype=np.uint64)
        return numeric.to_numpy(dtype=np.int64 if fits else np.float64)

    def _place(self, name: str) -> int:
        """A name of the header, or a number from 1."""
        if name in self._names:
            return self._names.index(name)
        if name.isascii() and name.isdigit() and 1 <= int(name) <= len(self._names):
            return int(name) - 1
        raise RecordingError(f"{self.where}: {unknown('column', name, self._names)} Numbers count from 1.")


def _date_ns(stamps: "pd.Series[Any]") -> IntArray:
    """Nanoseconds since 1970 of UTC dates; `MAX_DATE_NS` where these do not fit, or the date is missing."""
    seconds = stamps.dt.tz_localize(None).to_numpy(dtype="datetime64[s]").astype(np.int64)
    fits = (seconds >= MIN_DATE_NS // 10**9) & (seconds < MAX_DATE_NS // 10**9)
    ns = stamps.where(fits).dt.tz_localize(None).to_numpy(dtype="datetime64[ns]").astype(np.int64)
    return np.where(fits, ns, MAX_DATE_NS)


def times_ns(columns: Columns, name: str, unit: str, week: str) -> IntArray:
    """Return (n,) a column of times as nanoseconds; of a time of week with those of the weeks in the column ``week``.

    Raises:
        RecordingError: there is no such column, or a time is none.
    """
    t_ns = columns.stamps_ns(name, unit)
    return t_ns + columns.stamps_ns(week, "week") if week else t_ns


SOLUTION = ".pos"
"""Ending of RTKLIB's solutions."""

_MARKS = "_events.pos"


def find_tables(folder: Path, pattern: str, parameter: str) -> tuple[Path, ...]:
    """Return the files of ``folder`` that fit ``pattern`` (a name, or a glob such as ``data/*.txt``), sorted.

    The marks of events that RTKLIB writes beside a solution (name_events.pos) fit no pattern but their own name.

    Raises:
        RecordingError: there is no such folder or file.
    """
    if not folder.is_dir():
        raise RecordingError(f"There is no folder {folder}; give the one that the recording was copied to.")
    try:
        fitting = [path for path in folder.glob(pattern) if path.is_file()]
        paths = tuple(sorted(p for p in fitting if not p.name.endswith(_MARKS) or pattern.endswith(_MARKS)))
    except (ValueError, NotImplementedError, OSError) as error:
        raise RecordingError(
            f"{parameter} is '{pattern}': {error}; give a name or a pattern below {folder}."
        ) from error
    if not paths:
        raise RecordingError(f"There is no file {folder / pattern}; correct '{parameter}' or copy the file there.")
    return paths


def read_columns(paths: Sequence[Path], text: TextFormat, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> Columns:
    """Read the files one after the other into one table.

    Args:
        paths: CSV, other text, Parquet, MATLAB, RTKLIB's .pos, or a receiver's own format.
        text: the format of a text of columns.
        gpst_minus_utc_s: leap seconds of the times in a .pos.

    Raises:
        RecordingError: a file is missing, empty, or no table; the files have different columns.
    """
    import pandas as pd

    read = [_read(path, text, gpst_minus_utc_s) for path in paths]
    tables, notes = [table for table, _ in read], tuple(note for _, remarks in read for note in remarks)
    for path, table in zip(paths, tables, strict=True):
        if len(table.columns) != len(tables[0].columns):
            raise RecordingError(
                f"{paths[0]} and the files beside it have different numbers of columns; remove the odd one."
            )
        if missing := [str(name) for name in tables[0].columns if name not in table.columns]:
            raise RecordingError(
                f"{path} has no column {', '.join(missing)}, which {paths[0]} has, so that they are no one table; name"
                " one of them, or remove the odd one."
            )
    where = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} files more"
    return Columns(where, tables[0] if len(tables) == 1 else pd.concat(tables, ignore_index=True), notes)


def read_datetimes_ns(path: Path) -> IntArray:
    """Read a file of UTC times, one a line, ``2011-09-26 13:02:25.594360375``, as nanoseconds since 1970.

    Raises:
        RecordingError: no such file, or a line is no time.
    """
    stamps = []
    for number, line in read_lines(path):
        date, _, time = line.strip().removesuffix("Z").replace("T", " ").partition(" ")
        stamps.append(calendar_ns(date, time))
        if stamps[-1] is None:
            raise RecordingError(
                f"{path}, line {number}: '{line.strip()}' is no date and time in UTC; it must look like 2011-09-26"
                " 13:02:25.594."
            )
    return np.array(stamps, dtype=np.int64)


def _read(path: Path, text: TextFormat, gpst_minus_utc_s: float) -> tuple["pd.DataFrame", tuple[str, ...]]:

    if path.suffix == ".mat":
        return read_matlab(path), ()
    if path.suffix == SOLUTION:
        return read_pos(path, gpst_minus_utc_s)
    require_content(path)
    if reader := track_reader(path):
        return reader(path)
    kind = "Parquet" if path.suffix == ".parquet" else "text columns"
    try:
        if path.suffix != ".parquet":
            return read_text(path, text)
        return _read_parquet(path), ()
    except RecordingError:
        raise
    except Exception as error:  # pandas and pyarrow raise a dozen kinds on damaged files
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise RecordingError(f"{path} cannot be read as {kind} ({reason}); correct it.") from error


def _read_parquet(path: Path) -> "pd.DataFrame":
    """Return the flat columns; text stays coded by its dictionary, so that a small file cannot fill the memory."""
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
