"""Readers of tables in one or several files: text, Parquet, MATLAB, RTKLIB's .pos, and native formats of receivers."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.io.columns import Columns, TextFormat, read_text
from jerkbench.io.conversions import GPST_MINUS_UTC_S
from jerkbench.io.files import require_content
from jerkbench.io.tracks import read_pos, track_reader

if TYPE_CHECKING:
    import h5py
    import pandas as pd

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
    import pandas as pd

    require_content(path)
    if path.suffix != SOLUTION and (reader := track_reader(path)):
        return reader(path)
    kind = {".mat": "a MATLAB file", ".parquet": "Parquet"}.get(path.suffix, "text columns")
    try:
        if path.suffix == ".mat":
            return read_matlab(path), ()
        if path.suffix == ".parquet":
            return pd.read_parquet(path), ()
        return read_pos(path, gpst_minus_utc_s) if path.suffix == SOLUTION else read_text(path, text)
    except RecordingError:
        raise
    except Exception as error:  # for damaged files, pandas, pyarrow, scipy and h5py raise many types of exceptions
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise RecordingError(f"{path} cannot be read as {kind} ({reason}); correct the file.") from error


# MATLAB files of the versions 5 to 7, and 7.3 (HDF5). Numeric vectors and matrices become columns of a table.

MAX_COLUMNS = 64
"""Maximum number of columns of a matrix of measurements. Matrices with more columns are ignored."""

Array = np.ndarray[Any, Any]


def read_matlab(path: Path) -> "pd.DataFrame":
    """Return a table with a column for each vector and for each column of a matrix in the file.

    A file of version 5 with a damaged data type may crash scipy.

    The columns of a matrix ``acc`` are named ``acc_1``, ``acc_2``, ... A field ``t`` of a structure ``imu`` is named
    ``imu.t``. If the variables have different lengths, empty cells are appended to the shorter columns.

    Raises:
        RecordingError: the file has no numeric array of two rows or more.
    """
    import h5py
    import pandas as pd
    from scipy.io import loadmat

    arrays = _version_7_3(path) if h5py.is_hdf5(path) else dict(_fields("", loadmat(path, simplify_cells=True)))
    columns = dict(_columns(arrays))
    if not columns:
        raise RecordingError(
            f"{path} has no numeric vector or matrix; save the data (or the columns of a timetable) as numeric arrays."
        )
    return pd.DataFrame({name: _series(values) for name, values in columns.items()})


def _fields(prefix: str, value: object) -> Iterator[tuple[str, Array]]:
    """Yield the numeric arrays of a variable and of the fields of a structure."""
    if isinstance(value, dict):
        for name, field in value.items():
            if not name.startswith("__"):
                yield from _fields(f"{prefix}.{name}" if prefix else name, field)
    elif isinstance(value, np.ndarray):
        yield prefix, value


def _version_7_3(path: Path) -> dict[str, Array]:
    """Return all arrays except internal reference tables, transposed, because MATLAB stores arrays transposed."""
    import h5py

    arrays: dict[str, Array] = {}

    def add(name: str, node: object) -> None:
        if not name.startswith("#") and isinstance(node, h5py.Dataset):
            arrays[name.replace("/", ".")] = stored_array(path, node).T

    with h5py.File(path) as file:
        file.visititems(add)
    return arrays


def stored_array(path: Path, data: "h5py.Dataset") -> Array:
    """Return the array of an HDF5 data set, which is empty if the data set has no values.

    Raises:
        RecordingError: the values are in another file. HDF5 would return zeros if this file is missing.
    """
    if data.is_virtual or data.external:
        raise RecordingError(f"{path}: {data.name} refers to another file; copy the data into this file.")
    return np.asarray(data) if data.shape is not None else np.empty(0)


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
