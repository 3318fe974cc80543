"""The store: one Parquet file a cell, written at once and atomically, found again by its key."""

import hashlib
import json
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.cells.cell import Cell
from jerkbench.cells.provenance import code_digest, plugin_digest, versions
from jerkbench.errors import JerkbenchError
from jerkbench.execution.cell_run import Row
from jerkbench.results.shape import MOST_ROWS, is_cell, is_key

METADATA = b"jerkbench"
DIGEST = b"jerkbench.sha256"
"""Hash of the rows and of what is stored beside them: a flipped bit in a page or in a name is found."""
DAMAGE = (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError, pa.ArrowException)
"""Errors of pyarrow on a damaged file."""
ABANDONED_S = 3600.0
"""A half-written file that is older belongs to nobody any more."""


@dataclass(frozen=True)
class Stored:
    """A cell as it was found.

    Attributes:
        key: its name in the store.
        rows: one row a seed.
        metadata: its specification, protocol, data, notes and times.
    """

    key: str
    rows: pd.DataFrame
    metadata: dict[str, Any]


class Store:
    """The cells of one study."""

    def __init__(self, folder: Path) -> None:
        """Open the store below ``folder`` (the study's), or a folder of cells itself; nothing is written yet."""
        below = folder / "cells"
        self.folder = folder if not below.is_dir() and any(folder.glob("*.parquet")) else below

    @classmethod
    def at(cls, folder: Path) -> "Store":
        """Open the store whose files are in ``folder`` itself, whatever is in it."""
        store = cls.__new__(cls)
        store.folder = folder
        return store

    def prepare(self) -> None:
        """Make the folder, and clear away what a killed process has left half-written.

        Raises:
            JerkbenchError: nothing can be written there.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            probe = self.folder / f".probe.{os.getpid()}"
            probe.touch()
            probe.unlink()
            for partial in self.folder.rglob(".*.partial"):
                if time.time() - partial.stat().st_mtime > ABANDONED_S:
                    partial.unlink(missing_ok=True)
        except OSError as error:
            raise JerkbenchError(f"Results cannot be written to {self.folder}: {error.strerror}.") from error

    def forget(self, processes: Iterable[int]) -> None:
        """Clear away what these ``processes``, which have ended, left half-written."""
        for number in processes:
            for partial in self.folder.rglob(f".*.{number}.partial"):
                partial.unlink(missing_ok=True)

    def path(self, key: str) -> Path:
        """Return the path of the cell ``key``, whether it is stored or not."""
        return self.folder / f"{key}.parquet"

    def done(self, key: str) -> bool:
        """Whether the cell is there, whole, and no run of it failed (a failed one is tried again)."""
        stored = _load(self.path(key))
        return stored is not None and not stored[1]["failed"]

    def look(self, keys: Iterable[str]) -> tuple[set[str], list[str]]:
        """Return which of ``keys`` are `done`, and which are there, but not as they were written."""
        stored, damaged = self._find(keys)
        return {key for key, _, metadata in stored if not metadata["failed"]}, damaged

    def write(self, key: str, rows: Sequence[Row], metadata: dict[str, Any]) -> None:
        """Store a cell; a reader sees the whole of it or nothing.

        Raises:
            JerkbenchError: no reader would take it for a cell.
        """
        failed = sum(row["status"] == "failed" for row in rows)
        names = dict.fromkeys(name for row in rows for name in row)
        table = pa.table({name: [row.get(name) for row in rows] for name in names})  # by way of pandas: twice the time
        metadata = {**metadata, "failed": failed}
        if not is_cell(table, metadata):
            raise JerkbenchError(f"The rows of the cell {key} cannot be stored: a metric is no number, or has no name.")
        text = json.dumps(metadata)
        head = {METADATA: text.encode(), DIGEST: _digest(table, text)}
        whole = table.replace_schema_metadata({**(table.schema.metadata or {}), **head})
        try:
            self._put(key, whole)
        except FileNotFoundError:  # another process has just deleted the folder, which was empty
            self._put(key, whole)

    def _put(self, key: str, table: pa.Table) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        partial = self.folder / f".{key}.{os.getpid()}.partial"
        try:
            pq.write_table(table, partial)
            partial.replace(self.path(key))
        finally:
            partial.unlink(missing_ok=True)

    def read(self, keys: Iterable[str] | None = None) -> tuple[list[Stored], list[str]]:
        """Return the cells ``keys`` (default: all), and the keys of those that cannot be read."""
        tables, broken = self._find(self.names() if keys is None else keys)
        return [Stored(key, _frame(table), metadata) for key, table, metadata in tables], broken

    def names(self) -> list[str]:
        """The names of all files, whatever is in them."""
        return sorted(path.stem for path in self.folder.glob("*.parquet"))

    def records(self, keys: Iterable[str]) -> list[tuple[list[Row], dict[str, Any]]]:
        """Return the rows of those cells that can be read as they were written, each with what is beside them."""
        stored, _ = self._find(keys)
        return [
            ([{name: value for name, value in row.items() if value is not None} for row in table.to_pylist()], metadata)
            for _, table, metadata in stored
        ]

    def _find(self, keys: Iterable[str]) -> tuple[list[tuple[str, pa.Table, dict[str, Any]]], list[str]]:
        """Cells with what is stored beside them, and the keys of those that cannot be read."""
        stored, broken = [], []
        for key in keys:
            content = _load(self.path(key))
            if content is not None:
                stored.append((key, *content))
            elif os.path.lexists(self.path(key)):
                broken.append(key)
        return stored, broken


def cell_key(cell: Cell, fingerprint: str) -> str:
    """Hash of all that the cell's rows depend on: specification, protocol, our code, the plugins', libraries, data."""
    parts = [cell.dataset, *cell.disturbances, cell.attitude, cell.filter, cell.adaptation, cell.engine, *cell.metrics]
    everything = {
        "labels": cell.labels,
        "spec": cell.spec,
        "protocol": _deciding(cell),
        "code": code_digest(),
        "versions": versions(),
        "plugins": [plugin_digest(type(part)) for part in parts],
        "data": fingerprint,
    }
    return hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()[:20]


def _deciding(cell: Cell) -> dict[str, Any]:
    """The protocol without what does not matter: a deterministic cell has no seeds."""
    everything = asdict(cell.protocol)
    return everything if cell.seeded else {k: v for k, v in everything.items() if k not in ("seeds", "first_seed")}


def _load(path: Path) -> tuple[pa.Table, dict[str, Any]] | None:
    """Load a cell and what is stored beside it; None where there is no file, or none that is as it was written."""
    if not (is_key(path.name.partition(".")[0]) and path.is_file()):
        return None
    try:
        content = path.read_bytes()  # whether it may be read is no matter of damage
        file = pq.ParquetFile(pa.BufferReader(content))
        if file.metadata.num_rows > MOST_ROWS:
            return None
        table = file.read(use_threads=False)  # a cell is too small for threads
        head = table.schema.metadata
        text = head[METADATA].decode()
        metadata: dict[str, Any] = json.loads(text)
        whole = (DIGEST not in head or head[DIGEST] == _digest(table, text)) and is_cell(table, metadata)
    except FileNotFoundError:
        return None
    except PermissionError as error:
        raise JerkbenchError(f"{path} cannot be read: {error.strerror}.") from error
    except DAMAGE:
        return None
    return (table, metadata) if whole else None


def _frame(table: pa.Table) -> pd.DataFrame:
    """The rows for pandas, whatever the file says that pandas should make of them."""
    frame: pd.DataFrame = table.to_pandas(use_threads=False, ignore_metadata=True)
    return frame


def _digest(table: pa.Table, text: str) -> bytes:
    """Hash all values, to the bit, what pandas makes of them, and the text beside them."""
    sha = hashlib.sha256(text.encode())
    for name, value in sorted((table.schema.metadata or {}).items()):
        sha.update(b"" if name in (METADATA, DIGEST) else name + value)
    for name, column in zip(table.column_names, table.columns, strict=True):
        plain = pa.types.is_floating(column.type) or pa.types.is_integer(column.type)
        sha.update(f"{name} {column.type if plain else ''}".encode())
        sha.update(column.to_numpy().tobytes() if plain else json.dumps(column.to_pylist(), default=str).encode())
    return sha.hexdigest().encode()
