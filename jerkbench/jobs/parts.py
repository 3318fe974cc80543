"""The files of a store: Parquet with runs of many cells, the digest in the name; and the cells that they make."""

import hashlib
import io
import json
import re
import socket
import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain, pairwise, repeat, starmap
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.evaluated_run import DRAWN, RUN_COLUMNS
from jerkbench.jobs.labels import Labels
from jerkbench.jobs.rows import Row
from jerkbench.renamed import new_label

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

HEAD_COLUMNS = (*Labels._fields, *RUN_COLUMNS)
"""The columns that every row has, before its metrics."""

SPEC = ("dataset", "disturbance", "attitude", "filter", "adaptation", "engine", "metrics")
ABOUT = ("protocol", "data", "notes", "code", "versions", "commit", "created", "seconds")
REQUIRED_COLUMNS = {
    *(*HEAD_COLUMNS, KEY, RUNS, COLUMNS),
    *(f"{CELL}{name}" for name in (*ABOUT, *(f"spec.{part}" for part in SPEC))),
}
"""The columns of every part; a file that lacks one is damaged."""


class RowBlock(NamedTuple):
    """Runs of a job that are stored together.

    Attributes:
        key: of the job.
        runs: how many it has in all.
        rows: one for each of these runs, as in `Result`.
        metadata: of the job: labels, specification, protocol, data, notes and times.
    """

    key: str
    runs: int
    rows: Sequence[Row]
    metadata: Mapping[str, Any]


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
    rows = list(chain.from_iterable(block.rows for block in blocks))
    names = dict.fromkeys([*HEAD_COLUMNS, *chain.from_iterable(rows)])
    names.pop(DRAWN, None)
    columns = {name: _values(name, [row.get(name) for row in rows]) for name in names} | _drawn(rows)
    if strange := [name for name in columns if str(name).startswith(CELL)]:
        raise JerkbenchError(f"A metric cannot be called {strange[0]}: names that begin with {CELL} are taken.")
    shared: dict[int, str] = {}
    known = [_facts(block, shared) for block in blocks]
    places = np.repeat(np.arange(len(blocks)), [len(block.rows) for block in blocks])
    told = dict.fromkeys(chain(*known))
    facts = {KEY: [block.key for block in blocks]} | {name: [own.get(name) for own in known] for name in told}
    texts = {name: pa.array(own, pa.string()).dictionary_encode().take(pa.array(places)) for name, own in facts.items()}
    runs = pa.array([block.runs for block in blocks], pa.int32()).take(pa.array(places))
    table = pa.table({**columns, RUNS: runs, **texts})
    if not _is_part(table.schema):
        keys = ", ".join(block.key for block in blocks[:3])
        raise JerkbenchError(f"The rows of the cells {keys} cannot be stored: a metric is no number, or has no name.")
    return table


@lru_cache(maxsize=65_536)
def parsed(text: str) -> Any:  # noqa: ANN401 - any JSON
    """Return what a JSON text says; it is shared by all who ask, and not to be changed."""
    return json.loads(text)


def _is_part(schema: pa.Schema) -> bool:
    """Whether every column is there, and each metric is a number."""
    kinds = [field.type for field in schema if field.name not in HEAD_COLUMNS and not field.name.startswith(CELL)]
    numeric = all(any(is_kind(kind) for is_kind in NUMERIC) for kind in kinds)
    return numeric and set(schema.names) >= REQUIRED_COLUMNS


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


def _drawn(rows: Sequence[Row]) -> dict[str, pa.Array]:
    """The columns of what drives drew: found once a drive, whose runs share it."""
    drives = {id(own): own for row in rows if (own := row.get(DRAWN))}
    place = {key: k for k, key in enumerate(drives)}
    places = pa.array([place.get(id(row.get(DRAWN))) for row in rows], pa.int32())
    names = dict.fromkeys(chain.from_iterable(drives.values()))
    return {name: _values(name, [own.get(name) for own in drives.values()]).take(places) for name in names}


