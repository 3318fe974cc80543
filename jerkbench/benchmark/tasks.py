"""The work of a sweep in pieces: some seeds of a cell, in an order in which pieces that follow share their input."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from jerkbench.benchmark.cell import Cell
from jerkbench.benchmark.inputs import KEPT
from jerkbench.benchmark.run import Row


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
    draws: range

    @property
    def whole(self) -> bool:
        """Whether these are all seeds of the cell."""
        return self.draws == self.one.cell.draws


class Result(NamedTuple):
    """What became of a task: its rows, what a reader of them has to know, and how long it took [s]."""

    rows: list[Row]
    notes: list[str]
    seconds: float


def grouped(pending: Sequence[Planned]) -> list[list[Task]]:
    """Tasks that share their recordings and attitudes, together; groups that share the data set follow each other.

    A task has no more seeds than a process keeps recordings.
    """
    groups: dict[object, dict[object, list[Task]]] = {}
    for one in pending:
        cell = one.cell
        for block, draws in enumerate(_blocks(cell.draws)):
            near = groups.setdefault((cell.dataset, one.fingerprint, block), {})
            near.setdefault((cell.disturbances, cell.attitude), []).append(Task(one, draws))
    return [group for near in groups.values() for group in near.values()]


def _blocks(draws: range) -> Iterator[range]:
    for begin in range(0, len(draws), KEPT):
        yield draws[begin : begin + KEPT]
