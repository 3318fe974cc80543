"""The sweep: runs the cells that are not done yet, stores each at once, and ends with the table, whatever happens."""

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from jerkbench.cells.cell import Cell
from jerkbench.cells.data import data_fingerprint
from jerkbench.cells.key import cell_key
from jerkbench.cells.refusal import refusal
from jerkbench.clusters.cluster import Cluster, Order
from jerkbench.clusters.identity import identity_of
from jerkbench.clusters.local import Local
from jerkbench.errors import PluginError
from jerkbench.execution.cell_run import CellRun, failed_rows
from jerkbench.execution.preflight import require_inputs
from jerkbench.execution.progress import Progress
from jerkbench.notices import notify
from jerkbench.results.store import Store
from jerkbench.sweep.locks import FOLDER, Locks, Shared, plan_name
from jerkbench.sweep.seed_blocks import known_runs, missing, run_blocks
from jerkbench.sweep.tasks import Planned, Result, Task, grouped
from jerkbench.sweep.writer import Writer

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


def plan_sweep(cells: Sequence[Cell]) -> Plan:
    """Find the key of each cell; leave out what is refused and what is there twice.

    Raises:
        RecordingError: the data of a cell are not there, or lack what its filters were asked to use.
        PluginError: two cells would have the same name in the table.
    """
    planned: dict[str, Planned] = {}
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
        planned.setdefault(key, Planned(cell, key, fingerprint))
    _require_names([entry.cell for entry in planned.values()])
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}." for reason, count in refused.items())
    return Plan(tuple(planned.values()), lines)


def run_sweep(plan: Plan, store: Store, workers: int, done: Collection[str], cluster: Cluster = LOCAL) -> None:
    """Run what is not ``done``, on a cluster, with a progress bar; store every cell as it is finished.

    Of a cell that was begun before, only the seeds that are missing run.

    Args:
        plan: what there is to run.
        store: where it goes.
        workers: number of processes, where the cluster starts them itself.
        done: keys of the cells that are there.
        cluster: where it runs.

    Raises:
        ClusterError: the cluster cannot go on; what is done is stored.
    """
    left = [planned for planned in plan.cells if planned.key not in done]
    folder = store.folder.parent / FOLDER
    tally, locks = Tally(), Locks(folder, plan_name(plan.cells))
    with (
        Progress(len(plan.cells), already=len(plan.cells) - len(left)) as progress,
        locks,
        Writer(store) as writer,
    ):
        while left:
            _run_round(plan, left, _Round(writer, tally, locks, progress, cluster, workers))
            left = _wait_for_others([planned for planned in left if planned.key not in tally.whole], store, progress)


class _Round(NamedTuple):
    """What a round of a sweep works with."""

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
    known = known_runs(left, store)
    for planned in left:
        remaining[planned.key], statuses = of.tally.resume(planned, known.get(planned.key, {}))
        if not remaining[planned.key]:
            of.progress.advance(statuses)
    groups = grouped(plan.cells, remaining)
    shared = Shared(of.locks, of.writer, groups, seen)
    if not groups:
        return
    order = Order(
        work=partial(run_task, store.folder.parent.absolute(), of.locks.mark.absolute()),  # a worker is elsewhere
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
    done = store.look([planned.key for planned in left]).done if left else set()
    for _ in done:
        progress.advance()
    if len(done) < len(left):
        notify("another process is running the rest of this sweep; its results are waited for")
        time.sleep(POLL_S)
    return [planned for planned in left if planned.key not in done]


def run_task(folder: Path, mark: Path, task: Task) -> Result:
    """Run some seeds of a cell; what takes long is stored on the way, the rest by whoever gets it.

    Args:
        folder: the study's.
        mark: a file in it; a worker that does not see it has another folder there, and only returns its rows.
        task: what to run.
    """
    planned = task.planned
    pieces = CellRun(planned.cell, planned.fingerprint).pieces(task.draws)
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

    def resume(self, planned: Planned, known: Mapping[int, str]) -> tuple[Sequence[int], list[str]]:
        """Take up the stored runs of a cell, the status of each seed; returns the seeds to run, and as `add` does."""
        self._statuses[planned.key] = dict(known)
        return missing(planned, known), self._whole(planned)

    def add(self, task: Task, result: Result) -> list[str]:
        """Add the runs of ``task``; returns the status of every run of its cell with the last of them."""
        statuses = self._statuses.setdefault(task.planned.key, {})
        statuses.update({int(row["seed"]): row["status"] for row in result.rows})
        return self._whole(task.planned)

    def _whole(self, planned: Planned) -> list[str]:
        if len(self._statuses[planned.key]) < len(planned.cell.draws):
            return []
        self.whole.add(planned.key)
        return list(self._statuses.pop(planned.key).values())


def _result(task: Task, outcome: Result | Exception) -> Result:
    """The rows of a task; failed ones, where its process could not say what became of it."""
    if isinstance(outcome, Exception):
        return Result(failed_rows(task.planned.cell, task.draws, f"{type(outcome).__name__}: {outcome}"), [], 0.0)
    return outcome


def _require_names(cells: Sequence[Cell]) -> None:
    """Refuse two cells that no column of the table would tell apart, and that are no shards of one."""
    cells_by_name: dict[object, list[Cell]] = {}
    for cell in cells:
        for namesake in cells_by_name.setdefault(cell.labels, []):
            _require_shards(cell, namesake)
        cells_by_name[cell.labels].append(cell)


def _require_shards(cell: Cell, namesake: Cell) -> None:
    """Refuse two cells of one name that differ in more than their seeds, or share some of these."""
    parts = [part for part in cell.spec if cell.spec[part] != namesake.spec[part]]
    named = ", ".join(cell.labels)
    if parts or replace(cell.protocol, seeds=1, first_seed=0) != replace(namesake.protocol, seeds=1, first_seed=0):
        raise PluginError(
            f"Two combinations would both be called {named}: they differ in {' and '.join(parts or ['the protocol'])} "
            "in a way that no column shows; run them into studies of their own (study=NAME)."
        )
    shared = range(max(cell.draws[0], namesake.draws[0]), min(cell.draws[-1], namesake.draws[-1]) + 1)
    if shared:
        raise PluginError(
            f"{named} would run {len(shared)} seeds twice, from {shared[0]} to {shared[-1]}: give first_seed values "
            f"that are seeds={cell.protocol.seeds} or more apart."
        )
