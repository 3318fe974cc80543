"""A MATLAB file (version 5 to 7, or 7.3, which is HDF5) -> a table of its numeric vectors and matrices."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.readers.text import require_content

if TYPE_CHECKING:
    import pandas as pd

MOST_COLUMNS = 64
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
        arrays = dict(_hdf5(path)) if h5py.is_hdf5(path) else dict(_version_5(path))
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
    return pd.DataFrame({name: _padded(values, rows) for name, values in columns.items()})


def _version_5(path: Path) -> Iterator[tuple[str, Array]]:
    from scipy.io import loadmat

    def walk(prefix: str, value: object) -> Iterator[tuple[str, Array]]:
        """Yield the numeric arrays of a variable, those of a structure's fields too."""
        if isinstance(value, dict):
            for name, field in value.items():
                if not name.startswith("__"):
                    yield from walk(f"{prefix}.{name}" if prefix else name, field)
        elif isinstance(value, np.ndarray):
            yield prefix, value

    yield from walk("", loadmat(path, simplify_cells=True))


def _hdf5(path: Path) -> Iterator[tuple[str, Array]]:
    """The arrays, which MATLAB stores with their axes the other way round; its own tables of references aside."""
    import h5py

    with h5py.File(path) as file:
        names: list[str] = []
        file.visit(names.append)
        for name in names:
            node = file[name]
            if isinstance(node, h5py.Dataset) and not name.startswith("#") and node.dtype.kind in "iufb":
                yield name.replace("/", "."), node[()].T


def _columns(arrays: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    for name, array in arrays.items():
        if array.dtype.kind not in "iufb" or array.ndim not in (1, 2) or array.size < 2:
            continue
        matrix = array.reshape(len(array), -1)
        if min(matrix.shape) == 1:
            yield name, matrix.ravel()
        elif matrix.shape[1] <= MOST_COLUMNS:
            yield from ((f"{name}_{k + 1}", column) for k, column in enumerate(matrix.T))


def _padded(values: Array, rows: int) -> "pd.Series[Any]":
    import pandas as pd

    whole = values.dtype.kind in "iu"
    plain = values.astype(values.dtype.newbyteorder("=")) if values.dtype.kind != "b" else values.astype(np.int64)
    return pd.Series(plain, dtype="Int64" if whole else None).reindex(range(rows))
