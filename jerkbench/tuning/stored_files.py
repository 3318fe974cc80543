"""Checks of stored results: hashes of files, and one error message for each file that cannot be read."""

import hashlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from jerkbench.errors import JerkbenchError
from jerkbench.notices import is_plain, plain

Test = Callable[[Any], bool]


def file_hashes(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of each file.

    Raises:
        OSError: one cannot be read.
    """
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}


def changed_files(folder: Path, stated: Mapping[str, str], names: Iterable[str]) -> list[str]:
    """Return a sentence for each file whose hash is not the one that the manifest states."""
    return [
        f"{name} was changed after it was made: its hash is not that of the manifest."
        for name, own in file_hashes(folder, names).items()
        if stated.get(name) != own
    ]


def require_regular(paths: Iterable[Path], origin: str) -> None:
    """Refuse folders and pipes, which would block the reader; missing files are refused when they are read.

    Raises:
        JerkbenchError: something else than a file has the name; ``origin`` says how the file is made.
    """
    for path in paths:
        if path.exists() and not path.is_file():
            raise JerkbenchError(f"{path} is no file. {origin}")


def read_file(path: Path, read: Callable[[Path], Any], origin: str) -> Any:  # noqa: ANN401 - the reader's result
    """Read a file.

    Raises:
        JerkbenchError: it is missing or damaged.
    """
    try:
        return read(path)
    except (OSError, ValueError, RecursionError, pa.ArrowException, yaml.YAMLError) as error:
        said = plain(str(error).partition("\n")[0].rstrip("."))
        raise JerkbenchError(
            f"{path} cannot be read: {said if path.exists() else 'it is not there'}. {origin}"
        ) from error


def require_parts(path: Path, parts: Mapping[str, bool | str], origin: str) -> None:
    """Check the parts of a file.

    Args:
        path: of the file.
        parts: True for each part that is right, otherwise what it has to be.
        origin: how the file is made.

    Raises:
        JerkbenchError: a part is not right.
    """
    for part, fits in parts.items():
        if fits is not True:
            raise JerkbenchError(f"{path} is damaged: {part or 'it'} must be {fits}. {origin}")


def read_table(path: Path) -> pa.Table:
    """Read a Parquet file without the metadata of pandas, which is not needed and may be damaged."""
    with pq.ParquetFile(path) as file:
        table = file.read().replace_schema_metadata(None)
    table.validate(full=True)
    return table


def require_table_columns(
    path: Path, table: pa.Table, kinds: Mapping[str, str], is_kind: Mapping[str, Test], o: str
) -> None:
    """Check that each column occurs once, with values of its kind; only numbers may be missing.

    Raises:
        JerkbenchError: a column is not right.
    """
    for name, kind in kinds.items():
        fits = table.column_names.count(name) == 1 and is_kind[kind](table[name].type)
        fits = fits and (kind == "numbers" or table[name].null_count == 0)
        require_parts(path, {f"column '{name}'": fits or f"there once, with {kind} in every row"}, o)


def is_string(kind: pa.DataType) -> bool:
    """Whether the values are text."""
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def is_text(value: object) -> bool:
    """Whether it is text without control characters."""
    return isinstance(value, str) and is_plain(value)


def is_mapping_of(test: Test) -> Test:
    """Return a test for mappings from text to values that pass ``test``."""
    return lambda value: isinstance(value, dict) and all(is_text(key) and test(own) for key, own in value.items())
