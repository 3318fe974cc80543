"""Readers of stored results, which raise an error with a clear message if a file is missing, changed or damaged."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from jerkbench.errors import JerkbenchError, is_plain, plain

Test = Callable[[Any], bool]


def file_hashes(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 hash of each file in ``folder`` with one of the names ``names``.

    Raises:
        OSError: A file cannot be read.
    """
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}


def changed_files(folder: Path, stated: Mapping[str, str], names: Iterable[str]) -> list[str]:
    """Return a message for each file whose hash differs from the hash in the manifest."""
    return [
        f"{name} was changed after it was made: its hash differs from the manifest."
        for name, digest in file_hashes(folder, names).items()
        if stated.get(name) != digest
    ]


def read_file(path: Path, read: Callable[[Path], Any], origin: str) -> Any:  # noqa: ANN401 - the reader's result
    """Call ``read`` to read a file, and convert exceptions to errors with a clear message.

    Args:
        path: The path of the file.
        read: Function that reads the file.
        origin: Sentence for the error message that explains how to create the file.

    Raises:
        JerkbenchError: The file is missing or damaged, or the path is a folder or a pipe.
    """
    if path.exists() and not path.is_file():
        raise JerkbenchError(f"{path} is not a file. {origin}")
    try:
        return read(path)
    except (OSError, ValueError, RecursionError, pa.ArrowException, yaml.YAMLError) as error:
        reason = plain(str(error).partition("\n")[0].rstrip(".")) if path.exists() else "the file does not exist"
        raise JerkbenchError(f"{path} cannot be read: {reason}. {origin}") from error


def read_json(path: Path, tests: Mapping[str, tuple[Test, str]], origin: str) -> dict[str, Any]:
    """Read a JSON object, and check some of its values.

    Args:
        path: The path of the file.
        tests: Keys to check, with a test of the value and a description of the valid values.
        origin: Sentence for the error message that explains how to create the file.

    Raises:
        JerkbenchError: The file is missing or damaged, or a value is invalid.
    """
    content = read_file(path, lambda source: json.loads(source.read_text(encoding="utf-8")), origin)
    require_part(path, isinstance(content, dict), "it must be a JSON object", origin)
    for key, (test, kind) in tests.items():
        require_part(path, test(content.get(key)), f"'{key}' must be {kind}", origin)
    return dict(content)


def require_part(path: Path, fits: object, expected: str, origin: str) -> None:
    """Raise an exception if a check of the content of a file has failed.

    Args:
        path: The path of the file.
        fits: The result of the check.
        expected: A phrase about the valid content, such as "'files' must be hashes".
        origin: Sentence for the error message that explains how to create the file.

    Raises:
        JerkbenchError: The check has failed.
    """
    if not fits:
        raise JerkbenchError(f"{path} is damaged: {expected}. {origin}")


def read_table(path: Path, kinds: Mapping[str, str], origin: str) -> pd.DataFrame:
    """Read a table from a Parquet file. The pandas metadata of the file are ignored, because they may be damaged.

    Args:
        path: The path of the file.
        kinds: Kind of each column: "text", "whole numbers" or "numbers". Only "numbers" may have missing values.
        origin: Sentence for the error message that explains how to create the file.

    Raises:
        JerkbenchError: The file is damaged, or a column is missing, exists twice, or has another kind.
    """
    table = read_file(path, _arrow_table, origin)
    for name, kind in kinds.items():
        fits = table.column_names.count(name) == 1 and _KINDS[kind](table[name].type)
        fits = fits and (kind == "numbers" or table[name].null_count == 0)
        require_part(path, fits, f"column '{name}' must be there once, with {kind} in every row", origin)
    rows: pd.DataFrame = table.to_pandas(ignore_metadata=True)
    return rows


def _arrow_table(path: Path) -> pa.Table:
    with pq.ParquetFile(path) as file:
        table = file.read().replace_schema_metadata(None)
    table.validate(full=True)
    return table


def _is_string(kind: pa.DataType) -> bool:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


_KINDS = {"text": _is_string, "whole numbers": pa.types.is_integer, "numbers": pa.types.is_floating}


def is_text(value: object) -> bool:
    """Return whether a value is text without control characters."""
    return isinstance(value, str) and is_plain(value)


def is_mapping_of(test: Test) -> Test:
    """Return a test for mappings whose keys are text and whose values pass ``test``."""
    return lambda value: isinstance(value, dict) and all(is_text(key) and test(member) for key, member in value.items())
