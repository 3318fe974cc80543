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
        one: the cell.
        draws: which of its seeds.
    """

    one: Planned
    draws: Sequence[int]

    @property
    def whole(self) -> bool:
        """Whether these are all seeds of the cell."""
        return self.draws == self.one.cell.draws


class Result(NamedTuple):
    """What became of a task: its rows, what a reader of them has to know, and how long it took [s]."""

    rows: list[Row]
    notes: list[str]
    seconds: float


def about(one: Planned, notes: list[str], seconds: float) -> dict[str, object]:
    """What is stored beside the rows of a cell."""
    cell = one.cell
    return {
        "labels": cell.labels._asdict(),
        "spec": cell.spec,
        "protocol": asdict(cell.protocol),
        "data": one.fingerprint,
        "notes": notes,
        "code": code_digest(),
        "versions": versions(),
        "commit": git_commit(),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(seconds, 3),
    }


def grouped(pending: Sequence[Planned], left: Mapping[str, Sequence[int]] | None = None) -> list[list[Task]]:
    """Tasks that share their recordings and attitudes, together; groups that share the data set follow each other.

    A task has no more seeds than a process keeps recordings.

    Args:
        pending: what is to run.
        left: by key, the seeds that are to run; of a cell that is not named, all.
    """
    asked = left or {}
    groups: dict[object, dict[object, list[Task]]] = {}
    for one in pending:
        cell = one.cell
        for block, draws in _blocks(cell.draws, asked.get(one.key, cell.draws)):
            near = groups.setdefault((cell.dataset, one.fingerprint, block), {})
            near.setdefault((cell.disturbances, cell.attitude), []).append(Task(one, draws))
    return [group for near in groups.values() for group in near.values()]


def _blocks(draws: range, left: Sequence[int]) -> Iterator[tuple[int, Sequence[int]]]:
    """Number and seeds of each block of ``draws``, as far as they are ``left``."""
    wanted = set(left)
    for begin in range(0, len(draws), KEPT):
        block = draws[begin : begin + KEPT]
        some = block if wanted.issuperset(block) else [draw for draw in block if draw in wanted]
        if some:
            yield begin, some
