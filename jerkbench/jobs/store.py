"""The store: the rows of a study in Parquet files, which are written atomically and found by the keys of their jobs.

A row is one run: labels, seed, status, metrics, and in columns with the prefix ``cell.`` the metadata of its job as
JSON. Every process writes files of its own. A row that exists more than once is dropped when the files are read.
"""

import hashlib
import io
import json
import os
import re
import socket
import tempfile
import time
import uuid
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.evaluated_run import RUN_COLUMNS
from jerkbench.files import exists, write_atomically
from jerkbench.jobs.job import Job
from jerkbench.jobs.manifest import ShownSeeds, Stretches, read_manifest
from jerkbench.jobs.rows import Row
from jerkbench.notices import notify, plain
from jerkbench.renamed import new_label
from jerkbench.report.labels import Labels
from jerkbench.report.study_notes import damaged_files

PART_NAME = re.compile(r"part-[A-Za-z0-9_]+-[0-9a-f]{32}-([0-9a-f]{32})")
"""Host, a unique number and the digest of the content, so that no two files have one name and damage is detected."""

CELL = "cell."
"""Prefix of the columns with the metadata of a job."""

KEY, RUNS, COLUMNS = "cell.key", "cell.runs", "cell.columns"
"""Columns with the key of the job, its number of runs, and the names of its metrics."""

HEAD_COLUMNS = (*Labels._fields, *RUN_COLUMNS)
"""The columns that every row has before its metrics."""

SPEC = ("dataset", "disturbance", "attitude", "filter", "adaptation", "engine", "metrics")
ABOUT = ("protocol", "data", "notes", "code", "versions", "commit", "created", "seconds")
REQUIRED_COLUMNS = {
    *(*HEAD_COLUMNS, KEY, RUNS, COLUMNS),
    *(f"{CELL}{name}" for name in (*ABOUT, *(f"spec.{part}" for part in SPEC))),
}
"""The columns of every file. A file that lacks one of them is damaged."""

SEEN_COLUMNS = [KEY, "seed", "status"]
"""The columns that say which runs are stored."""

OUTCOMES = {"seed": "seed", "status": "status", "reason": "reason", f"{CELL}run_s": "run_s"}
"""Columns of `Store.rows` besides the metrics, by their names in a file."""

DAMAGED_PARQUET = (
    *(OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError),
    pa.ArrowException,
)
"""Exceptions that pyarrow raises for a damaged file."""

ABANDONED_S = 3600.0
"""Age after which a partly written file is deleted."""

SMALL_ROWS = 10_000
"""Files with fewer rows are joined."""


class RowBlock(NamedTuple):
    """Runs of a job that are stored together.

    Attributes:
        key: of the job.
        runs: number of runs of the job.
        rows: one for each of the runs in this block.
        metadata: labels, specification, protocol, data, notes and times of the job.
    """

    key: str
    runs: int
    rows: Sequence[Row]
    metadata: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Stored:
    """The stored runs of a job.

    Attributes:
        key: of the job.
        metadata: its labels, specification, protocol, data, notes and times.
        table: its runs in the order of their seeds, with all columns of the store.
        columns: its metrics.
        others: number of further runs, whose seeds are not shown.
    """

    key: str
    metadata: Mapping[str, Any]
    table: pa.Table
    columns: Sequence[str]
    others: int = 0

    @cached_property
    def rows(self) -> pd.DataFrame:
        """One row for each seed."""
        return frame(self.table, (*HEAD_COLUMNS, *self.columns))


