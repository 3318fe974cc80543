"""Blocks of a cell's seeds: stored as they are done, so that a sweep that is stopped goes on from them."""

import time
from collections.abc import Iterable, Sequence
from typing import Self

from jerkbench.jobs.pool import processor_kind
from jerkbench.jobs.rows import Pieces, Row
from jerkbench.results.parts import Block
from jerkbench.results.store import Store
from jerkbench.sweep.tasks import Planned, Result, metadata_of

KEEP_S = 2.0
"""A block that took longer is stored at once; storing it takes some milliseconds."""
REST_S = 1.0
"""So is the last one of a task; a shorter one is stored with those of other tasks."""


def block_of(planned: Planned, result: Result) -> Block:
    """Return the runs of ``result`` as they are stored."""
    metadata = metadata_of(planned, result.notes, result.seconds, result.processor)
    return Block(planned.key, len(planned.draws), result.rows, metadata)


def missing(planned: Planned, known: Iterable[int]) -> Sequence[int]:
    """Return the seeds of a cell that are not ``known``."""
    done = set(known)
    return [draw for draw in planned.draws if draw not in done] if done else planned.draws


def run_blocks(planned: Planned, pieces: Pieces, store: Store | None = None) -> Result:
    """Run some seeds of a cell, and store what took long on the way; says how many of its rows that are.

    Args:
        planned: the cell.
        pieces: rows and notes of its seeds.
        store: where they are stored; default: nowhere.
    """
    rows: list[Row] = []
    block = empty = Result([], [], 0.0, processor=processor_kind())
    began = time.perf_counter()
    notes: list[str] = []
    for new_rows, new_notes in pieces:
        now = time.perf_counter()
        block, began = joined_results([block, Result(new_rows, new_notes, now - began)]), now
        if store is not None and block.seconds > KEEP_S:
            store.write_blocks([block_of(planned, block)])
            rows, notes = [*rows, *block.rows], [*notes, *block.notes]
            block = empty
    whole = block._replace(rows=[*rows, *block.rows], notes=_once([*notes, *block.notes]), stored=len(rows))
    if store is not None and block.seconds > REST_S:
        store.write_blocks([block_of(planned, block)])
        return whole._replace(seconds=0.0, stored=len(whole.rows))
    return whole


def joined_results(parts: Sequence[Result]) -> Result:
    """Return several results as one."""
    rows = [row for part in parts for row in part.rows]
    notes = _once(note for part in parts for note in part.notes)
    kinds = _once(part.processor for part in parts if part.processor)
    return Result(rows, notes, sum(part.seconds for part in parts), processor=" and ".join(kinds))


def _once(notes: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(notes))


# The writer of a sweep: results of many tasks become one part of the store.

HELD_S = 1.0
"""So long a result waits for others at most, while results come: so much is lost with the process."""
HELD_ROWS = 20_000
"""And so many rows are kept in memory."""


class Writer:
    """Results on their way into a store; what is held is stored at the end, whatever has ended it.

    Attributes:
        store: where they go.
    """

    def __init__(self, store: Store) -> None:
        """Write into ``store``."""
        self.store = store
        self._held: list[Block] = []
        self._written = time.monotonic()

    def __enter__(self) -> Self:
        """Begin with nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Store what is held."""
        self.flush()

    def add(self, planned: Planned, result: Result) -> None:
        """Take the rows of a cell that are not stored yet."""
        if rest := result.rows[result.stored :]:
            self._held.append(block_of(planned, result._replace(rows=rest)))
        if time.monotonic() - self._written > HELD_S or sum(len(block.rows) for block in self._held) > HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        """Store what is held as one part."""
        if self._held:
            self.store.write_blocks(self._held)
        self._held = []
        self._written = time.monotonic()
