"""The work of a sweep in pieces: some seeds of a cell, in an order in which pieces that follow share their input."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

from jerkbench.cells.cell import Cell
from jerkbench.cells.provenance import code_digest, git_commit, versions
from jerkbench.execution.cell_run import Row
from jerkbench.execution.inputs import KEPT


@dataclass(frozen=True, eq=False)
class Planned:
    """A cell with its key and what is known of its data."""

    cell: Cell
    key: str
    fingerprint: str


class Task(NamedTuple):
    """Some seeds of a cell; most cells are one task.

    Attributes:
        planned: the cell.
        draws: which of its seeds.
    """

    planned: Planned
    draws: Sequence[int]

    @property
    def complete(self) -> bool:
        """Whether these are all seeds of the cell."""
        return self.draws == self.planned.cell.draws


class Result(NamedTuple):
    """The result of a task: its rows, the notes for their reader, and its time [s]."""

    rows: list[Row]
    notes: list[str]
    seconds: float


def metadata_of(planned: Planned, notes: list[str], seconds: float) -> dict[str, object]:
    """The metadata of a cell, stored beside its rows."""
    cell = planned.cell
    return {
        "labels": cell.labels._asdict(),
        "spec": cell.spec,
        "protocol": asdict(cell.protocol),
        "data": planned.fingerprint,
        "notes": notes,
        "code": code_digest(),
        "versions": versions(),
        "commit": git_commit(),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(seconds, 3),
    }


def grouped(pending: Sequence[Planned], remaining: Mapping[str, Sequence[int]] | None = None) -> list[list[Task]]:
    """Tasks that share their recordings and attitudes, together; groups that share the data set follow each other.

    A task has no more seeds than a process keeps recordings.

    Args:
        pending: what is to run.
        remaining: by key, the seeds that are to run; of a cell that is not named, all.
    """
    wanted = remaining or {}
    groups: dict[object, dict[object, list[Task]]] = {}
    for planned in pending:
        cell = planned.cell
        for block, draws in _blocks(cell.draws, wanted.get(planned.key, cell.draws)):
            near = groups.setdefault((cell.dataset, planned.fingerprint, block), {})
            near.setdefault((cell.disturbances, cell.attitude), []).append(Task(planned, draws))
    return [group for near in groups.values() for group in near.values()]


def _blocks(draws: range, remaining: Sequence[int]) -> Iterator[tuple[int, Sequence[int]]]:
    """Number and seeds of each block of ``draws``, as far as they are ``remaining``."""
    wanted = set(remaining)
    for begin in range(0, len(draws), KEPT):
        block = draws[begin : begin + KEPT]
        chosen = block if wanted.issuperset(block) else [draw for draw in block if draw in wanted]
        if chosen:
            yield begin, chosen
