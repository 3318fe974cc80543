"""The files of a store: Parquet with runs of many cells, the digest in the name; listed, loaded, written atomically."""

import hashlib
import io
import json
import os
import re
import socket
import uuid
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.evaluated_run import RUN
from jerkbench.files import exists
from jerkbench.jobs.blocks import RowBlock
from jerkbench.jobs.labels import Labels

# A part of the store: one Parquet file with runs of many cells, its digest in its name.
#
# A row is a run: the labels of its cell, its seed and status, its metrics, and in columns that begin with ``cell.``
# what else is known of its cell, as JSON. Those columns repeat from row to row, so that Parquet keeps each text once.

PART_NAME = re.compile(r"part-[A-Za-z0-9_]+-[0-9a-f]{32}-([0-9a-f]{32})")
"""Host, a number of its own and a hash of the content: no two parts have one name, and a flipped bit is found."""

NOT_FACTS = ("labels", "spec", "failed")
"""Entries of a cell's metadata that have columns of their own, or are counted."""

NUMERIC = (pa.types.is_floating, pa.types.is_integer, pa.types.is_boolean, pa.types.is_null)
"""Tests of the types that a metric's column may have."""

DAMAGED_PARQUET = (
    *(OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError),
    pa.ArrowException,
)
"""Errors of pyarrow on a damaged file."""

CELL = "cell."
"""Beginning of the columns that say something of the whole cell."""

KEY, RUNS, COLUMNS = "cell.key", "cell.runs", "cell.columns"
PROCESSOR = "cell.processor"
"""The kind of processor that ran the cell."""

HEAD_COLUMNS = (*Labels._fields, *RUN)
"""The columns that every row has, before its metrics."""

SPEC = ("dataset", "disturbance", "attitude", "filter", "adaptation", "engine", "metrics")
ABOUT = ("protocol", "data", "notes", "code", "versions", "commit", "created", "seconds")
REQUIRED_COLUMNS = {
    *(*HEAD_COLUMNS, KEY, RUNS, COLUMNS),
    *(f"{CELL}{name}" for name in (*ABOUT, *(f"spec.{part}" for part in SPEC))),
}
"""The columns of every part; a file that lacks one is damaged."""


def content_of(table: pa.Table) -> bytes:
    """Return the content of a file."""
    sink = io.BytesIO()
    texts = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
    pq.write_table(table, sink, compression="zstd", use_dictionary=texts, write_statistics=False)
    return sink.getvalue()


def part_name(content: bytes) -> str:
    """Return a new name for a part with this content."""
    host = re.sub("[^A-Za-z0-9_]", "_", socket.gethostname())[:40] or "_"
    return f"part-{host}-{uuid.uuid4().hex}-{content_digest(content)}"


def content_digest(content: bytes) -> str:
    """Return the hash of a file's content."""
    return hashlib.sha256(content).hexdigest()[:32]


def part_of(content: bytes, expected: str, columns: list[str] | None = None) -> pa.Table | None:
    """Return the rows of a part, or some of their columns; None where it is not as it was written.

    Args:
        content: of the file.
        expected: its digest.
        columns: which are read; default: all.
    """
    if content_digest(content) != expected:
        return None
    try:
        # Not read_table: its threads may let go of the content when the interpreter has ended, which aborts it.
        file = pq.ParquetFile(pa.BufferReader(content))
        return file.read(columns=columns, use_threads=False) if _is_part(file.schema_arrow) else None
    except DAMAGED_PARQUET:
        return None


def table_of(blocks: Sequence[RowBlock]) -> pa.Table:
    """Return the rows of some cells, with all that is known of these.

    Raises:
        JerkbenchError: no reader would take them for rows.
    """
    rows = [row for block in blocks for row in block.rows]
    table = with_facts({name: _values(name, [row.get(name) for row in rows]) for name in _names(blocks)}, blocks)
    if not _is_part(table.schema):
        keys = ", ".join(block.key for block in blocks[:3])
        raise JerkbenchError(f"The rows of the cells {keys} cannot be stored: a metric is no number, or has no name.")
    return table


def with_facts(columns: dict[str, pa.Array], blocks: Sequence[RowBlock]) -> pa.Table:
    """Return the table of columns of the rows of some blocks, with all that is known of their cells."""
    counts = [len(block.rows) for block in blocks]
    known = [_facts(block) for block in blocks]
    facts = {name: _repeated([own.get(name) for own in known], counts) for name in dict.fromkeys(chain(*known))}
    return pa.table(
        {**columns, RUNS: pa.array(np.repeat([block.runs for block in blocks], counts), pa.int32()), **facts}
    )


@lru_cache(maxsize=65_536)
def parsed(text: str) -> Any:  # noqa: ANN401 - any JSON
    """Return what a JSON text says; it is shared by all who ask, and not to be changed."""
    return json.loads(text)


def _is_part(schema: pa.Schema) -> bool:
    """Whether every column is there, and each metric is a number."""
    kinds = [field.type for field in schema if field.name not in HEAD_COLUMNS and not field.name.startswith(CELL)]
    numeric = all(any(is_kind(kind) for is_kind in NUMERIC) for kind in kinds)
    return numeric and set(schema.names) >= REQUIRED_COLUMNS


