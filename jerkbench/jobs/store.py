"""The store of a study: Parquet files with the result rows, which are written atomically and found by job key.

A row contains the labels, the seed, the status and the metrics of one run. Columns with the prefix ``cell.`` contain
the metadata of a job as JSON. Every process writes separate files. If several files contain the same run, only one row
of this run is read.
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
from jerkbench.errors import JerkbenchError, notify, plain
from jerkbench.evaluation.evaluated_run import RUN_COLUMNS
from jerkbench.files import write_atomically
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import ShownSeeds, Stretches, read_manifest
from jerkbench.jobs.rows import Row
from jerkbench.renamed import new_label
from jerkbench.report.labels import Labels

PART_NAME = re.compile(r"part-[A-Za-z0-9_]+-[0-9a-f]{32}-([0-9a-f]{32})")
"""Name of a file: the host, a unique number, and the hash of the content, with which damage is detected."""

CELL = "cell."
"""Prefix of the columns with the metadata of a job."""

KEY, RUNS, COLUMNS = "cell.key", "cell.runs", "cell.columns"
"""Columns with the key of the job, the number of runs of the job, and the names of the metrics."""

HEAD_COLUMNS = (*Labels._fields, *RUN_COLUMNS)
"""The columns that every row has before its metrics."""

SPEC = ("dataset", "disturbance", "attitude", "filter", "adaptation", "engine", "metrics")
ABOUT = ("protocol", "data", "notes", "code", "versions", "commit", "created", "seconds")
REQUIRED_COLUMNS = {
    *(*HEAD_COLUMNS, KEY, RUNS, COLUMNS),
    *(f"{CELL}{name}" for name in (*ABOUT, *(f"spec.{part}" for part in SPEC))),
}
"""The columns that every file must have. A file that lacks one of them counts as damaged."""

SEEN_COLUMNS = [KEY, "seed", "status"]
"""The columns that identify the stored runs."""

OUTCOMES = {"seed": "seed", "status": "status", "reason": "reason", f"{CELL}run_s": "run_s"}
"""Columns that `Store.rows` returns in addition to the metrics. Keys are the names in a file, values the new names."""

DAMAGED_PARQUET = (
    *(OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError),
    pa.ArrowException,
)
"""Exceptions that pyarrow raises for a damaged file."""

ABANDONED_S = 3600.0
"""Age after which a partly written file is deleted [s]."""

SMALL_ROWS = 10_000
"""Files with fewer rows than this are joined by `Store.compact`."""


class RowBlock(NamedTuple):
    """Some or all runs of a job, which are stored together.

    Attributes:
        key: Key of the job.
        runs: Number of runs of the complete job, which may be more than the rows in this block.
        rows: The rows of the runs in this block.
        metadata: Labels, configuration, protocol, hash of the data, notes, and times of the job.
    """

    key: str
    runs: int
    rows: Sequence[Row]
    metadata: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Stored:
    """The stored runs of one job, with the metadata of the job.

    Attributes:
        key: Key of the job.
        metadata: Labels, configuration, protocol, hash of the data, notes, and times of the job.
        table: The rows of the job with all stored columns, ordered by seed.
        columns: Names of the metrics.
        others: Number of further stored runs, whose seeds are not shown in tables.
    """

    key: str
    metadata: Mapping[str, Any]
    table: pa.Table
    columns: Sequence[str]
    others: int = 0

    @cached_property
    def rows(self) -> pd.DataFrame:
        """The runs as a data frame, with one row for each seed."""
        return frame(self.table, (*HEAD_COLUMNS, *self.columns))


def table_of(blocks: Sequence[RowBlock]) -> pa.Table:
    """Return a table with the rows and the metadata of all ``blocks``.

    Raises:
        JerkbenchError: A value of a metric is not a number, or the name of a metric is reserved.
    """
    rows = list(chain.from_iterable(block.rows for block in blocks))
    names = dict.fromkeys([*HEAD_COLUMNS, *chain.from_iterable(rows)])
    if reserved := [name for name in names if str(name).startswith(CELL)]:
        raise JerkbenchError(f"A metric cannot be called {reserved[0]}: names that begin with {CELL} are reserved.")
    columns = {name: _column(name, [row.get(name) for row in rows]) for name in names}
    facts = [_facts(block) for block in blocks]
    block_of_row = pa.array(np.repeat(np.arange(len(blocks)), [len(block.rows) for block in blocks]))
    for name in dict.fromkeys(chain.from_iterable(facts)):
        texts = pa.array([texts_by_column.get(name) for texts_by_column in facts], pa.string())
        columns[name] = texts.dictionary_encode().take(block_of_row)
    columns[RUNS] = pa.array([block.runs for block in blocks], pa.int32()).take(block_of_row)
    table = pa.table(columns)
    if not _is_part(table.schema):
        keys = ", ".join(block.key for block in blocks[:3])
        raise JerkbenchError(f"The rows of {keys} cannot be stored: a metric is not a number or has no name.")
    return table


def _column(name: str, values: list[Any]) -> pa.Array:
    try:
        array = pa.array(values)
    except (pa.ArrowInvalid, pa.ArrowTypeError):  # the values have several types
        try:
            array = pa.array([None if value is None else float(value) for value in values])
        except (TypeError, ValueError) as error:
            raise JerkbenchError(f"The metric {name} cannot be stored: {error}.") from error
    return array.dictionary_encode() if pa.types.is_string(array.type) else array


def _facts(block: RowBlock) -> dict[str, str]:
    """Return the metadata of a block as {name of the column: JSON text}."""
    metrics = [name for name in dict.fromkeys(chain.from_iterable(block.rows)) if name not in HEAD_COLUMNS]
    entries = {name: value for name, value in block.metadata.items() if name not in ("labels", "spec")}
    entries |= {f"spec.{part}": value for part, value in block.metadata.get("spec", {}).items()}
    texts = {CELL + name: json.dumps(entry) for name, entry in {"columns": metrics, **entries}.items()}
    return {KEY: block.key, **texts}


def _is_part(schema: pa.Schema) -> bool:
    """Return whether a table has all required columns, and all its metrics are numeric."""
    types = pa.types
    metrics = [field.type for field in schema if field.name not in HEAD_COLUMNS and not field.name.startswith(CELL)]
    numeric = (types.is_floating, types.is_integer, types.is_boolean, types.is_null)
    return set(schema.names) >= REQUIRED_COLUMNS and all(any(is_kind(one) for is_kind in numeric) for one in metrics)


def content_of(table: pa.Table) -> bytes:
    """Return a table as the bytes of a Parquet file."""
    sink = io.BytesIO()
    texts = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
    pq.write_table(table, sink, compression="zstd", use_dictionary=texts, write_statistics=False)
    return sink.getvalue()


def content_digest(content: bytes) -> str:
    """Return the hash of the content of a file. The name of the file contains this hash."""
    return hashlib.sha256(content).hexdigest()[:32]


def part_name(content: bytes) -> str:
    """Return a new, unique file name that contains the hash of ``content``."""
    host = re.sub("[^A-Za-z0-9_]", "_", socket.gethostname())[:40] or "_"
    return f"part-{host}-{uuid.uuid4().hex}-{content_digest(content)}"


Names = list[str]


@lru_cache(maxsize=65_536)
def parsed(text: str) -> Any:  # noqa: ANN401 - any JSON
    """Return the value of a JSON text. The caller must not modify the value, because it is cached for later calls."""
    return json.loads(text)


def frame(table: pa.Table, names: Iterable[str]) -> pd.DataFrame:
    """Return the given columns as a data frame. Names of columns that do not exist are ignored."""
    selected = table.select([name for name in dict.fromkeys(names) if name in table.column_names]).combine_chunks()
    texts = {field.name: pa.string() for field in selected.schema if pa.types.is_dictionary(field.type)}
    rows: pd.DataFrame = _with_types(selected, texts).to_pandas(use_threads=False, ignore_metadata=True)
    return rows


def _with_types(table: pa.Table, types: Mapping[str, pa.DataType]) -> pa.Table:
    return table.cast(pa.schema([f.with_type(types.get(f.name, f.type)) for f in table.schema]), safe=False)


def unique_rows(tables: Sequence[pa.Table]) -> pa.Table:
    """Join tables, remove duplicate runs, and sort the rows by job and seed.

    If a job has several runs with the same seed, the newest run that did not fail remains.
    """
    table = concatenated(tables)
    runs = frame(table, [*SEEN_COLUMNS, "cell.created"])
    runs["failed"] = runs["status"] == "failed"
    order = runs.sort_values([KEY, "seed", "failed", "cell.created"], ascending=[True, True, True, False])
    return table.take(pa.array(order.drop_duplicates([KEY, "seed"]).index))


def concatenated(tables: Sequence[pa.Table]) -> pa.Table:
    """Join tables. A metric whose type differs between the tables is converted to floating point numbers."""
    types: dict[str, set[pa.DataType]] = {}
    for field in chain.from_iterable(table.schema for table in tables):
        types.setdefault(field.name, set()).add(field.type)
    floats = {name: pa.float64() for name, kinds in types.items() if len(kinds - {pa.null()}) > 1}
    converted = [_with_types(table, floats) for table in tables] if floats else tables
    return pa.concat_tables(converted, promote_options="default").unify_dictionaries().combine_chunks()


def stored_jobs(tables: Sequence[pa.Table], shown: ShownSeeds) -> list[Stored]:
    """Return the stored runs of each job that is complete in the given tables.

    Args:
        tables: One or more tables with stored rows.
        shown: The blocks of seeds that each job must have, by the key of the job. A job without an entry in ``shown``
            is complete if all its runs are stored.
    """
    table = unique_rows(tables)
    keys, seeds, runs = (table[name].to_numpy() for name in (KEY, "seed", RUNS))
    mask, others = np.zeros(len(keys), bool), dict[str, int]()
    for key, positions in _positions(keys).items():
        mask[positions] = _shown(seeds[positions], runs[positions], shown.get(key))
        others[key] = int(np.sum(~mask[positions]))
    table = table.filter(pa.array(mask))
    metadata = [name for name in table.column_names if name in Labels._fields or name.startswith(CELL)]
    blocks: dict[str, list[dict[str, Any]]] = {}
    for block in frame(table, metadata).drop_duplicates().to_dict("records"):
        blocks.setdefault(block[KEY], []).append({str(name): text for name, text in block.items()})
    return [
        Stored(
            key,
            _metadata(blocks[key]),
            table.slice(positions[0], len(positions)),
            list(dict.fromkeys(chain.from_iterable(parsed(block[COLUMNS]) for block in blocks[key]))),
            others[key],
        )
        for key, positions in _positions(keys[mask]).items()
    ]


def _positions(keys: Any) -> dict[str, Any]:  # noqa: ANN401 - an array of texts
    """Return the row numbers at which each key occurs."""
    return {str(key): places for key, places in pd.Series(keys).groupby(keys, sort=False).indices.items()}


def _shown(seeds: IntArray, runs: IntArray, stretches: Stretches | None) -> BoolArray:
    """Return a mask that selects the runs of a job for tables. If a required run is missing, no run is selected."""
    if stretches is None:
        return np.full(len(seeds), len(seeds) >= runs.min())
    mask = np.zeros(len(seeds), bool)
    for first, count in stretches:
        mask |= (seeds >= first) & (seeds < first + count)
    if mask.sum() != sum(count for _, count in stretches):
        mask[:] = False
    return mask


def _metadata(blocks: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Merge the metadata of all stored blocks of one job."""
    first = blocks[0]
    metadata: dict[str, Any] = {"labels": {kind: new_label(kind, first[kind]) for kind in Labels._fields}, "spec": {}}
    for name, text in first.items():
        kind, _, part = name.removeprefix(CELL).partition(".")
        if name.startswith(CELL) and name not in (KEY, RUNS, COLUMNS) and isinstance(text, str):
            (metadata["spec"] if part else metadata)[part or kind] = parsed(text)
    if len(blocks) > 1:
        joined = ("notes", "seconds", "created")
        notes, seconds, created = ([parsed(block[CELL + name]) for block in blocks] for name in joined)
        processors = {parsed(text) for block in blocks if isinstance(text := block.get("cell.processor"), str)}
        metadata |= {"notes": list(dict.fromkeys(chain(*notes))), "seconds": sum(seconds), "created": max(created)}
        metadata["processor"] = " and ".join(sorted(filter(None, processors)))
    return metadata


