"""The writer of a sweep: results of many tasks become one part of the store."""

import time
from typing import Self

from jerkbench.results.parts import Block
from jerkbench.results.store import Store
from jerkbench.sweep.seed_blocks import block_of
from jerkbench.sweep.tasks import Planned, Result

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