def table_of(blocks: Sequence[RowBlock]) -> pa.Table:
    """Return the rows of some blocks with their metadata.

    Raises:
        JerkbenchError: a metric is not a number, or its name is not allowed.
    """
    rows = list(chain.from_iterable(block.rows for block in blocks))
    names = dict.fromkeys([*HEAD_COLUMNS, *chain.from_iterable(rows)])
    if reserved := [name for name in names if str(name).startswith(CELL)]:
        raise JerkbenchError(f"A metric cannot be called {reserved[0]}: names that begin with {CELL} are taken.")
    columns = {name: _column(name, [row.get(name) for row in rows]) for name in names}
    facts = [_facts(block) for block in blocks]
    block_of_row = pa.array(np.repeat(np.arange(len(blocks)), [len(block.rows) for block in blocks]))
    for name in dict.fromkeys(chain.from_iterable(facts)):
        texts = pa.array([own.get(name) for own in facts], pa.string())
        columns[name] = texts.dictionary_encode().take(block_of_row)
    columns[RUNS] = pa.array([block.runs for block in blocks], pa.int32()).take(block_of_row)
    table = pa.table(columns)
    if not _is_part(table.schema):
        keys = ", ".join(block.key for block in blocks[:3])
        raise JerkbenchError(f"The rows of the cells {keys} cannot be stored: a metric is no number, or has no name.")
    return table


def _column(name: str, values: list[Any]) -> pa.Array:
    try:
        array = pa.array(values)
    except (pa.ArrowInvalid, pa.ArrowTypeError):  # the types of the rows differ
        try:
            array = pa.array([None if value is None else float(value) for value in values])
        except (TypeError, ValueError) as error:
            raise JerkbenchError(f"The metric {name} cannot be stored: {error}.") from error
    return array.dictionary_encode() if pa.types.is_string(array.type) else array


def _facts(block: RowBlock) -> dict[str, str]:
    """Return the metadata of a block as JSON, by the names of their columns."""
    metrics = [name for name in dict.fromkeys(chain.from_iterable(block.rows)) if name not in HEAD_COLUMNS]
    entries = {name: value for name, value in block.metadata.items() if name not in ("labels", "spec")}
    entries |= {f"spec.{part}": value for part, value in block.metadata.get("spec", {}).items()}
    return {KEY: block.key} | {CELL + name: json.dumps(own) for name, own in {"columns": metrics, **entries}.items()}


def _is_part(schema: pa.Schema) -> bool:
    """Whether no column is missing and each metric is a number."""
    types = pa.types
    metrics = [field.type for field in schema if field.name not in HEAD_COLUMNS and not field.name.startswith(CELL)]
    numeric = (types.is_floating, types.is_integer, types.is_boolean, types.is_null)
    return set(schema.names) >= REQUIRED_COLUMNS and all(any(is_kind(one) for is_kind in numeric) for one in metrics)


def content_of(table: pa.Table) -> bytes:
    """Return the content of a file."""
    sink = io.BytesIO()
    texts = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
    pq.write_table(table, sink, compression="zstd", use_dictionary=texts, write_statistics=False)
    return sink.getvalue()


def content_digest(content: bytes) -> str:
    """Return the digest of a file's content."""
    return hashlib.sha256(content).hexdigest()[:32]


def part_name(content: bytes) -> str:
    """Return a new name for a file with this content."""
    host = re.sub("[^A-Za-z0-9_]", "_", socket.gethostname())[:40] or "_"
    return f"part-{host}-{uuid.uuid4().hex}-{content_digest(content)}"


def part_of(content: bytes, digest: str, columns: list[str] | None = None) -> pa.Table | None:
    """Return the rows of a file, or some of their columns. None: the file is damaged."""
    if content_digest(content) != digest:
        return None
    try:
        # Not read_table: its threads may release the content after the interpreter has ended, which aborts the process.
        file = pq.ParquetFile(pa.BufferReader(content))
        return file.read(columns=columns, use_threads=False) if _is_part(file.schema_arrow) else None
    except DAMAGED_PARQUET:
        return None


@lru_cache(maxsize=65_536)
def parsed(text: str) -> Any:  # noqa: ANN401 - any JSON
    """Return the value of a JSON text. It is shared, so it must not be changed."""
    return json.loads(text)