class Store:
    """The folder of a study that contains the result rows of its jobs."""

    def __init__(self, folder: Path) -> None:
        """Open the store of a study.

        ``folder`` is the folder of the study, or a folder that contains its Parquet files.
        """
        below = folder / "cells"
        self.folder = folder if not below.is_dir() and any(folder.glob("*.parquet")) else below

    def prepare(self) -> list[str]:
        """Create the folder, delete abandoned files, rename damaged files, and return the names of the damaged files.

        Raises:
            JerkbenchError: Files cannot be written to the folder.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=self.folder):
                pass
            for partial in self.folder.rglob(".*.partial*"):
                with suppress(FileNotFoundError):  # another process has just finished and renamed the file
                    if time.time() - partial.stat().st_mtime > ABANDONED_S:
                        partial.unlink()
        except OSError as error:
            raise JerkbenchError(f"Results cannot be written to {self.folder}: {error.strerror or error}.") from error
        damaged = [name for name, table in self._load_all(SEEN_COLUMNS).items() if table is None]
        for path in map(self._path, damaged):
            with suppress(FileNotFoundError):  # another process has just renamed the file
                path.rename(path.with_name(f"{path.name}.damaged"))
        if damaged:
            from jerkbench.report.summary import damaged_files

            names = ", ".join(map(plain, damaged))
            notify(f"{damaged_files(damaged)} renamed to *.damaged: {names}. The missing runs are computed again.")
        return damaged

    def known(self, keys: Collection[str], *, failed: bool = False) -> dict[str, set[int]]:
        """Return the seeds of the stored runs of each job, by its key.

        Failed runs are included only if ``failed`` is set.
        """
        known: dict[str, set[int]] = {}
        for table in self._tables(keys, SEEN_COLUMNS)[0]:
            for key, seed, status in zip(*(table[name].to_pylist() for name in SEEN_COLUMNS), strict=True):
                if failed or status != "failed":
                    known.setdefault(key, set()).add(seed)
        return known

    def read(self, keys: Iterable[str] | None = None, shown: ShownSeeds | None = None) -> tuple[list[Stored], Names]:
        """Return the complete jobs among ``keys``, in the order of ``keys``, and the names of damaged files.

        Args:
            keys: The keys of the jobs to read (by default, all keys in the store, sorted).
            shown: The blocks of seeds that each job must have (by default, the seeds in the manifest).
        """
        wanted = None if keys is None else dict.fromkeys(keys)
        tables, damaged = self._tables(wanted)
        if shown is None:
            shown = read_manifest(self.folder.parent).get("seeds", {}) if tables else {}
        stored = {one.key: one for one in (stored_jobs(tables, shown) if tables else ())}
        return [stored[key] for key in (sorted(stored) if wanted is None else wanted) if key in stored], damaged

    def rows(self, jobs: Sequence[Job], metrics: Sequence[str]) -> pd.DataFrame:
        """Return the runs of some jobs, ordered by job and seed.

        The status of a run that is not stored is missing (NaN).

        Args:
            jobs: The jobs, each with its requested seeds.
            metrics: Names of the requested metric columns.

        Returns:
            A table with the columns ``job_index`` (index of the job in ``jobs``), ``seed``, ``status``, ``reason``,
            ``run_s`` (duration of the run [s]) and the columns ``metrics``.
        """
        runs = [(position, job.key, seed) for position, job in enumerate(jobs) for seed in job.draws]
        requested = pd.DataFrame(runs, columns=["job_index", KEY, "seed"])
        tables, _ = self._tables({job.key for job in jobs}, [KEY, *OUTCOMES, "cell.created", *metrics])
        stored = pd.DataFrame()
        if tables:
            stored = frame(unique_rows(tables), [KEY, *OUTCOMES, *metrics]).rename(columns=OUTCOMES)
        stored = stored.reindex(columns=[KEY, *OUTCOMES.values(), *metrics]).astype({"run_s": float})
        return requested.merge(stored, on=[KEY, "seed"], how="left").drop(columns=KEY)

    def compact(self, least: int = 2) -> None:
        """If there are at least ``least`` small files, join them into one file without duplicate rows.

        Several processes may join files at the same time. While files are joined, a reader may find duplicate rows, but
        no row is missing.
        """
        small = [name for name, table in self._load_all([KEY]).items() if table and len(table) < SMALL_ROWS]
        if len(small) < max(least, 2):
            return
        tables: dict[str, pa.Table] = {}
        for name in small:
            with suppress(FileNotFoundError):  # another process has just joined the file
                if table := self.load(name):
                    tables[name] = table
        if len(tables) > 1:
            self.write([unique_rows(list(tables.values()))])
            for name in tables:
                with suppress(PermissionError):  # on Windows, a file that another process reads cannot be deleted
                    self._path(name).unlink(missing_ok=True)

    def _tables(self, keys: Collection[str] | None, columns: Names | None = None) -> tuple[list[pa.Table], Names]:
        """Return one table for each file with the rows of ``keys``, and the names of damaged files."""
        loaded = self._load_all(columns)
        tables = [table for table in loaded.values() if table is not None]
        if keys is not None:
            wanted = pa.array(list(keys), pa.string())
            tables = [table.filter(pc.is_in(table[KEY].cast(pa.string()), wanted)) for table in tables]
        return [table for table in tables if len(table)], [name for name, table in loaded.items() if table is None]

    def _load_all(self, columns: list[str] | None = None) -> dict[str, pa.Table | None]:
        """Load every file, also files that another process creates during loading because it joins files."""
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
        """Return the table in a file, or some of its columns. Return None if the file is damaged.

        Raises:
            FileNotFoundError: The file does not exist, for example because another process has joined files.
        """
        path, match = self._path(name), PART_NAME.fullmatch(name)
        if not match or ((path.is_symlink() or path.exists()) and not path.is_file()):  # reading a pipe would never end
            return None
        try:
            content = path.read_bytes()
        except PermissionError as error:
            raise JerkbenchError(f"{path} cannot be read: {error.strerror}.") from error
        if content_digest(content) != match[1]:
            return None
        try:
            # `read_table` is not used, because its threads may free the content after the interpreter has ended.
            file = pq.ParquetFile(pa.BufferReader(content))
            return file.read(columns=columns, use_threads=False) if _is_part(file.schema_arrow) else None
        except DAMAGED_PARQUET:
            return None

    def write(self, tables: Sequence[pa.Table]) -> None:
        """Write the tables, which `table_of` returned, to one new file."""
        content = content_of(concatenated(tables))

        def write(partial: Path) -> None:
            with partial.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # the data must be on disk before `compact` deletes the files that it replaces

        write_atomically(self._path(part_name(content)), write)
