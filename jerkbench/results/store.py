"""The store: the runs of a study's cells in parts, written at once and atomically, found again by their cells' keys."""

import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from jerkbench.errors import JerkbenchError
from jerkbench.jobs.blocks import RowBlock
from jerkbench.jobs.job import Job
from jerkbench.notices import notify, plain
from jerkbench.results.content import (
    Content,
    ShownSeeds,
    Stored,
    codes_of,
    concatenated,
    content_of_tables,
    frame,
    ordered_runs,
)
from jerkbench.results.manifest import read_manifest
from jerkbench.results.parts import CELL, KEY, PartFiles, table_of

SEEN_COLUMNS = [KEY, "seed", "status"]
"""The columns that say which runs are there."""

RUN_COLUMNS = {
    **{name: name for name in ("seed", "status", "reason")},
    f"{CELL}run_s": "run_s",
}
"""Columns that `Store.rows` has of each run besides its metrics, by their names in a file."""

ABANDONED_S = 3600.0
"""A half-written file that is older belongs to nobody any more."""

SMALL_ROWS = 20_000
"""Rows of a part that is not worth joining with others."""
JOINED = 100_000
"""Rows of which joined parts have no more: so many are in memory at once."""
MANY_PARTS = 16
"""Small parts from which on they are joined."""


