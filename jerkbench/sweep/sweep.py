"""The sweep: runs the cells that are not done yet, stores each at once, and ends with the table, whatever happens."""

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from jerkbench.errors import PluginError
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.cluster import Cluster, Local, Order
from jerkbench.jobs.identity import identity_of
from jerkbench.jobs.key import cell_key, data_fingerprint
from jerkbench.jobs.names import refusal
from jerkbench.jobs.preflight import require_inputs
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import CellRun, failed_rows
from jerkbench.notices import notify
from jerkbench.results.store import Store
from jerkbench.results.study_remarks import set_aside
from jerkbench.sweep.blocks import Writer, missing, run_blocks
from jerkbench.sweep.locks import FOLDER, Locks, Shared, plan_name
from jerkbench.sweep.tasks import Planned, Result, Task, grouped, in_order

LOCAL = Local()
"""The own pool of processes."""
POLL_S = 1.0
"""So long we wait before we look again for what other processes have done."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a sweep.

    Attributes:
        cells: every cell, in order.
        refused: sentences about the combinations that make no sense and are left out.
    """

    cells: tuple[Planned, ...]
    refused: tuple[str, ...]

    @property
    def draws(self) -> dict[str, Sequence[int]]:
        """The seeds of each cell, by its key."""
        return {planned.key: planned.draws for planned in self.cells}


def plan_sweep(cells: Sequence[Cell]) -> Plan:
    """Find the key of each cell; leave out what is refused, and join the seeds of what is there twice.

    Raises:
        RecordingError: the data of a cell are not there, or lack what its filters were asked to use.
        PluginError: two cells would have the same name in the table.
    """
    planned: dict[str, tuple[Cell, str]] = {}
    draws: dict[str, set[int]] = {}
    refused: dict[str, int] = {}
    fingerprints: dict[object, str] = {}
    checked: set[tuple[object, object]] = set()
    for cell in cells:
        if reason := refusal(cell):
            refused[reason] = refused.get(reason, 0) + 1
            continue
        source = cell.dataset, cell.disturbances
        if source not in fingerprints:
            fingerprints[source] = data_fingerprint(*source)
        require_inputs(cell, checked)
        fingerprint = fingerprints[source]
        key = cell_key(cell, fingerprint)
        planned.setdefault(key, (cell, fingerprint))
        draws.setdefault(key, set()).update(cell.draws)
    _require_names([cell for cell, _ in planned.values()])
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}." for reason, count in refused.items())
    entries = ((key, cell, fingerprint) for key, (cell, fingerprint) in planned.items())
    return Plan(tuple(Planned(cell, key, data, in_order(draws[key])) for key, cell, data in entries), lines)


def run_sweep(
    plan: Plan,
    store: Store,
    workers: int,
    cluster: Cluster = LOCAL,
    *,
    strict: bool = False,
    shown: bool = True,
    threads: int = 1,
) -> None:
    """Run what is missing, on a cluster, with a progress bar; store every cell as it is finished.

    Of a cell that was begun before, only the seeds that are missing run; damaged files are set aside.

    Args:
        plan: what there is to run.
        store: where it goes.
        workers: number of processes, where the cluster starts them itself.
        cluster: where it runs.
        strict: raise what is wrong with the input or a plugin, in words, instead of storing failed rows.
        shown: draw the bar.
        threads: how many the engine may use in each process.

    Raises:
        JerkbenchError: nothing can be written there, or as ``strict`` says.
        ClusterError: the cluster cannot go on; what is done is stored.
    """
    if damaged := store.prepare():
        notify(set_aside(damaged))
    left = _unfinished(plan.cells, store)
    folder = store.folder.parent / FOLDER
    tally, locks = Tally(), Locks(folder, plan_name(plan.cells))
    places = store.folder.parent.absolute(), locks.mark.absolute()  # a worker is elsewhere
    work = partial(run_task, *places, strict=strict, threads=threads)
    cells = len(plan.cells) if shown else 0
    with Progress(cells, already=cells - len(left) if shown else 0) as progress, locks, Writer(store) as writer:
        while left:
            _run_round(plan, left, _Round(work, writer, tally, locks, progress, cluster, workers))
            left = _wait_for_others([planned for planned in left if planned.key not in tally.whole], store, progress)


def _unfinished(cells: Sequence[Planned], store: Store) -> list[Planned]:
    """Return the cells of which runs are missing."""
    known = store.known(planned.key for planned in cells)
    return [planned for planned in cells if missing(planned, known.get(planned.key, ()))]


