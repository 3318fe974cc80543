"""The store: the runs of a study's cells in parts, written at once and atomically, found again by their cells' keys."""

import os
import re
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from uuid import uuid4

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from jerkbench.errors import JerkbenchError
from jerkbench.files import exists
from jerkbench.jobs.job import Job
from jerkbench.jobs.manifest import read_manifest
from jerkbench.jobs.parts import (
    CELL,
    KEY,
    PART_NAME,
    RowBlock,
    ShownSeeds,
    Stored,
    cells_of,
    concatenated,
    content_of,
    frame,
    ordered_runs,
    part_name,
    part_of,
    table_of,
)
from jerkbench.notices import notify, plain

SEEN_COLUMNS = [KEY, "seed", "status"]
"""The columns that say which runs are there."""

OUTCOMES = {"seed": "seed", "status": "status", "reason": "reason", f"{CELL}run_s": "run_s"}
"""Columns that `Store.rows` has of each run besides its metrics, by their names in a file."""

ABANDONED_S = 3600.0
"""A half-written file that is older belongs to nobody any more."""

SMALL_ROWS = 10_000
"""Rows of a part that is not worth joining with others."""
JOINED = 100_000
"""About as many rows has a joined part: so many are in memory at once."""

OLD = re.compile("[0-9a-f]{20}")
"""The name of a file with one cell, as it was stored before there were parts: its key."""

LISTINGS = 20
"""So often the files are listed again, where some of them have just been joined."""


