"""Cells as they were stored before there were parts: one Parquet file each, called by its key."""

import hashlib
import io
import json
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.results.part_shape import HEAD
from jerkbench.results.parts import DAMAGE, Block, with_facts
from jerkbench.results.shape import MOST_ROWS, is_cell

METADATA = b"jerkbench"
DIGEST = b"jerkbench.sha256"
"""Hash of the rows and of what is stored beside them: a flipped bit in a page or in a name is found."""


def old_cell(key: str, content: bytes) -> pa.Table | None:
    """Return the rows of a cell's file as those of a part; None where it is not as it was written."""
    try:
        file = pq.ParquetFile(io.BytesIO(content))
        if file.metadata.num_rows > MOST_ROWS:
            return None
        table = file.read(use_threads=False)  # a cell is too small for threads
        head = table.schema.metadata
        text = head[METADATA].decode()
        metadata: dict[str, Any] = json.loads(text)
        whole = (DIGEST not in head or head[DIGEST] == signature(table, text)) and is_cell(table, metadata)
        return _as_part(key, table, metadata) if whole else None
    except DAMAGE:
        return None


def signature(table: pa.Table, text: str) -> bytes:
    """Hash all values, to the bit, what pandas makes of them, and the text beside them."""
    sha = hashlib.sha256(text.encode())
    for name, value in sorted((table.schema.metadata or {}).items()):
        sha.update(b"" if name in (METADATA, DIGEST) else name + value)
    for name, column in zip(table.column_names, table.columns, strict=True):
        plain = pa.types.is_floating(column.type) or pa.types.is_integer(column.type)
        sha.update(f"{name} {column.type if plain else ''}".encode())
        sha.update(column.to_numpy().tobytes() if plain else json.dumps(column.to_pylist(), default=str).encode())
    return sha.hexdigest().encode()


def _as_part(key: str, table: pa.Table, metadata: dict[str, Any]) -> pa.Table:
    columns = {
        name: column.dictionary_encode() if pa.types.is_string(column.type) else column
        for name, column in zip(table.column_names, table.columns, strict=True)
    }
    ordered = {name: columns[name] for name in (*HEAD, *columns)}
    named = dict.fromkeys(table.column_names)
    return with_facts(ordered, [Block(key, table.num_rows, [named] * table.num_rows, metadata)])