class _Round(NamedTuple):
    """What a round of a sweep works with."""

    work: Callable[[Task], Result]
    writer: Writer
    tally: "Tally"
    locks: Locks
    progress: Progress
    cluster: Cluster
    workers: int


def _run_round(plan: Plan, left: Sequence[Planned], of: _Round) -> None:
    """Run what is ``left`` of the plan, without what other processes are running."""
    store = of.writer.store
    remaining: dict[str, Sequence[int]] = {planned.key: () for planned in plan.cells}
    seen = set(store.files.names())
    known = store.known(planned.key for planned in left)
    for planned in left:
        remaining[planned.key], statuses = of.tally.resume(planned, known.get(planned.key, ()))
        if not remaining[planned.key]:
            of.progress.advance(statuses)
    groups = grouped(plan.cells, remaining)
    shared = Shared(of.locks, of.writer, groups, seen)
    if not groups:
        return
    order = Order(
        work=of.work,
        groups=groups,
        bundle=attrgetter("bundle"),
        admit=shared.admitted,
        identity=identity_of(planned.cell for planned in left),
        ended=store.forget,
    )
    for task, outcome in of.cluster.run(order, of.workers):
        result = _result(task, outcome)
        of.writer.add(task.planned, result)
        if statuses := of.tally.add(task, result):
            of.progress.advance(statuses)
        shared.settle(task)


def _wait_for_others(left: Sequence[Planned], store: Store, progress: Progress) -> list[Planned]:
    """Return what other processes have not done either, after a moment if there is any."""
    waiting = _unfinished(left, store) if left else []
    for _ in range(len(left) - len(waiting)):
        progress.advance()
    if waiting:
        notify("another process is running the rest of this sweep; its results are waited for")
        time.sleep(POLL_S)
    return waiting


def run_task(folder: Path, mark: Path, task: Task, *, strict: bool = False, threads: int = 1) -> Result:
    """Run some seeds of a cell; what takes long is stored on the way, the rest by whoever gets it.

    Args:
        folder: the study's.
        mark: a file in it; a worker that does not see it has another folder there, and only returns its rows.
        task: what to run.
        strict: whether what is wrong is raised.
        threads: how many the engine may use.
    """
    planned = task.planned
    run = CellRun(planned.cell, planned.fingerprint, on_error="raise" if strict else "row", threads=threads)
    pieces = run.pieces(task.draws)
    return run_blocks(planned, pieces, Store(folder) if mark.exists() else None)


class Tally:
    """The count of the finished runs of cells of which some are still running.

    Attributes:
        whole: keys of the cells of which none is.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.whole: set[str] = set()
        self._statuses: dict[str, dict[int, str]] = {}

    def resume(self, planned: Planned, known: Collection[int]) -> tuple[Sequence[int], list[str]]:
        """Take up the stored runs of a cell; returns the seeds to run, and as `add` does."""
        self._statuses[planned.key] = {draw: "" for draw in planned.draws if draw in known}
        return missing(planned, known), self._whole(planned)

    def add(self, task: Task, result: Result) -> list[str]:
        """Add the runs of ``task``; returns the status of every run of its cell with the last of them."""
        statuses = self._statuses.setdefault(task.planned.key, {})
        statuses.update({int(row["seed"]): row["status"] for row in result.rows})
        return self._whole(task.planned)

    def _whole(self, planned: Planned) -> list[str]:
        if len(self._statuses[planned.key]) < len(planned.draws):
            return []
        self.whole.add(planned.key)
        return list(self._statuses.pop(planned.key).values())


def _result(task: Task, outcome: Result | Exception) -> Result:
    """The rows of a task; failed ones, where its process could not say what became of it."""
    if isinstance(outcome, Exception):
        return Result(failed_rows(task.planned.cell, task.draws, f"{type(outcome).__name__}: {outcome}"), [], 0.0)
    return outcome


def _require_names(cells: Sequence[Cell]) -> None:
    """Refuse two cells that no column of the table would tell apart."""
    first: dict[object, Cell] = {}
    for cell in cells:
        namesake = first.setdefault(cell.labels, cell)
        if namesake is not cell:
            parts = [part for part in cell.spec if cell.spec[part] != namesake.spec[part]]
            raise PluginError(
                f"Two combinations would both be called {', '.join(cell.labels)}: they differ in "
                f"{' and '.join(parts or ['the protocol'])} in a way that no column shows; run them into studies of"
                " their own (study=NAME)."
            )
