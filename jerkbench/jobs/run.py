"""The one loop: what is missing of a plan runs, here or on a cluster, and every row is stored as it comes."""

import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, partial
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.dispatch import Order, outcomes
from jerkbench.jobs.identity import identity_of
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.locks import LOCKS_FOLDER, Locks, plan_name
from jerkbench.jobs.plan import Plan, grouped, missing
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Done, Result, Row, Task, failed_rows, work
from jerkbench.notices import notify

POLL_S = 1.0
"""So long we wait before we look again for what other processes have done."""
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


def run_missing(
    plan: Plan,
    store: RowStore,
    workers: Workers | None = None,
    *,
    strict: bool = False,
    progress: Progress | None = None,
    threads: int = 1,
    least: int = 1,
) -> None:
    """Run what is missing, on a cluster, with a progress bar; store every row soon after it has come.

    Of a job that was begun before, only the seeds that are missing run; damaged files are set aside.

    Args:
        plan: what there is to run.
        store: where it goes.
        workers: who does it; default: this process.
        strict: raise what is wrong with the input or a plugin, in words, instead of storing failed rows.
        progress: a bar that is told of every job; default: one of the jobs of the plan.
        threads: how many the engine may use in each process.
        least: so many jobs that can share their calls do, if there are as many.

    Raises:
        JerkbenchError: nothing can be written there, or as ``strict`` says.
        ClusterError: the cluster cannot go on; what is done is stored.
    """
    store.prepare()
    known = KnownSeeds(store, plan.jobs)
    left = known.unfinished(plan.jobs)
    locks = Locks(store.folder.parent / LOCKS_FOLDER, plan_name(plan.draws))
    with _shown(progress, len(plan.jobs), len(plan.jobs) - len(left)) as bar, locks, Writer(store) as writer:
        tally = Tally(bar)
        while left:
            remaining = {job.key: () for job in plan.jobs} | {job.key: tally.resume(job, known) for job in left}
            groups = grouped(plan.jobs, remaining, least)
            shared = Shared(groups, known, locks, writer)
            order = Order(
                work=partial(work, strict=strict, threads=threads),
                groups=groups,
                bundle=attrgetter("bundle"),
                admit=shared.admitted,
                rest=attrgetter("rest"),
                alone=Task.alone,
                identity=cache(partial(identity_of, left)),
            )
            lent = workers.lent(sum(map(len, groups))) if workers and groups else None
            for task, outcome in outcomes(order, lent):
                done = _done(task, outcome, strict=strict)
                for job, result in zip(task.jobs, done.results, strict=True):
                    writer.add(job, result)
                    tally.add(job, result)
                shared.settle(task.bundle, sum(len(result.rows) for result in done.results))
            left = _wait_for_others([job for job in left if job.key not in tally.whole], known, bar)


@contextmanager
def _shown(progress: Progress | None, jobs: int, done: int) -> Iterator[Progress]:
    """Show the bar that is given, and count what is done already; or draw one."""
    if progress is None:
        with Progress(jobs, done) as bar:
            yield bar
    else:
        progress.advance(count=done)
        yield progress


class KnownSeeds(dict[str, set[int]]):
    """The seeds of the jobs of a plan that are stored, by key, as far as was looked."""

    def __init__(self, store: RowStore, jobs: Sequence[Job]) -> None:
        """Know nothing yet."""
        super().__init__()
        self._store, self._keys, self._files = store, [job.key for job in jobs], set[str]()

    def look(self) -> None:
        """Read what is new in the store."""
        for key, seeds in self._store.known(self._keys, seen=self._files).items():
            self.setdefault(key, set()).update(seeds)

    def unfinished(self, jobs: Sequence[Job]) -> list[Job]:
        """Return the jobs of which runs are missing, after a look."""
        self.look()
        return [job for job in jobs if missing(job, self.get(job.key, ()))]


def _done(task: Task, outcome: Done | Exception, *, strict: bool) -> Done:
    """The rows of a task; failed ones, where its process could not say what became of it."""
    if not isinstance(outcome, Exception):
        return outcome
    if strict:
        raise outcome
    reason = f"{type(outcome).__name__}: {outcome}"
    return Done([Result(failed_rows(job, task.draws, reason), []) for job in task.jobs])


def _wait_for_others(left: Sequence[Job], known: KnownSeeds, progress: Progress) -> list[Job]:
    """Return what other processes have not done either, after a moment if there is any."""
    waiting = known.unfinished(left) if left else []
    progress.advance(count=len(left) - len(waiting))
    if waiting:
        notify("another process is running the rest of this sweep; its results are waited for")
        time.sleep(POLL_S)
    return waiting


class Tally:
    """The count of the finished runs of jobs of which some are still running.

    Attributes:
        whole: keys of the jobs of which none is.
    """

    def __init__(self, progress: Progress) -> None:
        """Begin with nothing; ``progress`` is told of every job that is whole."""
        self.whole: set[str] = set()
        self._statuses: dict[str, dict[int, str]] = {}
        self._progress = progress

    def resume(self, job: Job, known: Mapping[str, Collection[int]]) -> Sequence[int]:
        """Take up the stored runs of a job; returns the seeds to run."""
        own = known.get(job.key, ())
        self._statuses[job.key] = {draw: "" for draw in job.draws if draw in own}
        self._count(job)
        return missing(job, own)

    def add(self, job: Job, result: Result) -> None:
        """Add runs of a job."""
        self._statuses.setdefault(job.key, {}).update({int(row["seed"]): row["status"] for row in result.rows})
        self._count(job)

    def _count(self, job: Job) -> None:
        if len(self._statuses[job.key]) == len(job.draws):
            self.whole.add(job.key)
            self._progress.advance(list(self._statuses.pop(job.key).values()))


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


class Shared:
    """The tasks of one round, as far as they are for this process: other processes may work in the same folder."""

    def __init__(self, groups: Iterable[Sequence[Task]], known: KnownSeeds, locks: Locks, writer: Writer) -> None:
        """Begin with ``groups`` of which what is ``known`` is left out already."""
        self._known, self._locks, self._writer = known, locks, writer
        self._left = Counter[int]()
        for task in chain.from_iterable(groups):
            self._left[task.bundle] += task.runs
        self._taken: dict[int, bool] = {}

    def admitted(self, tasks: Sequence[Task]) -> list[Task]:
        """Return those of some tasks of one bundle that are to run here."""
        bundle = tasks[0].bundle
        if bundle not in self._taken:
            self._taken[bundle] = self._locks.take(bundle)
        if not self._taken[bundle]:
            return []
        self._known.look()
        done = [task for task in tasks if self._is_done(task)]
        for task in done:
            self.settle(bundle, task.runs)
        return [task for task in tasks if task not in done]

    def _is_done(self, task: Task) -> bool:
        return all(self._known.get(job.key, set()).issuperset(task.draws) for job in task.jobs)

    def settle(self, bundle: int, runs: int) -> None:
        """Count runs of a bundle as done; with the last one the bundle is anybody's again."""
        self._left[bundle] -= runs
        if not self._left[bundle]:
            self._writer.flush()  # before anybody else may have the bundle
            self._locks.release(bundle)
