"""The work of a sweep in pieces: some seeds of some cells, in an order in which what follows shares its input."""

import itertools
import math
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import NamedTuple, Self

from jerkbench.contracts import PerSeed
from jerkbench.jobs.cell import Cell, Protocol
from jerkbench.jobs.inputs import KEPT
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.rows import Row, lane
from jerkbench.results.parts import Block
from jerkbench.results.store import Store

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
    """Some seeds of a cell, or of several that share their calls.

    Attributes:
        cells: of one lane; most tasks of small sweeps have one.
        draws: which of their seeds.
        bundle: number of the stretch of the sweep that it belongs to.
    """

    cells: tuple[Planned, ...]
    draws: Sequence[int]
    bundle: int = 0


class Result(NamedTuple):
    """The result of a task for one of its cells.

    Attributes:
        rows: of its seeds.
        notes: for their reader.
        seconds: time of the rows [s], without `inputs_s`.
        processor: kind of the processor that ran it; empty: nothing was run.
        inputs_s: time that recordings and attitudes took [s].
    """

    rows: list[Row]
    notes: list[str]
    seconds: float
    processor: str = ""
    inputs_s: float = 0.0


class Done(NamedTuple):
    """What came of a task.

    Attributes:
        results: for each of its cells.
        rest: what was left when its time was up.
    """

    results: list[Result]
    rest: Task | None = None


def metadata_of(planned: Planned, result: Result) -> dict[str, object]:
    """The metadata of a cell, stored beside its rows."""
    cell = planned.cell
    return {
        "labels": cell.labels._asdict(),
        "spec": cell.spec,
        "protocol": _plain(cell.protocol),
        "data": planned.fingerprint,
        "notes": result.notes,
        "code": code_digest(),
        "versions": versions(),
        "commit": git_commit(),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(result.seconds + result.inputs_s, 3),
        "run_s": float(f"{result.seconds / len(result.rows):.4g}"),
        "processor": result.processor,
    }


@lru_cache(64)
def _plain(protocol: Protocol) -> dict[str, object]:
    return asdict(protocol)


def grouped(
    cells: Sequence[Planned],
    remaining: Mapping[str, Sequence[int]] | None = None,
    least: int = 1,
    suspects: Collection[str] = (),
) -> list[list[Task]]:
    """Tasks that share their recordings and attitudes, together; groups that share the data set follow each other.

    A task has no more seeds than a process keeps recordings. The numbers of the bundles depend on ``cells`` alone.

    Args:
        cells: the cells of the plan.
        remaining: by key, the seeds that are to run; of a cell that is not named, all.
        least: so many cells make a bundle at least.
        suspects: keys of the cells that lost a process together, and now run by themselves.
    """
    wanted = remaining or {}
    groups: dict[object, dict[object, list[Task]]] = {}
    for planned in cells:
        cell = planned.cell
        size = 1 if isinstance(cell.filter, PerSeed) else KEPT  # programs of the user's: each seed on its own
        for block, draws in _blocks(planned.draws, wanted.get(planned.key, planned.draws), size):
            near = groups.setdefault((cell.dataset, planned.fingerprint, block), {})
            near.setdefault((cell.disturbances, cell.attitude), []).append(Task((planned,), draws))
    numbered = _numbered([group for near in groups.values() for group in near.values()], least)
    return [tasks for group in numbered if (tasks := _joined([task for task in group if task.draws], suspects))]


def _joined(tasks: Sequence[Task], suspects: Collection[str]) -> list[Task]:
    """Join the tasks of a bundle that can share their calls."""

    def shared(task: Task) -> tuple[object, ...]:
        (planned,) = task.cells
        return task.bundle, task.draws, planned.key if planned.key in suspects else lane(planned.cell)

    together = [list(own) for _, own in itertools.groupby(tasks, shared)]
    return [own[0]._replace(cells=tuple(task.cells[0] for task in own)) for own in together]


def in_order(draws: Collection[int]) -> Sequence[int]:
    """Return seeds in their order, in short where none between the first and the last is missing."""
    first, last = min(draws), max(draws)
    return range(first, last + 1) if last - first + 1 == len(draws) else sorted(draws)


def bundle_size(tasks: int, least: int = 1) -> int:
    """Return how many tasks make a bundle: few enough to go round, enough to share their recording."""
    return min(max(math.ceil(tasks / BUNDLES), least), MOST_TASKS)


def _numbered(groups: list[list[Task]], least: int) -> list[list[Task]]:
    """Number the bundles; one of each group is the shorter."""
    size = bundle_size(sum(map(len, groups)), least)
    number = itertools.count()
    bundled = [[(next(number), group[k : k + size]) for k in range(0, len(group), size)] for group in groups]
    return [[task._replace(bundle=n) for n, tasks in group for task in tasks] for group in bundled]


def _blocks(draws: Sequence[int], remaining: Sequence[int], size: int) -> Iterator[tuple[int, Sequence[int]]]:
    """Number and seeds of each block of ``size`` of the ``draws``, as far as they are ``remaining``: maybe none."""
    wanted = set(remaining)
    for begin in range(0, len(draws), size):
        block = draws[begin : begin + size]
        yield begin, block if wanted.issuperset(block) else [draw for draw in block if draw in wanted]


# Results on their way into the store: those of many tasks become one part of it.


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
