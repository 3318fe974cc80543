"""Blocks of a cell's seeds: stored as they are done, so that a sweep that is stopped goes on from them."""

import time
from collections.abc import Iterable, Sequence
from typing import Self

from jerkbench.jobs.pool import processor_kind
from jerkbench.jobs.rows import Piece
from jerkbench.results.parts import Block
from jerkbench.results.store import Store
from jerkbench.sweep.tasks import Planned, Result, Task, metadata_of

KEEP_S = 2.0
"""A block that took longer is stored at once; storing it takes some milliseconds."""
REST_S = 1.0
"""So is the last one of a task; a shorter one is stored with those of other tasks."""


def block_of(planned: Planned, result: Result) -> Block:
    """Return the runs of ``result`` as they are stored."""
    return Block(planned.key, len(planned.draws), result.rows, metadata_of(planned, result))


def missing(planned: Planned, known: Iterable[int]) -> Sequence[int]:
    """Return the seeds of a cell that are not ``known``."""
    done = set(known)
    return [draw for draw in planned.draws if draw not in done] if done else planned.draws


def run_blocks(
    task: Task, pieces: Iterable[Sequence[Piece]], store: Store | None = None, inputs_s: float = 0.0
) -> list[Result]:
    """Run some seeds of a task's cells, and store what took long on the way; says how many of the rows that are.

    Args:
        task: the cells.
        pieces: rows and notes of each.
        store: where they are stored; default: nowhere.
        inputs_s: time that their recordings and attitudes took [s].
    """
    share = 1.0 / len(task.cells)
    empty = Result([], [], 0.0, processor=processor_kind())
    held = [empty._replace(inputs_s=inputs_s * share)] * len(task.cells)
    kept = [empty] * len(task.cells)
    began = time.perf_counter()

    def keep(least_s: float) -> None:
        nonlocal held, kept
        if store is not None and sum(own.seconds for own in held) > least_s:
            store.write_blocks(list(map(block_of, task.cells, held)))
            kept = [joined_results(both) for both in zip(kept, held, strict=True)]
            held = [empty] * len(task.cells)

    for new in pieces:
        now = time.perf_counter()
        results = (Result(rows, notes, (now - began) * share) for rows, notes in new)
        held, began = [joined_results(both) for both in zip(held, results, strict=True)], now
        keep(KEEP_S)
    keep(REST_S)
    return [
        rest._replace(rows=[*own.rows, *rest.rows], notes=_once([*own.notes, *rest.notes]), stored=len(own.rows))
        for own, rest in zip(kept, held, strict=True)
    ]


def joined_results(parts: Sequence[Result]) -> Result:
    """Return several results as one."""
    rows = [row for part in parts for row in part.rows]
    notes = _once(note for part in parts for note in part.notes)
    kinds = _once(part.processor for part in parts if part.processor)
    seconds, inputs_s = (sum(times) for times in zip(*((part.seconds, part.inputs_s) for part in parts), strict=True))
    return Result(rows, notes, seconds, processor=" and ".join(kinds), inputs_s=inputs_s)


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
