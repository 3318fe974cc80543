"""The rows of a sweep: what is planned, what runs, what is stored. Tables are made by whoever asks for it."""

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pandas as pd

from jerkbench.errors import PluginError
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.dispatch import Order, outcomes
from jerkbench.jobs.identity import identity_of
from jerkbench.jobs.key import WHAT, cell_key, data_fingerprint
from jerkbench.jobs.names import refusal
from jerkbench.jobs.pool import processor_kind
from jerkbench.jobs.preflight import require_inputs
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import CellRun, OnError, Piece, failed_rows, joined, pieces
from jerkbench.notices import notify
from jerkbench.results.store import Store
from jerkbench.results.study_remarks import set_aside
from jerkbench.sweep.locks import FOLDER, Locks, Shared, plan_name
from jerkbench.sweep.tasks import Done, Planned, Result, Task, Writer, grouped, in_order, missing

BUDGET_S = 2.0
"""So long a task takes at most, or one call longer; the rest of it is another, so that little is lost with a worker."""
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
    refused: dict[str, int] = {}
    checked: set[tuple[object, object]] = set()
    sensible = []
    for cell in cells:
        if reason := refusal(cell):
            refused[reason] = refused.get(reason, 0) + 1
            continue
        require_inputs(cell, checked)
        sensible.append(cell)
    plan = joined_plan(planned((cell, cell.draws) for cell in sensible))
    _require_names([each.cell for each in plan.cells])
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}." for reason, count in refused.items())
    return replace(plan, refused=lines)


def planned(cells: Iterable[tuple[Cell, Sequence[int]]]) -> list[Planned]:
    """Find the key of each cell with its draws."""
    fingerprints: dict[object, str] = {}
    found = []
    for cell, draws in cells:
        source = cell.dataset, cell.disturbances
        if source not in fingerprints:
            fingerprints[source] = data_fingerprint(*source)
        found.append(Planned(cell, cell_key(cell, fingerprints[source]), fingerprints[source], draws))
    return found


def joined_plan(cells: Iterable[Planned], refused: Iterable[str] = ()) -> Plan:
    """Return the plan of some cells, with the seeds of what is there twice joined."""
    first: dict[str, Planned] = {}
    draws: dict[str, set[int]] = {}
    for each in cells:
        first.setdefault(each.key, each)
        draws.setdefault(each.key, set()).update(each.draws)
    whole = (replace(each, draws=in_order(draws[key])) for key, each in first.items())
    return Plan(tuple(whole), tuple(refused))


def rows_of(cells: Sequence[Planned], store: Store, metrics: Sequence[str], *, any_code: bool = False) -> pd.DataFrame:
    """Return the stored rows of some cells, in their order and that of their seeds; without a status: not stored.

    Args:
        cells: with the seeds that are wanted.
        store: where they are.
        metrics: the columns that are wanted besides those of `Store.rows`.
        any_code: take what other code has computed, too.

    Returns:
        Their place (``place``) and the columns of `Store.rows`.
    """
    counts = [len(each.draws) for each in cells]
    wanted = pd.DataFrame(
        {
            "place": np.repeat(np.arange(len(cells)), counts),
            "what": np.repeat(np.array([each.key[:WHAT] for each in cells], dtype=object), counts),
            "seed": np.concatenate([[*each.draws] for each in cells]) if cells else [],
        }
    )
    stored = store.rows({each.key for each in cells}, metrics, any_code=any_code)
    return wanted.merge(stored, on=["what", "seed"], how="left").drop(columns="what")


def run_sweep(
    plan: Plan,
    store: Store,
    workers: Workers | None = None,
    *,
    strict: bool = False,
    progress: Progress | None = None,
    threads: int = 1,
    least: int = 1,
) -> None:
    """Run what is missing, on a cluster, with a progress bar; store every cell as it is finished.

    Of a cell that was begun before, only the seeds that are missing run; damaged files are set aside.

    Args:
        plan: what there is to run.
        store: where it goes.
        workers: who does it; default: this process.
        strict: raise what is wrong with the input or a plugin, in words, instead of storing failed rows.
        progress: a bar that is told of every cell; default: one of the cells of the plan.
        threads: how many the engine may use in each process.
        least: so many cells that can share their calls do, if there are as many.

    Raises:
        JerkbenchError: nothing can be written there, or as ``strict`` says.
        ClusterError: the cluster cannot go on; what is done is stored.
    """
    if damaged := store.prepare():
        notify(set_aside(damaged))
    left = _unfinished(plan.cells, store)
    folder = store.folder.parent / FOLDER
    tally, locks = Tally(), Locks(folder, plan_name(plan.cells))
    work = partial(run_task, strict=strict, threads=threads)
    done = len(plan.cells) - len(left)
    with _shown(progress, len(plan.cells), done) as bar, locks, Writer(store) as writer:
        while left:
            suspects = len(tally.suspects)
            _run_round(plan, left, _Round(work, writer, tally, locks, bar, workers or Workers(), strict, least))
            left = [planned for planned in left if planned.key not in tally.whole]
            if len(tally.suspects) == suspects:
                left = _wait_for_others(left, store, bar)


