"""The content of a store: the runs of all its whole cells in one table, and what is known of each cell."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.jobs.labels import Labels
from jerkbench.renamed import new_label
from jerkbench.results.parts import CELL, COLUMNS, HEAD_COLUMNS, KEY, PROCESSOR, RUNS, parsed

OF_BLOCKS = ("cell.notes", "cell.seconds", "cell.created")
"""What differs from block to block of a cell."""

Stretches = Sequence[Sequence[int]]
"""Seeds that follow each other: the first, and how many."""
ShownSeeds = Mapping[str, Stretches]
"""The seeds that are shown, by the keys of their cells."""


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
    metadata: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Content:
    """Cells, and their runs in one table.

    Attributes:
        table: the runs of one cell after those of the other, by seed.
        keys: of the cells.
        starts: the first row of each, and the number of rows.
        metadata: of each.
        columns: the metrics of each, in its own order.
        others: how many runs there are besides, of these cells and other seeds.
    """

    table: pa.Table
    keys: list[str]
    starts: IntArray
    metadata: list[dict[str, Any]]
    columns: list[list[str]]
    others: int

    def rows_of(self, place: int) -> pa.Table:
        """Return the rows of one cell."""
        begin, end = self.starts[place : place + 2]
        return self.table.slice(begin, end - begin)

    def stored(self) -> Iterator[Stored]:
        """Yield every cell with its rows."""
        for place, key in enumerate(self.keys):
            rows = frame(self.rows_of(place), [*HEAD_COLUMNS, *self.columns[place]])
            yield Stored(key, rows, self.metadata[place])

    def rows_in_order(self, places: Sequence[int]) -> pa.Table:
        """Return the rows of some cells, in this order."""
        ranges = [np.arange(self.starts[place], self.starts[place + 1]) for place in places]
        return self.table.take(pa.array(np.concatenate(ranges)))


def content_of_tables(tables: Sequence[pa.Table], shown: ShownSeeds) -> Content:
    """Join parts: of a run that was stored more than once one that did not fail, the newest; cells that are whole.

    Args:
        tables: the parts; at least one.
        shown: the seeds of each cell that are to be there; one that is not named is whole with as many as it says.
    """
    table = concatenated(tables)
    codes, order = ordered_runs(table)
    keys, runs, seeds = (table[name].take(pa.array(order)) for name in (KEY, RUNS, "seed"))
    starts = np.append(np.flatnonzero(np.diff(codes[order], prepend=-1)), len(order))
    names = keys.take(pa.array(starts[:-1])).to_pylist()
    cells = zip(names, *(np.split(column.to_numpy(), starts[1:-1]) for column in (runs, seeds)), strict=True)
    masks = [_shown(of_cell, own, shown.get(key)) for key, of_cell, own in cells]
    counts = np.array([mask.sum() for mask in masks], np.int64)
    whole = counts > 0
    table = table.take(pa.array(order[np.concatenate(masks)]))
    starts, others = np.append(0, np.cumsum(counts[whole])), int((np.diff(starts) - counts)[whole].sum())
    first = table.take(pa.array(starts[:-1]))
    metadata = _metadata(first)
    for place in _in_blocks(table, starts):
        metadata[place] |= _of_blocks(table.slice(starts[place], starts[place + 1] - starts[place]))
    return Content(table, first[KEY].to_pylist(), starts, metadata, _metrics(first), others)


def _shown(runs: IntArray, seeds: IntArray, stretches: Stretches | None) -> BoolArray:
    """Which runs of a cell are shown; none where one is missing."""
    if stretches is None:
        return np.full(len(seeds), len(seeds) >= runs.min())
    mask = np.zeros(len(seeds), bool)
    for first, count in stretches:
        mask |= (seeds >= first) & (seeds < first + count)
    return mask if mask.sum() == sum(count for _, count in stretches) else np.zeros(len(seeds), bool)


def concatenated(tables: Sequence[pa.Table]) -> pa.Table:
    """Join tables; a metric that is whole in some of them and not in others is a floating point number."""
    types: dict[str, set[pa.DataType]] = {}
    for field in chain.from_iterable(table.schema for table in tables):
        types.setdefault(field.name, set()).add(field.type)
    floats = {name: pa.float64() for name, kinds in types.items() if len(kinds - {pa.null()}) > 1}
    alike = [table.cast(_with_types(table.schema, floats), safe=False) for table in tables]
    return pa.concat_tables(alike, promote_options="default").unify_dictionaries().combine_chunks()


def _with_types(schema: pa.Schema, types: Mapping[str, pa.DataType]) -> pa.Schema:
    """The schema with other types of some columns."""
    return pa.schema([field.with_type(types.get(field.name, field.type)) for field in schema])


def ordered_runs(table: pa.Table) -> tuple[IntArray, IntArray]:
    """Return the code of each row's cell, and the rows to keep, ordered by cell and seed."""
    codes, seeds = codes_of(table[KEY]), table["seed"].to_numpy()
    failed = pc.equal(table["status"].cast(pa.string()), "failed").to_numpy()
    newest_first = -_ranks(table["cell.created"])
    order = np.lexsort((newest_first, failed, seeds, codes))
    fresh = np.ones(len(order), bool)
    fresh[1:] = (np.diff(codes[order]) != 0) | (np.diff(seeds[order]) != 0)
    return codes, order[fresh]


def codes_of(column: pa.ChunkedArray) -> IntArray:
    """Return the codes of a column of texts."""
    codes: IntArray = column.combine_chunks().dictionary_encode().indices.to_numpy().astype(np.int64)
    return codes


def frame(table: pa.Table, names: Iterable[str]) -> pd.DataFrame:
    """Return some columns for pandas, whatever the file says that pandas should make of them."""
    chosen = table.select(list(names))
    texts = {field.name: pa.string() for field in chosen.schema if pa.types.is_dictionary(field.type)}
    plain = chosen.cast(_with_types(chosen.schema, texts))
    rows: pd.DataFrame = plain.to_pandas(use_threads=False, ignore_metadata=True)
    return rows


def _ranks(column: pa.ChunkedArray) -> IntArray:
    """Return the place of each text among the texts in order."""
    encoded = column.combine_chunks().dictionary_encode()
    ranks = np.argsort(np.argsort(np.array(encoded.dictionary.to_pylist(), dtype=object)))
    return np.asarray(ranks[encoded.indices.to_numpy()], np.int64)


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


def _metrics(first: pa.Table) -> list[list[str]]:
    """The metrics of each cell, in its own order; cells with the same ones share the list."""
    columns = {name for name in first.column_names if name not in HEAD_COLUMNS and not name.startswith(CELL)}
    texts = first[COLUMNS].to_pylist()
    named = {text: [name for name in dict.fromkeys(parsed(text)) if name in columns] for text in set(texts)}
    return [named[text] for text in texts]


def _decoded(column: pa.ChunkedArray) -> list[Any]:
    return [None if text is None else parsed(text) for text in column.to_pylist()]


def _in_blocks(table: pa.Table, starts: IntArray) -> list[int]:
    """The cells of which not all rows were stored together."""
    changes = np.zeros(table.num_rows, bool)
    for name in (*OF_BLOCKS, *({PROCESSOR} & {*table.column_names})):
        changes[1:] |= np.diff(codes_of(table[name])) != 0
    changes[starts[:-1]] = False
    return sorted(set((np.searchsorted(starts, np.flatnonzero(changes), side="right") - 1).tolist()))


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
