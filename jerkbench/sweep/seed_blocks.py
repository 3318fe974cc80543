"""Blocks of a cell's seeds: stored as they are done, taken up again, and joined when no seed is missing."""

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

from jerkbench.execution.cell_run import Pieces, Row
from jerkbench.results.store import Store
from jerkbench.sweep.tasks import Planned, Result, metadata_of

KEEP_S = 2.0
"""A block that took longer is stored at once; storing it takes some milliseconds."""


class Blocks:
    """The finished seeds of a store's unfinished cells.

    A run that failed is never among them: it is tried again.
    """

    def __init__(self, store: Store) -> None:
        """Look into the folder ``blocks`` beside the cells; nothing is written yet."""
        self._store = Store.at(store.folder / "blocks")

    def write(self, planned: Planned, result: Result) -> None:
        """Store a block, named by the first of its seeds."""
        rows = [row for row in result.rows if row["status"] != "failed"]
        if rows:
            key = f"{planned.key}.{rows[0]['seed']}"
            self._store.write(key, rows, metadata_of(planned, result.notes, result.seconds))

    def read(self, planned: Planned) -> Result:
        """Return the finished seeds of a cell; those of a damaged block are to be run again."""
        rows: dict[int, Row] = {}
        notes: list[str] = []
        seconds = 0.0
        for records, beside in self._store.records(self._keys(planned)):
            rows |= {row["seed"]: row for row in records}
            notes += beside["notes"]
            seconds += beside["seconds"]
        return Result([rows[draw] for draw in planned.cell.draws if draw in rows], _once(notes), seconds)

    def forget(self, planned: Planned) -> None:
        """Delete the blocks of a cell, and their folder when it is empty."""
        for key in self._keys(planned):
            self._store.path(key).unlink(missing_ok=True)
        with suppress(OSError):  # another cell has blocks there
            self._store.folder.rmdir()

    def _keys(self, planned: Planned) -> list[str]:
        return sorted(path.stem for path in self._store.folder.glob(f"{planned.key}.*.parquet"))


def run_blocks(planned: Planned, pieces: Pieces, blocks: Blocks, *, keep_rest: bool = False) -> Result:
    """Run some seeds of a cell, and store what took long on the way.

    Args:
        planned: the cell.
        pieces: rows and notes of its seeds.
        blocks: where they are stored.
        keep_rest: store the last block whatever it took.
    """
    done, block = Result([], [], 0.0), Result([], [], 0.0)
    began = time.perf_counter()
    for rows, notes in pieces:
        now = time.perf_counter()
        block, began = joined_results([block, Result(rows, notes, now - began)]), now
        if block.seconds > KEEP_S:
            blocks.write(planned, block)
            done, block = joined_results([done, block]), Result([], [], 0.0)
    if keep_rest:
        blocks.write(planned, block)
    return joined_results([done, block])


def finish_cell(planned: Planned, store: Store, run: Callable[[Sequence[int]], Pieces]) -> None:
    """Run the seeds of a cell that no block has, and store the cell."""
    blocks = Blocks(store)
    known = blocks.read(planned)
    remaining = missing(planned, known)
    store_cell(planned, [known, run_blocks(planned, run(remaining) if remaining else iter(()), blocks)], store)


def missing(planned: Planned, known: Result) -> Sequence[int]:
    """Return the seeds of a cell that ``known`` lacks."""
    done = {row["seed"] for row in known.rows}
    draws = planned.cell.draws
    return [draw for draw in draws if draw not in done] if done else draws


def store_cell(planned: Planned, parts: Sequence[Result], store: Store) -> list[Row]:
    """Store a cell of which no seed is missing, and delete its blocks; returns its rows."""
    whole = joined_results(parts)
    rows = sorted(whole.rows, key=lambda row: int(row["seed"]))
    store.write(planned.key, rows, metadata_of(planned, whole.notes, whole.seconds))
    Blocks(store).forget(planned)
    return rows


def joined_results(parts: Sequence[Result]) -> Result:
    """Return several results as one."""
    rows = [row for part in parts for row in part.rows]
    return Result(rows, _once(note for part in parts for note in part.notes), sum(part.seconds for part in parts))


def _once(notes: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(notes))