class Store:
    """The cells of one study."""

    def __init__(self, folder: Path) -> None:
        """Open the store below ``folder`` (the study's), or a folder of cells itself; nothing is written yet."""
        below = folder / "cells"
        self.folder = folder if not below.is_dir() and any(folder.glob("*.parquet")) else below
        self.files = PartFiles(self.folder)

    def prepare(self) -> list[str]:
        """Make the folder, clear away what a killed process has left half-written, and set damaged files aside.

        Returns:
            The names of these: nobody looks at them again.

        Raises:
            JerkbenchError: nothing can be written there.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            probe = self.folder / f".probe.{uuid4().hex}"
            probe.touch()
            probe.unlink()
            for partial in self.folder.rglob(".*.partial"):
                with suppress(FileNotFoundError):  # its process has just finished it
                    if time.time() - partial.stat().st_mtime > ABANDONED_S:
                        partial.unlink()
        except OSError as error:
            raise JerkbenchError(f"Results cannot be written to {self.folder}: {error.strerror or error}.") from error
        damaged = [name for name, table in self.files.each(SEEN_COLUMNS) if table is None]
        for path in map(self.files.path, damaged):
            with suppress(FileNotFoundError):  # another process has just set it aside
                path.rename(path.with_name(f"{path.name}.damaged"))
        if damaged:
            notify(set_aside(damaged))
        return damaged

    def write_blocks(self, blocks: Sequence[RowBlock]) -> None:
        """Store runs of some cells as one part; a reader sees the whole of it or nothing.

        Raises:
            JerkbenchError: no reader would take them for rows.
        """
        self.files.put(table_of(blocks))

    def known(self, keys: Iterable[str], *, failed: bool = False, seen: set[str] | None = None) -> dict[str, set[int]]:
        """Return the seeds of the runs of ``keys`` that are stored; of those that failed only where ``failed`` asks.

        Files that are ``seen`` are left out; those that are read now are seen then.
        """
        known: dict[str, set[int]] = {}
        tables, _ = self._tables(list(keys), SEEN_COLUMNS, seen)
        for table in tables:
            wanted = table if failed else table.filter(pc.not_equal(table["status"].cast(pa.string()), "failed"))
            codes, seeds = codes_of(wanted[KEY]), wanted["seed"].to_numpy()
            names, order = wanted[KEY].combine_chunks().dictionary_encode().dictionary.to_pylist(), np.argsort(codes)
            for places in np.split(order, np.flatnonzero(np.diff(codes[order])) + 1) if len(order) else ():
                known.setdefault(names[codes[places[0]]], set()).update(seeds[places].tolist())
        return known

    def read(
        self, keys: Iterable[str] | None = None, shown: ShownSeeds | None = None
    ) -> tuple[list[Stored], list[str]]:
        """Return the cells that `content` has, in the order of ``keys``, and the names of damaged files."""
        wanted = None if keys is None else list(keys)
        content, damaged = self.content(wanted, shown)
        cells = {cell.key: cell for cell in content.stored()} if content else {}
        return [cells[key] for key in (sorted(cells) if wanted is None else wanted) if key in cells], damaged

    def content(
        self, keys: Sequence[str] | None = None, shown: ShownSeeds | None = None
    ) -> tuple[Content | None, list[str]]:
        """Return the whole cells among ``keys`` in one table, and the names of damaged files.

        Args:
            keys: default: all.
            shown: the seeds of each cell that are; default: those of the manifest.
        """
        tables, damaged = self._tables(keys)
        if not tables:
            return None, damaged
        known = read_manifest(self.folder.parent).get("seeds", {}) if shown is None else shown
        return content_of_tables(tables, known), damaged

    def rows(self, jobs: Sequence[Job], metrics: Sequence[str]) -> pd.DataFrame:
        """Return the runs of some jobs, in their order and that of their seeds; without a status: not stored.

        Of a run that is there more than once one that did not fail, the newest.

        Args:
            jobs: with the seeds that are wanted.
            metrics: the columns that are wanted besides.

        Returns:
            The place of the job (``place``), seed, status, reason, run_s [s] and the metrics.
        """
        counts = [len(job.draws) for job in jobs]
        asked = pd.DataFrame(
            {
                "place": np.repeat(np.arange(len(jobs)), counts),
                KEY: np.repeat(np.array([job.key for job in jobs], dtype=object), counts),
                "seed": np.concatenate([[*job.draws] for job in jobs]) if jobs else [],
            }
        )
        stored = self._rows({job.key for job in jobs}, metrics)
        return asked.merge(stored, on=[KEY, "seed"], how="left").drop(columns=KEY)

    def _rows(self, keys: Collection[str], metrics: Sequence[str]) -> pd.DataFrame:
        """The stored runs of ``keys``, each once."""
        tables, _ = self._tables(list(keys), [KEY, *RUN_COLUMNS, "cell.created", *metrics])
        if not tables:
            return pd.DataFrame(columns=[KEY, *RUN_COLUMNS.values(), *metrics])
        table = concatenated(tables)
        rows = frame(table.take(pa.array(ordered_runs(table)[1])), table.column_names)
        rows = rows.rename(columns=RUN_COLUMNS).reindex(columns=[KEY, *RUN_COLUMNS.values(), *metrics])
        return rows.assign(run_s=rows["run_s"].astype(float))

    def keys_from(self, beginning: str) -> list[str]:
        """The keys that begin so, of all cells that are there, whole, damaged or begun."""
        tables, damaged = self._tables(None, [KEY])
        keys = {*damaged, *(key for table in tables for key in pc.unique(table[KEY]).to_pylist())}
        return sorted(key for key in keys if key.startswith(beginning))

    def compact(self) -> None:
        """Join small parts, where there are many."""
        parts = self.files.each([KEY])
        small = [(name, table.num_rows) for name, table in parts if table is not None and table.num_rows < SMALL_ROWS]
        if len(small) >= MANY_PARTS:
            for names in _stretches(small):
                self._join(names)

    def _join(self, names: Sequence[str]) -> None:
        """Join some parts, unless another process is just doing so."""
        try:
            tables = [table for name in names if (table := self.files.load(name, None)) is not None]
        except FileNotFoundError:
            return
        if len(tables) == len(names):
            self.files.replace(names, concatenated(tables))

    def pack(self) -> Path:
        """Join all whole cells into one part, each run once, and delete every other file; returns that part's path.

        Raises:
            JerkbenchError: there is no cell, or a file is damaged.
        """
        content, damaged = self.content(shown={})
        if damaged:
            raise JerkbenchError(f"{self.folder} holds damaged files: {', '.join(map(plain, damaged))}. Delete them.")
        if content is None or not content.keys:
            raise JerkbenchError(f"{self.folder} holds no results.")
        return self.files.replace([name for name, _ in list(self.files.each())], content.table)

    def _tables(
        self, keys: Sequence[str] | None, columns: list[str] | None = None, seen: set[str] | None = None
    ) -> tuple[list[pa.Table], list[str]]:
        """The rows of ``keys`` in each file that is not ``seen``, and the names of the files that are damaged."""
        tables, damaged = [], []
        wanted = None if keys is None else pa.array(keys, pa.string())
        for name, table in self.files.each(columns, seen):
            if table is None:
                damaged.append(name)
                continue
            own = table if wanted is None else table.filter(pc.is_in(table[KEY].cast(pa.string()), wanted))
            if own.num_rows:
                tables.append(own)
        return tables, damaged


def _stretches(parts: Sequence[tuple[str, int]]) -> Iterator[list[str]]:
    """The names of parts, with their numbers of rows, in stretches of no more than `JOINED` rows."""
    names: list[str] = []
    rows = 0
    for name, count in parts:
        if names and rows + count > JOINED:
            yield names
            names, rows = [], 0
        names.append(name)
        rows += count
    yield names


def set_aside(names: list[str]) -> str:
    """Return a sentence about damaged files whose cells run again."""
    cells = "its cells" if len(names) == 1 else "their cells"
    return f"{damaged(names)} set aside, {cells} run again: {', '.join(map(plain, names))}."


def damaged(keys: list[str]) -> str:
    """Return the beginning of a sentence about files of cells that are damaged."""
    return "1 damaged file of cells is" if len(keys) == 1 else f"{len(keys)} damaged files of cells are"
