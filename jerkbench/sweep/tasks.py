"""The work of a sweep in pieces: some seeds of a cell, in an order in which pieces that follow share their input."""

import itertools
import math
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

from jerkbench.contracts import PerSeed
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.inputs import KEPT
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.rows import Row

BUNDLES = 128
"""Bundles of a sweep, as long as none has more than `MOST_TASKS`."""
MOST_TASKS = 64
"""Tasks of a bundle: a cluster needs some milliseconds for each bundle, and loses as much with a worker."""


@dataclass(frozen=True, eq=False)
class Planned:
    """A cell that is to run.

    Attributes:
        cell: the cell.
        key: of its rows.
        fingerprint: of its data.
        draws: its seeds, or phases, in order.
    """

    cell: Cell
    key: str
    fingerprint: str
    draws: Sequence[int]


class Task(NamedTuple):
    """Some seeds of a cell; most cells are one task.

    Attributes:
        planned: the cell.
        draws: which of its seeds.
        bundle: number of the stretch of the sweep that it belongs to.
    """

    planned: Planned
    draws: Sequence[int]
    bundle: int = 0


class Result(NamedTuple):
    """The result of a task.

    Attributes:
        rows: of its seeds.
        notes: for their reader.
        seconds: time of the rows that are not stored yet [s].
        stored: how many of the rows, from the first on, are stored already.
        processor: kind of the processor that ran it; empty: nothing was run.
    """

    rows: list[Row]
    notes: list[str]
    seconds: float
    stored: int = 0
    processor: str = ""


def metadata_of(planned: Planned, notes: list[str], seconds: float, processor: str) -> dict[str, object]:
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
        "processor": processor,
    }


def grouped(cells: Sequence[Planned], remaining: Mapping[str, Sequence[int]] | None = None) -> list[list[Task]]:
    """Tasks that share their recordings and attitudes, together; groups that share the data set follow each other.

    A task has no more seeds than a process keeps recordings. The numbers of the bundles depend on ``cells`` alone.

    Args:
        cells: the cells of the plan.
        remaining: by key, the seeds that are to run; of a cell that is not named, all.
    """
    wanted = remaining or {}
    groups: dict[object, dict[object, list[Task]]] = {}
    for planned in cells:
        cell = planned.cell
        size = 1 if isinstance(cell.filter, PerSeed) else KEPT  # programs of the user's: each seed on its own
        for block, draws in _blocks(planned.draws, wanted.get(planned.key, planned.draws), size):
            near = groups.setdefault((cell.dataset, planned.fingerprint, block), {})
            near.setdefault((cell.disturbances, cell.attitude), []).append(Task(planned, draws))
    numbered = _numbered([group for near in groups.values() for group in near.values()])
    return [tasks for group in numbered if (tasks := [task for task in group if task.draws])]


def in_order(draws: Collection[int]) -> Sequence[int]:
    """Return seeds in their order, in short where none between the first and the last is missing."""
    first, last = min(draws), max(draws)
    return range(first, last + 1) if last - first + 1 == len(draws) else sorted(draws)


def bundle_size(tasks: int) -> int:
    """Return how many tasks make a bundle: few enough to go round, enough to share their recording."""
    return min(max(math.ceil(tasks / BUNDLES), 1), MOST_TASKS)


def _numbered(groups: list[list[Task]]) -> list[list[Task]]:
    """Number the bundles; one of each group is the shorter."""
    size = bundle_size(sum(map(len, groups)))
    number = itertools.count()
    bundled = [[(next(number), group[k : k + size]) for k in range(0, len(group), size)] for group in groups]
    return [[task._replace(bundle=n) for n, tasks in group for task in tasks] for group in bundled]


def _blocks(draws: Sequence[int], remaining: Sequence[int], size: int) -> Iterator[tuple[int, Sequence[int]]]:
    """Number and seeds of each block of ``size`` of the ``draws``, as far as they are ``remaining``: maybe none."""
    wanted = set(remaining)
    for begin in range(0, len(draws), size):
        block = draws[begin : begin + size]
        yield begin, block if wanted.issuperset(block) else [draw for draw in block if draw in wanted]