def _names(blocks: Sequence[RowBlock]) -> Iterator[str]:
    """The names of all columns of rows, those of the head first."""
    rows = chain.from_iterable(block.rows for block in blocks)
    names = dict.fromkeys([*HEAD_COLUMNS, *chain.from_iterable(rows)])
    if strange := [name for name in names if str(name).startswith(CELL)]:
        raise JerkbenchError(f"A metric cannot be called {strange[0]}: names that begin with {CELL} are taken.")
    return iter(names)


def _values(name: str, values: list[Any]) -> pa.Array:
    """A column of rows; where cells disagree about the type of a metric, of floating point numbers."""
    try:
        array = pa.array(values)
    except (pa.ArrowInvalid, pa.ArrowTypeError):
        try:
            array = pa.array([None if value is None else float(value) for value in values])
        except (TypeError, ValueError) as error:
            raise JerkbenchError(f"The metric {name} cannot be stored: {error}.") from error
    return array.dictionary_encode() if pa.types.is_string(array.type) else array


def _facts(block: RowBlock) -> dict[str, str]:
    """All that is known of a cell, each entry as JSON, by the name of its column."""
    own = [name for name in dict.fromkeys(chain.from_iterable(block.rows)) if name not in HEAD_COLUMNS]
    entries: dict[str, Any] = {name: block.metadata[name] for name in block.metadata if name not in NOT_FACTS}
    entries |= {f"spec.{part}": value for part, value in block.metadata.get("spec", {}).items()}
    texts = {CELL + name: json.dumps(value) for name, value in entries.items()}
    return {KEY: block.key, COLUMNS: json.dumps(own), **texts}


def _repeated(values: Sequence[str | None], counts: Sequence[int]) -> pa.Array:
    """One text for each row of each block, as codes of the distinct ones."""
    codes = {value: code for code, value in enumerate(dict.fromkeys(filter(None, values)))}
    places = np.repeat([codes.get(value or "", -1) for value in values], counts)
    indices = pa.array(places, pa.int32(), mask=places < 0)
    return pa.DictionaryArray.from_arrays(indices, pa.array(list(codes), pa.string()))


# The files of a store: listed, loaded, written atomically, replaced.

OLD = re.compile("[0-9a-f]{20}")
"""The name of a file with one cell, as it was stored before there were parts: its key."""

LISTINGS = 20
"""So often the files are listed again, where some of them have just been joined."""


class PartFiles:
    """The Parquet files in one folder, each by its name without the ending."""

    def __init__(self, folder: Path) -> None:
        """Take the folder as it is, there or not."""
        self.folder = folder

    def path(self, name: str) -> Path:
        """Return where the file of this name lies."""
        return self.folder / f"{name}.parquet"

    def names(self) -> list[str]:
        """Return the names of all files."""
        names = sorted(path.name.removesuffix(".parquet") for path in self.folder.glob("*.parquet"))
        if old := next(filter(OLD.fullmatch, names), None):
            raise JerkbenchError(
                f"{self.path(old)} has a format of earlier versions, which is no longer read; run the study's command"
                " (it stands in manifest.json) again into a new one (study=NAME)."
            )
        return names

    def each(
        self, columns: list[str] | None = None, seen: set[str] | None = None
    ) -> Iterator[tuple[str, pa.Table | None]]:
        """Each file by its name, with its rows (default: whole); None where it is damaged.

        Files that are ``seen`` are left out; those that were given are then.
        """
        seen = set() if seen is None else seen
        for _ in range(LISTINGS):
            vanished = False
            for name in self.names():
                if name in seen:
                    continue
                try:
                    yield name, self.load(name, columns)
                    seen.add(name)
                except FileNotFoundError:
                    vanished = True
            if not vanished:
                return

    def load(self, name: str, columns: list[str] | None) -> pa.Table | None:
        """Load a file, or some of its columns; None where it is not as it was written.

        Raises:
            FileNotFoundError: it is gone.
        """
        path, match = self.path(name), PART_NAME.fullmatch(name)
        if not match or (exists(path) and not path.is_file()):  # a pipe would be waited for
            return None
        try:
            return part_of(path.read_bytes(), match[1], columns)
        except PermissionError as error:
            raise JerkbenchError(f"{path} cannot be read: {error.strerror}.") from error

    def put(self, table: pa.Table) -> Path:
        """Write rows as a new part, at once and whole; returns its path."""
        content = content_of(table)
        path = self.path(part_name(content))
        self.folder.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.stem}.{os.getpid()}.partial")
        try:
            partial.write_bytes(content)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
        return path

    def replace(self, names: Sequence[str], table: pa.Table) -> Path:
        """Store rows of some parts as one, then delete these; a reader in between sees rows twice, never none."""
        path = self.put(table) if table.num_rows else self.folder
        for name in names:
            self.path(name).unlink(missing_ok=True)
        return path