class Store:
    """The cells of one study."""

    def __init__(self, folder: Path) -> None:
        """Open the store below ``folder`` (the study's), or a folder of cells itself; nothing is written yet."""
        below = folder / "cells"
        self.folder = folder if not below.is_dir() and any(folder.glob("*.parquet")) else below

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
        damaged = [name for name, table in self._each(SEEN_COLUMNS) if table is None]
        for path in map(self._path, damaged):
            with suppress(FileNotFoundError):  # another process has just set it aside
                path.rename(path.with_name(f"{path.name}.damaged"))
        if damaged:
            notify(set_aside(damaged))
        return damaged

    def write_blocks(self, blocks: Sequence[RowBlock], tables: Sequence[pa.Table] = ()) -> str:
        """Store runs of some cells as one part; a reader sees the whole of it or nothing. Returns the part's name.

        Args:
            blocks: the runs.
            tables: more of them, as `table_of` has made them.

        Raises:
            JerkbenchError: no reader would take them for rows.
        """
        return self._put(concatenated([*tables, *map(table_of, [blocks] if blocks else ())])).stem

    def known(
        self, keys: Collection[str], *, failed: bool = False, seen: set[str] | None = None
    ) -> dict[str, set[int]]:
        """Return the seeds of the runs of ``keys`` that are stored; of those that failed only where ``failed`` asks.

        Files that are ``seen`` are left out; those that are read now are seen then.
        """
        known: dict[str, set[int]] = {}
        for table in self._tables(keys, SEEN_COLUMNS, seen)[0]:
            runs = (table[name].cast(pa.string()) for name in (KEY, "status"))
            for key, status, seed in zip(*(own.to_pylist() for own in (*runs, table["seed"])), strict=True):
                if failed or status != "failed":
                    known.setdefault(key, set()).add(seed)
        return known

    def read(
        self, keys: Iterable[str] | None = None, shown: ShownSeeds | None = None
    ) -> tuple[list[Stored], list[str]]:
        """Return the whole cells among ``keys``, in their order, and the names of damaged files.

        Args:
            keys: default: all, sorted.
            shown: the seeds of each cell that are; default: those of the manifest.
        """
        wanted = None if keys is None else dict.fromkeys(keys)
        tables, damaged = self._tables(wanted)
        known = read_manifest(self.folder.parent).get("seeds", {}) if shown is None and tables else shown or {}
        cells = {cell.key: cell for cell in (cells_of(tables, known) if tables else ())}
        return [cells[key] for key in (sorted(cells) if wanted is None else wanted) if key in cells], damaged

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
        tables, _ = self._tables({job.key for job in jobs}, [KEY, *OUTCOMES, "cell.created", *metrics])
        stored = pd.DataFrame()
        if tables:
            table = concatenated(tables)
            stored = frame(table.take(pa.array(ordered_runs(table))), table.column_names).rename(columns=OUTCOMES)
        stored = stored.reindex(columns=[KEY, *OUTCOMES.values(), *metrics]).astype({"run_s": float})
        return asked.merge(stored, on=[KEY, "seed"], how="left").drop(columns=KEY)

    def keys_from(self, beginning: str) -> list[str]:
        """The keys that begin so, of all cells that are there, whole, damaged or begun."""
        tables, damaged = self._tables(None, [KEY])
        keys = {*damaged, *(key for table in tables for key in pc.unique(table[KEY]).to_pylist())}
        return sorted(key for key in keys if key.startswith(beginning))

    def compact(self, least: int = 2) -> None:
        """Join small parts if there are at least so many, without rows that exist twice.

        Parts that another process adds or joins meanwhile stay as they are.
        """
        small = {name: len(table) for name, table in self._each([KEY]) if table is not None and len(table) < SMALL_ROWS}
        joined = dict(zip(small, np.cumsum(list(small.values())) // JOINED, strict=True))
        for _, group in groupby(small if len(small) >= least else (), joined.get):
            names = list(group)
            with suppress(FileNotFoundError):
                tables = [table for name in names if (table := self.load(name)) is not None]
                if len(tables) == len(names) > 1:
                    table = concatenated(tables)
                    self._replace(names, table.take(pa.array(ordered_runs(table))))

    # Its files: listed, loaded, written atomically, replaced.

    def _tables(
        self, keys: Collection[str] | None, columns: list[str] | None = None, seen: set[str] | None = None
    ) -> tuple[list[pa.Table], list[str]]:
        """The rows of ``keys`` in each file that is not ``seen``, and the names of the files that are damaged."""
        tables, damaged = [], []
        for name, table in self._each(columns, seen):
            if table is None:
                damaged.append(name)
                continue
            there = pc.unique(table[KEY].cast(pa.string()))
            mask = [keys is None or key in keys for key in there.to_pylist()]  # of all keys a file has few
            if any(mask):
                tables.append(table if all(mask) else table.filter(pc.is_in(table[KEY], there.filter(mask))))
        return tables, damaged

    def _each(
        self, columns: list[str] | None = None, seen: set[str] | None = None
    ) -> Iterator[tuple[str, pa.Table | None]]:
        """Each file by its name, with its rows (default: whole); None where it is damaged.

        Files that are ``seen`` are left out; those that were given are then.
        """
        seen = set() if seen is None else seen
        for _ in range(LISTINGS):
            vanished = False
            for name in self._names():
                if name in seen:
                    continue
                try:
                    yield name, self.load(name, columns)
                    seen.add(name)
                except FileNotFoundError:
                    vanished = True
            if not vanished:
                return

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.parquet"

    def _names(self) -> list[str]:
        names = sorted(path.stem for path in self.folder.glob("*.parquet"))
        if old := next(filter(OLD.fullmatch, names), None):
            raise JerkbenchError(
                f"{self._path(old)} has a format of earlier versions, which is no longer read; run the study's command"
                " (it stands in manifest.json) again into a new one (study=NAME)."
            )
        return names

    def load(self, name: str, columns: list[str] | None = None) -> pa.Table | None:
        """Load a file, or some of its columns; None where it is not as it was written.

        Raises:
            FileNotFoundError: it is gone.
        """
        path, match = self._path(name), PART_NAME.fullmatch(name)
        if not match or (exists(path) and not path.is_file()):  # a pipe would be waited for
            return None
        try:
            return part_of(path.read_bytes(), match[1], columns)
        except PermissionError as error:
            raise JerkbenchError(f"{path} cannot be read: {error.strerror}.") from error

    def _put(self, table: pa.Table) -> Path:
        """Write rows as a new part, at once and whole; returns its path."""
        content = content_of(table)
        path = self._path(part_name(content))
        self.folder.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.stem}.{os.getpid()}.partial")  # no .parquet: nobody lists it
        try:
            with partial.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # the parts that it replaces are deleted next
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
        return path

    def _replace(self, names: Sequence[str], table: pa.Table) -> Path:
        """Store rows of some parts as one, then delete these; a reader in between sees rows twice, never none."""
        path = self._put(table)
        for name in names:
            with suppress(PermissionError):  # on Windows a reader holds it; rows that exist twice count once
                self._path(name).unlink(missing_ok=True)
        return path


def set_aside(names: list[str]) -> str:
    """Return a sentence about damaged files whose cells run again."""
    cells = "its cells" if len(names) == 1 else "their cells"
    return f"{damaged(names)} set aside, {cells} run again: {', '.join(map(plain, names))}."


def damaged(keys: list[str]) -> str:
    """Return the beginning of a sentence about files of cells that are damaged."""
    return "1 damaged file of cells is" if len(keys) == 1 else f"{len(keys)} damaged files of cells are"
