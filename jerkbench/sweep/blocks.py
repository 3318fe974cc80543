"""Blocks of a cell's seeds: stored as they are done, so that a sweep that is stopped goes on from them."""

import time
from collections.abc import Iterable, Sequence
from typing import Self

from jerkbench.results.parts import Block
from jerkbench.results.store import Store
from jerkbench.sweep.tasks import Planned, Result, metadata_of


def block_of(planned: Planned, result: Result) -> Block:
    """Return the runs of ``result`` as they are stored."""
    return Block(planned.key, len(planned.draws), result.rows, metadata_of(planned, result))


def missing(planned: Planned, known: Iterable[int]) -> Sequence[int]:
    """Return the seeds of a cell that are not ``known``."""
    done = set(known)
    return [draw for draw in planned.draws if draw not in done] if done else planned.draws


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
        """Take rows of a cell."""
        if result.rows:
            self._held.append(block_of(planned, result))
        if time.monotonic() - self._written > HELD_S or sum(len(block.rows) for block in self._held) > HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        """Store what is held as one part."""
        if self._held:
            self.store.write_blocks(self._held)
        self._held = []
        self._written = time.monotonic()