def _facts(block: RowBlock, shared: dict[int, str]) -> dict[str, str]:
    """All that is known of a cell, each entry as JSON, by the name of its column.

    ``shared`` has those of objects that cells share, which live longer than it.
    """
    kinds = dict.fromkeys(map(tuple, chain(block.rows, (row.get(DRAWN, ()) for row in block.rows))))
    own = [name for name in dict.fromkeys(chain.from_iterable(kinds)) if name not in (*HEAD_COLUMNS, DRAWN)]
    entries = {name: value for name, value in block.metadata.items() if name not in NOT_FACTS}
    entries |= {f"spec.{part}": value for part, value in block.metadata.get("spec", {}).items()}
    texts = {name: shared.get(id(of)) or shared.setdefault(id(of), json.dumps(of)) for name, of in entries.items()}
    return {CELL + name: text for name, text in {"columns": json.dumps(own), **texts}.items()}


# The cells that are in some parts.

OF_BLOCKS = ("cell.notes", "cell.seconds", "cell.created")
"""What differs from block to block of a cell."""

Stretches = Sequence[Sequence[int]]
"""Seeds that follow each other: the first, and how many."""
ShownSeeds = Mapping[str, Stretches]
"""The seeds that are shown, by the keys of their cells."""


@dataclass(frozen=True, eq=False)
class Stored:
    """A cell as it was found.

    Attributes:
        key: its name in the store.
        metadata: its specification, protocol, data, notes and times.
        whole: a table with its runs, by seed, and with those of others.
        runs: where they are.
        columns: its metrics, in its own order.
        others: how many runs it has besides, of other seeds.
    """

    key: str
    metadata: Mapping[str, Any]
    whole: pa.Table
    runs: range
    columns: Sequence[str]
    others: int = 0

    @cached_property
    def rows(self) -> pd.DataFrame:
        """One row a seed."""
        return frame(self.whole.slice(self.runs.start, len(self.runs)), (*HEAD_COLUMNS, *self.columns))


def frame(table: pa.Table, names: Iterable[str]) -> pd.DataFrame:
    """Return those of some columns that are there, for pandas, whatever the file says of its types."""
    chosen = table.select([name for name in dict.fromkeys(names) if name in table.column_names])
    texts = {field.name: pa.string() for field in chosen.schema if pa.types.is_dictionary(field.type)}
    rows: pd.DataFrame = _with_types(chosen, texts).to_pandas(use_threads=False, ignore_metadata=True)
    return rows


def cells_of(tables: Sequence[pa.Table], shown: ShownSeeds) -> list[Stored]:
    """Return the cells of parts that are whole, each run once.

    Args:
        tables: the parts; at least one.
        shown: the seeds of each cell that are to be there; one that is not named is whole with as many as it says.
    """
    table = concatenated(tables)
    table = table.take(pa.array(ordered_runs(table)))
    edges = _edges(table)
    keys = table[KEY].take(pa.array(edges[:-1])).to_pylist()
    runs, seeds = (np.split(table[name].to_numpy(), edges[1:-1]) for name in (RUNS, "seed"))
    masks = [_shown(of_cell, own, shown.get(key)) for key, of_cell, own in zip(keys, runs, seeds, strict=True)]
    others = [int(np.sum(~mask)) for mask in masks if mask.any()]
    table = table.filter(pa.array(np.concatenate(masks)))
    edges = _edges(table)
    first = table.take(pa.array(edges[:-1]))
    columns = [parsed(text) for text in first[COLUMNS].to_pylist()]
    own = list(starmap(range, pairwise(edges.tolist())))
    metadata = _metadata(first)
    for place in _differing(table, edges, [*OF_BLOCKS, *({PROCESSOR} & {*table.column_names})]):
        metadata[place] |= _of_blocks(table.slice(own[place].start, len(own[place])))
    for place in _differing(table, edges, [COLUMNS]):  # drives draw different numbers
        texts = pc.unique(table[COLUMNS].slice(own[place].start, len(own[place]))).to_pylist()
        columns[place] = list(dict.fromkeys(chain.from_iterable(map(parsed, texts))))
    return list(map(Stored, first[KEY].to_pylist(), metadata, repeat(table), own, columns, others))


def concatenated(tables: Sequence[pa.Table]) -> pa.Table:
    """Join tables; a metric that is whole in some of them and not in others is a floating point number."""
    types: dict[str, set[pa.DataType]] = {}
    for field in chain.from_iterable(table.schema for table in tables):
        types.setdefault(field.name, set()).add(field.type)
    floats = {name: pa.float64() for name, kinds in types.items() if len(kinds - {pa.null()}) > 1}
    alike = [_with_types(table, floats) for table in tables] if floats else tables
    return pa.concat_tables(alike, promote_options="default").unify_dictionaries().combine_chunks()