@contextmanager
def _shown(progress: Progress | None, cells: int, done: int) -> Iterator[Progress]:
    """Show the bar that is given, and count what is done already; or draw one."""
    if progress is None:
        with Progress(cells, done) as bar:
            yield bar
    else:
        progress.advance(count=done)
        yield progress


def _unfinished(cells: Sequence[Planned], store: Store) -> list[Planned]:
    """Return the cells of which runs are missing."""
    known = store.known(planned.key for planned in cells)
    return [planned for planned in cells if missing(planned, known.get(planned.key, ()))]


class _Round(NamedTuple):
    """What a round of a sweep works with."""

    work: Callable[[Task], Done]
    writer: Writer
    tally: "Tally"
    locks: Locks
    progress: Progress
    workers: Workers
    strict: bool
    least: int


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
    groups = grouped(plan.cells, remaining, of.least, of.tally.suspects)
    shared = Shared(of.locks, of.writer, groups, seen)
    if not groups:
        return
    order = Order(
        work=of.work,
        groups=groups,
        bundle=attrgetter("bundle"),
        admit=shared.admitted,
        rest=attrgetter("rest"),
        identity=cache(lambda: identity_of(planned.cell for planned in left)),
    )
    lent = of.workers.lent(sum(map(len, groups)))
    for task, outcome in outcomes(order, lent):
        for planned, result in zip(task.cells, _results(task, outcome, of), strict=False):
            of.writer.add(planned, result)
            if statuses := of.tally.add(planned, result):
                of.progress.advance(statuses)
        if isinstance(outcome, Exception) or outcome.rest is None:
            shared.settle(task)


def _wait_for_others(left: Sequence[Planned], store: Store, progress: Progress) -> list[Planned]:
    """Return what other processes have not done either, after a moment if there is any."""
    waiting = _unfinished(left, store) if left else []
    progress.advance(count=len(left) - len(waiting))
    if waiting:
        notify("another process is running the rest of this sweep; its results are waited for")
        time.sleep(POLL_S)
    return waiting


def run_task(task: Task, *, strict: bool = False, threads: int = 1) -> Done:
    """Run some seeds of some cells until the time is up.

    Args:
        task: what to run.
        strict: whether what is wrong is raised.
        threads: how many the engine may use.
    """
    on_error: OnError = "raise" if strict else "row"
    runs = [CellRun(planned.cell, planned.fingerprint, on_error, threads) for planned in task.cells]
    begun = time.perf_counter()
    for draw in task.draws:  # beforehand: the time of a run is that of the filter
        runs[0].begin(draw)
    began = time.perf_counter()
    done: list[list[Piece]] = []
    for each in pieces(runs, task.draws):
        done.append(each)
        if time.perf_counter() - began > BUDGET_S:
            break
    share, kind = 1.0 / len(runs), processor_kind()
    seconds, inputs_s = share * (time.perf_counter() - began), share * (began - begun)
    results = [Result(*joined(of_cell), seconds, kind, inputs_s) for of_cell in zip(*done, strict=True)]
    rest = task.draws[len(results[0].rows) :]
    return Done(results, task._replace(draws=rest) if rest else None)


class Tally:
    """The count of the finished runs of cells of which some are still running.

    Attributes:
        whole: keys of the cells of which none is.
        suspects: keys of the cells that lost a process together.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.whole: set[str] = set()
        self.suspects: set[str] = set()
        self._statuses: dict[str, dict[int, str]] = {}

    def resume(self, planned: Planned, known: Collection[int]) -> tuple[Sequence[int], list[str]]:
        """Take up the stored runs of a cell; returns the seeds to run, and as `add` does."""
        self._statuses[planned.key] = {draw: "" for draw in planned.draws if draw in known}
        return missing(planned, known), self._whole(planned)

    def add(self, planned: Planned, result: Result) -> list[str]:
        """Add runs of a cell; returns the status of every run of its cell with the last of them."""
        statuses = self._statuses.setdefault(planned.key, {})
        statuses.update({int(row["seed"]): row["status"] for row in result.rows})
        return self._whole(planned)

    def _whole(self, planned: Planned) -> list[str]:
        if len(self._statuses[planned.key]) < len(planned.draws):
            return []
        self.whole.add(planned.key)
        return list(self._statuses.pop(planned.key).values())


def _results(task: Task, outcome: Done | Exception, of: _Round) -> list[Result]:
    """The rows of a task; failed ones, where its process could not say what became of it.

    None of several cells, of which any may have ended it: each runs again by itself.
    """
    if not isinstance(outcome, Exception):
        return outcome.results
    if of.strict:
        raise outcome
    if len(task.cells) > 1:
        of.tally.suspects.update(planned.key for planned in task.cells)
        return []
    (planned,) = task.cells
    return [Result(failed_rows(planned.cell, task.draws, f"{type(outcome).__name__}: {outcome}"), [], 0.0)]


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
