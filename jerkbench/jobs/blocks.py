"""Rows on their way into a store: the runs of a job that are stored together, and who keeps them until then."""

import time
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.rows import Result, Row

HELD_S = 1.0
"""So long a result waits for others at most, while results come: so much is lost with the process."""
HELD_ROWS = 20_000
"""And so many rows are kept in memory."""


class RowBlock(NamedTuple):
    """Runs of a job that are stored together.

    Attributes:
        key: of the job.
        runs: how many it has in all.
        rows: one for each of these runs.
        metadata: of the job: labels, specification, protocol, data, notes and times.
    """

    key: str
    runs: int
    rows: Sequence[Row]
    metadata: Mapping[str, Any]


class RowStore(Protocol):
    """Where rows are kept."""

    folder: Path

    def prepare(self) -> list[str]:
        """Make it ready to be written; damaged files are set aside."""

    def known(self, keys: Collection[str], *, seen: set[str]) -> Mapping[str, Collection[int]]:
        """Return the seeds of ``keys`` that did not fail in files that are not ``seen``; then they are."""

    def write_blocks(self, blocks: Sequence[RowBlock]) -> None:
        """Store the blocks, all or none."""


class Writer:
    """Results on their way into a store: those of many tasks become one file of it.

    What is held is stored at the end, whatever has ended it.

    Attributes:
        store: where they go.
    """

    def __init__(self, store: RowStore) -> None:
        """Write into ``store``."""
        self.store = store
        self._held: list[RowBlock] = []
        self._written = time.monotonic()

    def __enter__(self) -> Self:
        """Begin with nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Store what is held."""
        self.flush()

    def add(self, job: Job, result: Result) -> None:
        """Take rows of a job."""
        if result.rows:
            self._held.append(block_of(job, result))
        if time.monotonic() - self._written > HELD_S or sum(len(block.rows) for block in self._held) > HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        """Store what is held as one file."""
        if self._held:
            self.store.write_blocks(self._held)
        self._held = []
        self._written = time.monotonic()


def block_of(job: Job, result: Result) -> RowBlock:
    """Return the runs of ``result`` as they are stored."""
    about = {
        "labels": job.labels._asdict(),
        "spec": job.spec,
        "protocol": job.scoring.limits,
        "data": job.scenario.data,
        "notes": result.notes,
        "code": code_digest(),
        "versions": versions(),
        "commit": git_commit(),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(result.seconds + result.inputs_s, 3),
        "run_s": float(f"{result.seconds / len(result.rows):.4g}"),
        "processor": result.processor,
    }
    return RowBlock(job.key, len(job.draws), result.rows, about)