def frame(table: pa.Table, names: Iterable[str]) -> pd.DataFrame:
    """Return some columns, as far as they exist, as a data frame."""
    chosen = table.select([name for name in dict.fromkeys(names) if name in table.column_names]).combine_chunks()
    texts = {field.name: pa.string() for field in chosen.schema if pa.types.is_dictionary(field.type)}
    rows: pd.DataFrame = _with_types(chosen, texts).to_pandas(use_threads=False, ignore_metadata=True)
    return rows


def _with_types(table: pa.Table, types: Mapping[str, pa.DataType]) -> pa.Table:
    return table.cast(pa.schema([f.with_type(types.get(f.name, f.type)) for f in table.schema]), safe=False)


def unique_rows(tables: Sequence[pa.Table]) -> pa.Table:
    """Join tables, ordered by job and seed. Of several rows of one run the newest that did not fail is retained."""
    table = concatenated(tables)
    runs = frame(table, [*SEEN_COLUMNS, "cell.created"])
    runs["failed"] = runs["status"] == "failed"
    order = runs.sort_values([KEY, "seed", "failed", "cell.created"], ascending=[True, True, True, False])
    return table.take(pa.array(order.drop_duplicates([KEY, "seed"]).index))


def concatenated(tables: Sequence[pa.Table]) -> pa.Table:
    """Join tables. A metric with different types in the tables becomes a floating point number."""
    types: dict[str, set[pa.DataType]] = {}
    for field in chain.from_iterable(table.schema for table in tables):
        types.setdefault(field.name, set()).add(field.type)
    floats = {name: pa.float64() for name, kinds in types.items() if len(kinds - {pa.null()}) > 1}
    alike = [_with_types(table, floats) for table in tables] if floats else tables
    return pa.concat_tables(alike, promote_options="default").unify_dictionaries().combine_chunks()


def stored_jobs(tables: Sequence[pa.Table], shown: ShownSeeds) -> list[Stored]:
    """Return the complete jobs of some tables.

    Args:
        tables: at least one.
        shown: the seeds that a job must have. A job without an entry is complete if it has all its runs.
    """
    table = unique_rows(tables)
    keys, seeds, runs = (table[name].to_numpy() for name in (KEY, "seed", RUNS))
    mask, others = np.zeros(len(keys), bool), dict[str, int]()
    for key, places in _places(keys).items():
        mask[places] = _shown(seeds[places], runs[places], shown.get(key))
        others[key] = int(np.sum(~mask[places]))
    table = table.filter(pa.array(mask))
    metadata = [name for name in table.column_names if name in Labels._fields or name.startswith(CELL)]
    blocks: dict[str, list[dict[str, Any]]] = {}
    for block in frame(table, metadata).drop_duplicates().to_dict("records"):
        blocks.setdefault(block[KEY], []).append({str(name): text for name, text in block.items()})
    return [
        Stored(
            key,
            _metadata(blocks[key]),
            table.slice(places[0], len(places)),
            list(dict.fromkeys(chain.from_iterable(parsed(block[COLUMNS]) for block in blocks[key]))),
            others[key],
        )
        for key, places in _places(keys[mask]).items()
    ]


def _places(keys: Any) -> dict[str, Any]:  # noqa: ANN401 - an array of texts
    """Return the positions of each key."""
    return {str(key): places for key, places in pd.Series(keys).groupby(keys, sort=False).indices.items()}


def _shown(seeds: IntArray, runs: IntArray, stretches: Stretches | None) -> BoolArray:
    """Return which runs of a job are shown: none if one is missing."""
    if stretches is None:
        return np.full(len(seeds), len(seeds) >= runs.min())
    mask = np.zeros(len(seeds), bool)
    for first, count in stretches:
        mask |= (seeds >= first) & (seeds < first + count)
    if mask.sum() != sum(count for _, count in stretches):
        mask[:] = False
    return mask