def _with_types(table: pa.Table, types: Mapping[str, pa.DataType]) -> pa.Table:
    """The table with other types of some columns."""
    return table.cast(pa.schema([f.with_type(types.get(f.name, f.type)) for f in table.schema]), safe=False)


def ordered_runs(table: pa.Table) -> IntArray:
    """Return which rows to keep, by cell and seed: of a run that is there more often the newest that did not fail."""
    cells, seeds = codes_of(table[KEY]), table["seed"].to_numpy()
    failed = pc.equal(table["status"].cast(pa.string()), "failed").to_numpy()
    created = table["cell.created"].combine_chunks().dictionary_encode()
    age = -np.argsort(np.argsort(np.array(created.dictionary.to_pylist(), dtype=object)))[created.indices.to_numpy()]
    order = np.lexsort((age, failed, seeds, cells))
    fresh = np.ones(len(order), bool)
    fresh[1:] = (np.diff(cells[order]) != 0) | (np.diff(seeds[order]) != 0)
    return np.asarray(order[fresh])


def codes_of(column: pa.ChunkedArray) -> IntArray:
    """Return the codes of a column of texts."""
    return np.asarray(column.combine_chunks().dictionary_encode().indices, np.int64)


def _edges(table: pa.Table) -> IntArray:
    """The first row of each cell, and the number of rows."""
    return np.append(np.flatnonzero(np.diff(codes_of(table[KEY]), prepend=-1)), table.num_rows)


def _shown(runs: IntArray, seeds: IntArray, stretches: Stretches | None) -> BoolArray:
    """Which runs of a cell are shown; none where one is missing."""
    if stretches is None:
        return np.full(len(seeds), len(seeds) >= runs.min())
    mask = np.zeros(len(seeds), bool)
    for first, count in stretches:
        mask |= (seeds >= first) & (seeds < first + count)
    return mask if mask.sum() == sum(count for _, count in stretches) else np.zeros(len(seeds), bool)


def _metadata(first: pa.Table) -> list[dict[str, Any]]:
    """The metadata of cells from a row of each; parts of equal text are one object."""
    columns = {name: first[name].to_pylist() for name in Labels._fields}
    labels = zip(*([new_label(kind, label) for label in own] for kind, own in columns.items()), strict=True)
    cells: list[dict[str, Any]] = [
        {"labels": dict(zip(Labels._fields, own, strict=True)), "spec": {}} for own in labels
    ]
    for name in first.column_names:
        if name.startswith(CELL) and name not in (KEY, RUNS, COLUMNS):
            kind, _, part = name.removeprefix(CELL).partition(".")
            for cell, value in zip(cells, _decoded(first[name]), strict=True):
                if value is not None:
                    (cell["spec"] if part else cell)[part or kind] = value
    return cells


def _decoded(column: pa.ChunkedArray) -> list[Any]:
    return [None if text is None else parsed(text) for text in column.to_pylist()]


def _differing(table: pa.Table, edges: IntArray, names: Sequence[str]) -> list[int]:
    """The cells whose rows differ in some columns, because they were not stored together."""
    changes = np.zeros(table.num_rows, bool)
    for name in names:
        changes[1:] |= np.diff(codes_of(table[name])) != 0
    changes[edges[:-1]] = False
    return sorted(set((np.searchsorted(edges, np.flatnonzero(changes), side="right") - 1).tolist()))


def _of_blocks(rows: pa.Table) -> dict[str, Any]:
    """The notes of all blocks of a cell, their time, and when the last was stored."""
    blocks = dict.fromkeys(zip(*(rows[name].to_pylist() for name in OF_BLOCKS), strict=True))
    notes, seconds, created = zip(*([parsed(text) for text in block] for block in blocks), strict=True)
    kinds = set(_decoded(rows[PROCESSOR])) if PROCESSOR in rows.column_names else set()
    return {
        "processor": " and ".join(sorted(filter(None, kinds))),
        "notes": list(dict.fromkeys(note for of in notes for note in of)),
        "seconds": sum(seconds),
        "created": max(created),
    }
