"""Readers of tables in one or several files: text, Parquet, MATLAB, RTKLIB's .pos, and native formats of receivers."""

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.io.clocks import GPST_MINUS_UTC_S
from jerkbench.io.columns import Columns
from jerkbench.io.rtklib import read_pos
from jerkbench.io.sanitiser import MAX_NUMBERS, MAX_RATIO, require_size
from jerkbench.io.text import TextFormat, read_text, require_content
from jerkbench.io.tracks import track_reader

if TYPE_CHECKING:
    import h5py
    import pandas as pd
    import pyarrow as pa

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
    groups = map(about.row_group, range(about.num_row_groups))
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

    flat = types.is_integer, types.is_floating, types.is_boolean, types.is_temporal, types.is_string
    return any(test(kind) for test in flat)


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