def _metadata(blocks: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the metadata of a job from those of its blocks."""
    first = blocks[0]
    metadata: dict[str, Any] = {"labels": {kind: new_label(kind, first[kind]) for kind in Labels._fields}, "spec": {}}
    for name, text in first.items():
        kind, _, part = name.removeprefix(CELL).partition(".")
        if name.startswith(CELL) and name not in (KEY, RUNS, COLUMNS) and isinstance(text, str):
            (metadata["spec"] if part else metadata)[part or kind] = parsed(text)
    if len(blocks) > 1:
        notes, seconds, created = (
            [parsed(block[CELL + name]) for block in blocks] for name in ("notes", "seconds", "created")
        )
        processors = {parsed(text) for block in blocks if isinstance(text := block.get("cell.processor"), str)}
        metadata |= {"notes": list(dict.fromkeys(chain(*notes))), "seconds": sum(seconds), "created": max(created)}
        metadata["processor"] = " and ".join(sorted(filter(None, processors)))
    return metadata


class Store:
    """The stored jobs of a study."""

    def __init__(self, folder: Path) -> None:
        """Open the store of the study in ``folder``, or a folder of Parquet files. Nothing is written yet."""
        below = folder / "cells"
        self.folder = folder if not below.is_dir() and any(folder.glob("*.parquet")) else below

    def prepare(self) -> list[str]:
        """Create the folder, delete partly written files, and set damaged files aside, whose names are returned.

        Raises:
            JerkbenchError: the folder cannot be written to.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=self.folder):
                pass
            for partial in self.folder.rglob(".*.partial*"):
                with suppress(FileNotFoundError):  # its process has just finished it
                    if time.time() - partial.stat().st_mtime > ABANDONED_S:
                        partial.unlink()
        except OSError as error:
            raise JerkbenchError(f"Results cannot be written to {self.folder}: {error.strerror or error}.") from error
        damaged = [name for name, table in self._load_all(SEEN_COLUMNS).items() if table is None]
        for path in map(self._path, damaged):
            with suppress(FileNotFoundError):  # another process has just set it aside
                path.rename(path.with_name(f"{path.name}.damaged"))
        if damaged:
            cells = "its cells" if len(damaged) == 1 else "their cells"
            notify(f"{damaged_files(damaged)} set aside, {cells} run again: {', '.join(map(plain, damaged))}.")
        return damaged

    def write(self, tables: Sequence[pa.Table]) -> None:
        """Store tables of `table_of` as one file."""
        self._write(concatenated(tables))

    def known(self, keys: Collection[str], *, failed: bool = False) -> dict[str, set[int]]:
        """Return the seeds of the stored runs of ``keys``; with ``failed`` also those of the runs that failed."""
        known: dict[str, set[int]] = {}
        for table in self._tables(keys, SEEN_COLUMNS)[0]:
            for key, seed, status in zip(*(table[name].to_pylist() for name in SEEN_COLUMNS), strict=True):
                if failed or status != "failed":
                    known.setdefault(key, set()).add(seed)
        return known

    def read(
        self, keys: Iterable[str] | None = None, shown: ShownSeeds | None = None
    ) -> tuple[list[Stored], list[str]]:
        """Return the complete jobs among ``keys``, in their order, and the names of damaged files.

        Args:
            keys: default: all, sorted.
            shown: the seeds that are shown of each job; default: those of the manifest.
        """
        wanted = None if keys is None else dict.fromkeys(keys)
        tables, damaged = self._tables(wanted)
        if shown is None:
            shown = read_manifest(self.folder.parent).get("seeds", {}) if tables else {}
        stored = {one.key: one for one in (stored_jobs(tables, shown) if tables else ())}
        return [stored[key] for key in (sorted(stored) if wanted is None else wanted) if key in stored], damaged

    def rows(self, jobs: Sequence[Job], metrics: Sequence[str]) -> pd.DataFrame:
        """Return the runs of some jobs in the order of the jobs and their seeds. A missing run has no status.

        Args:
            jobs: with the requested seeds.
            metrics: the requested columns.

        Returns:
            The position of the job (``place``), seed, status, reason, run_s [s] and the metrics.
        """
        requested = pd.DataFrame(
            [(place, job.key, seed) for place, job in enumerate(jobs) for seed in job.draws],
            columns=["place", KEY, "seed"],
        )
        tables, _ = self._tables({job.key for job in jobs}, [KEY, *OUTCOMES, "cell.created", *metrics])
        stored = pd.DataFrame()
        if tables:
            stored = frame(unique_rows(tables), [KEY, *OUTCOMES, *metrics]).rename(columns=OUTCOMES)
        stored = stored.reindex(columns=[KEY, *OUTCOMES.values(), *metrics]).astype({"run_s": float})
        return requested.merge(stored, on=[KEY, "seed"], how="left").drop(columns=KEY)

    def keys_from(self, prefix: str) -> list[str]:
        """Return the keys with a prefix: complete and incomplete jobs, and the names of damaged files."""
        tables, damaged = self._tables(None, [KEY])
        keys = {*damaged, *(key for table in tables for key in pc.unique(table[KEY]).to_pylist())}
        return sorted(key for key in keys if key.startswith(prefix))

    def compact(self, least: int = 2) -> None:
        """Join the small files into one if there are at least ``least`` of them, without rows that exist twice.

        Another process may do the same: a reader may find rows twice, but never misses one.
        """
        small = [name for name, table in self._load_all([KEY]).items() if table and len(table) < SMALL_ROWS]
        if len(small) < max(least, 2):
            return
        tables: dict[str, pa.Table] = {}
        for name in small:
            with suppress(FileNotFoundError):  # another process has just joined it
                if table := self.load(name):
                    tables[name] = table
        if len(tables) > 1:
            self._write(unique_rows(list(tables.values())))
            for name in tables:
                with suppress(PermissionError):  # on Windows another process reads it
                    self._path(name).unlink(missing_ok=True)

    def _tables(
        self, keys: Collection[str] | None, columns: list[str] | None = None
    ) -> tuple[list[pa.Table], list[str]]:
        """Return the rows of ``keys`` in each file, and the names of the damaged files."""
        loaded = self._load_all(columns)
        tables = [table for table in loaded.values() if table is not None]
        if keys is not None:
            wanted = pa.array(list(keys), pa.string())
            tables = [table.filter(pc.is_in(table[KEY].cast(pa.string()), wanted)) for table in tables]
        return [table for table in tables if len(table)], [name for name, table in loaded.items() if table is None]

    def _load_all(self, columns: list[str] | None = None) -> dict[str, pa.Table | None]:
        """Load every file, also those that appear meanwhile because another process compacts the study."""
        loaded: dict[str, pa.Table | None] = {}
        while new := [name for name in self._names() if name not in loaded]:
            for name in new:
                with suppress(FileNotFoundError):
                    loaded[name] = self.load(name, columns)
        return loaded

    def _names(self) -> list[str]:
        return sorted(path.stem for path in self.folder.glob("*.parquet") if not path.name.startswith("."))

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.parquet"

    def load(self, name: str, columns: list[str] | None = None) -> pa.Table | None:
        """Load a file, or some of its columns. None: the file is damaged.

        Raises:
            FileNotFoundError: the file does not exist any more.
        """
        path, match = self._path(name), PART_NAME.fullmatch(name)
        if not match or (exists(path) and not path.is_file()):  # reading a pipe would never end
            return None
        try:
            return part_of(path.read_bytes(), match[1], columns)
        except PermissionError as error:
            raise JerkbenchError(f"{path} cannot be read: {error.strerror}.") from error

    def _write(self, table: pa.Table) -> None:
        content = content_of(table)

        def write(partial: Path) -> None:
            with partial.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # `compact` deletes the files that it replaces

        write_atomically(self._path(part_name(content)), write)
