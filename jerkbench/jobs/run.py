"""The one loop: what is missing of a plan runs, here or on a cluster, and every row is stored as it comes.

Several processes may work in one folder: bundles of tasks are locked before they run, and left out where another
process has run them already.
"""

import hashlib
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from functools import cache, partial
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, Self
from uuid import uuid4

import pyarrow as pa
from filelock import FileLock, Timeout

from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.dispatch import Order, identity_of, outcomes
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.parts import RowBlock, table_of, to_stream
from jerkbench.jobs.plan import Plan, grouped, missing
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Done, Result, Row, Task, failed_rows, work
from jerkbench.jobs.store import Store
from jerkbench.notices import notify

POLL_S = 1.0
"""So long we wait before we look again for what other processes have done."""

HELD_S = 1.0
"""Results wait for others while tasks take less than that, for so long at most: a process that dies loses so much work,
and what it is just running. After ten seconds it is a tenth of the time so far, up to five times this: large files need
not be joined later."""
HELD_ROWS = 20_000
"""And so many rows are kept in memory."""

LOCKS_FOLDER = ".locks"
"""The folder of the locks, in the study's."""


def run_missing(
    plan: Plan,
    store: Store,
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
    done = len(plan.jobs) - len(left)
    shown = nullcontext(progress) if progress else Progress(len(plan.jobs), done)
    with shown as bar, locks, Writer(store, known) as writer:
        bar.skip(done if progress else 0)
        while left:
            to_do = {job.key: set(missing(job, known.get(job.key, ()))) for job in left}
            groups = grouped(plan.jobs, to_do, least)
            shared = Shared(groups, known, locks, writer)
            lent = workers.lent(sum(map(len, groups))) if workers and groups else None
            order = Order(
                work=partial(partial(sent, made_by=origin()) if lent else work, strict=strict, threads=threads),
                groups=groups,
                bundle=attrgetter("bundle"),
                admit=shared.admitted,
                rest=attrgetter("rest"),
                alone=Task.alone,
                identity=cache(partial(identity_of, left)),
            )
            for task, outcome in outcomes(order, lent):
                if not isinstance(outcome, Exception):
                    results, _, stream = outcome
                elif strict:
                    raise outcome
                else:  # its process could not say what became of it
                    reason = f"{type(outcome).__name__}: {outcome}"
                    results, stream = [Result(failed_rows(job, task.draws, reason), []) for job in task.jobs], None
                writer.add(task.jobs, results, stream)
                for job, result in zip(task.jobs, results, strict=True):
                    to_do[job.key].difference_update(row["seed"] for row in result.rows)
                    bar.advance([row["status"] for row in result.rows], count=not to_do[job.key])
                shared.settle(task.bundle, sum(len(result.rows) for result in results))
            writer.flush()  # others, who are waited for, may wait for it
            left = _wait_for_others([job for job in left if to_do[job.key]], known, bar)


class KnownSeeds(dict[str, set[int]]):
    """The seeds of the jobs of a plan that are stored, by key, as far as was looked."""

    def __init__(self, store: Store, jobs: Sequence[Job]) -> None:
        """Know nothing yet."""
        super().__init__()
        self._store, self._keys, self._files = store, {job.key for job in jobs}, set[str]()

    def look(self) -> None:
        """Read what is new in the store."""
        for key, seeds in self._store.known(self._keys, seen=self._files).items():
            self.setdefault(key, set()).update(seeds)

    def note(self, file: str, runs: Iterable[tuple[str, Sequence[Row]]]) -> None:
        """Know the rows of some keys that this process has stored itself, without reading them."""
        self._files.add(file)
        for key, rows in runs:
            self.setdefault(key, set()).update(row["seed"] for row in rows if row["status"] != "failed")

    def unfinished(self, jobs: Sequence[Job]) -> list[Job]:
        """Return the jobs of which runs are missing, after a look."""
        self.look()
        return [job for job in jobs if missing(job, self.get(job.key, ()))]


def _wait_for_others(left: Sequence[Job], known: KnownSeeds, progress: Progress) -> list[Job]:
    """Return what other processes have not done either, after a moment if there is any."""
    waiting = known.unfinished(left) if left else []
    progress.advance(count=len(left) - len(waiting))
    if waiting:
        notify("another process is running the rest of this sweep; its results are waited for")
        time.sleep(POLL_S)
    return waiting


# Rows on their way into the store.


class Writer:
    """Results on their way into a store: those of many tasks become one file of it.

    What is held is stored at the end, whatever has ended it.

    Attributes:
        store: where they go.
    """

    def __init__(self, store: Store, known: KnownSeeds) -> None:
        """Write into ``store``, and make it known."""
        self.store, self._known = store, known
        self._held, self._blocks, self._tables = list[tuple[str, Sequence[Row]]](), list[RowBlock](), list[pa.Table]()
        self._rows, self._written, self._after = 0, time.monotonic(), list[Callable[[], None]]()
        self._began = self._written

    def __enter__(self) -> Self:
        """Begin with nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Store what is held."""
        self.flush()

    def add(self, jobs: Sequence[Job], results: Sequence[Result], stream: pa.Buffer | None = None) -> None:
        """Take rows of some jobs; ``stream`` has their table, if that is made already."""
        self._blocks += map(block_of, jobs, results) if stream is None else ()
        self._tables += () if stream is None else [pa.ipc.open_stream(stream).read_all()]
        self._held += [(job.key, result.rows) for job, result in zip(jobs, results, strict=True)]
        self._rows += sum(len(result.rows) for result in results)
        if time.monotonic() - self._written > self.held_s or self._rows > HELD_ROWS:
            self.flush()

    @property
    def held_s(self) -> float:
        """So long results wait by now."""
        return HELD_S * min(max(0.1 * (time.monotonic() - self._began), 1.0), 5.0)

    def after(self, what: Callable[[], None]) -> None:
        """Do that as soon as what is held now is stored."""
        self._after.append(what)
        if not self._held:
            self.flush()

    def flush(self) -> None:
        """Store what is held as one file."""
        if self._held:
            self._known.note(self.store.write_blocks(self._blocks, self._tables), self._held)
        self._held, self._blocks, self._tables, self._rows, self._written = [], [], [], 0, time.monotonic()
        while self._after:
            self._after.pop()()


PACKED_ROWS = 100
"""From so many rows on a worker makes the table that is stored: the process that planned has enough to do. For fewer,
making and joining tables costs more than their rows do. More than `KEPT_INPUTS`: a table that cannot be made is of
several jobs, whose rows are sent apart then, and what is wrong is said where they are stored."""


def origin() -> dict[str, Any]:
    """Return what is stored with each run on the code that made it."""
    return {"code": code_digest(), "versions": versions(), "commit": git_commit()}


def sent(task: Task, made_by: Mapping[str, Any], **how: Any) -> Done:  # noqa: ANN401 - as `work` takes them
    """Run a task as `work` does, in a worker, and make the table of many rows; ``made_by`` is the plan's `origin`."""
    done = work(task, **how)
    if sum(len(result.rows) for result in done.results) < PACKED_ROWS:
        return done
    table = table_of([block_of(*own, made_by) for own in zip(task.jobs, done.results, strict=True)])
    results = [own._replace(rows=[{k: row[k] for k in ("seed", "status")} for row in own.rows]) for own in done.results]
    return Done(results, done.rest, to_stream(table))


def block_of(job: Job, result: Result, made_by: Mapping[str, Any] | None = None) -> RowBlock:
    """Return the runs of ``result`` as they are stored, with an `origin`; default: that of this process."""
    about = {
        "labels": job.labels._asdict(),
        "spec": job.spec,
        "protocol": job.evaluation.limits,
        "data": job.scenario.data,
        "notes": result.notes,
        **(made_by or origin()),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(result.seconds + result.inputs_s, 3),
        "run_s": float(f"{result.seconds / len(result.rows):.4g}"),
        "processor": result.processor,
    }
    return RowBlock(job.key, len(job.draws), result.rows, about)


# Bundles that are shared with other processes.


def plan_name(draws: Mapping[str, Sequence[int]]) -> str:
    """Name a plan by its keys and their seeds; its bundles have the same numbers in every process."""
    sha = hashlib.sha256()
    for key, own in draws.items():
        sha.update(f"{key} {own}\n".encode())
    return sha.hexdigest()[:12]


class Locks:
    """The locks of this process on the bundles of one plan. A lock ends with its process, whatever has ended that.

    Attributes:
        mark: a file of this process; a worker that sees it has this folder, and may store there.
    """

    def __init__(self, folder: Path, plan: str) -> None:
        """Lock in ``folder``; ``plan`` names the plan."""
        self._folder, self._plan = folder, plan
        self.mark = folder / f"{uuid4().hex}.process"
        self._held: dict[str, FileLock] = {}

    def __enter__(self) -> Self:
        """Say that this process is here."""
        while not self.mark.exists():
            self._folder.mkdir(parents=True, exist_ok=True)
            self._take(self.mark)
            with suppress(FileNotFoundError):  # another process has just cleared the folder
                self.mark.touch()
        return self

    def __exit__(self, *_: object) -> None:
        """Give up what is still locked; the last process clears the folder."""
        while self._held:
            self._held.popitem()[1].release()
        with suppress(OSError):  # what is left does no harm
            self.mark.unlink(missing_ok=True)
            if all(self._left_behind(path) for path in self._folder.glob("*.process")):
                for path in self._folder.iterdir():
                    path.unlink(missing_ok=True)
                self._folder.rmdir()

    def take(self, bundle: int) -> bool:
        """Lock a bundle; False where another process has it."""
        return self._take(self._folder / f"{self._plan}.{bundle}")

    def release(self, bundle: int) -> None:
        """Give up a bundle."""
        if lock := self._held.pop(f"{self._plan}.{bundle}", None):
            lock.release()

    def _take(self, path: Path) -> bool:
        lock = FileLock(f"{path}.lock", timeout=0, thread_local=False)
        try:
            lock.acquire()
        except Timeout:
            return False
        except (OSError, NotImplementedError):
            notify(f"{self._folder} can hold no locks: let one process at a time work there")
            return True
        self._held[path.name] = lock
        return True

    def _left_behind(self, mark: Path) -> bool:
        """Whether the process of a mark has ended."""
        ended = self._take(mark)
        if lock := self._held.pop(mark.name, None):
            lock.release()
        return ended


class Shared:
    """The tasks of one round, as far as they are for this process: other processes may work in the same folder."""

    def __init__(self, groups: Iterable[Sequence[Task]], known: KnownSeeds, locks: Locks, writer: Writer) -> None:
        """Begin with ``groups`` of which what is ``known`` is left out already."""
        self._known, self._locks, self._writer = known, locks, writer
        self._left, self._settled = Counter[int](), time.monotonic()
        for task in chain.from_iterable(groups):
            self._left[task.bundle] += task.runs
        self._taken: dict[int, bool] = {}

    def admitted(self, tasks: Sequence[Task]) -> list[Task]:
        """Return those of some tasks of one bundle that are to run here."""
        bundle = tasks[0].bundle
        if bundle not in self._taken and self._taken.setdefault(bundle, self._locks.take(bundle)):
            self._known.look()  # others may have done some of it before; while it is locked they do not
        if not self._taken[bundle]:
            return []
        done = [task for task in tasks if all(self._known.get(job.key, set()) >= {*task.draws} for job in task.jobs)]
        for task in done:
            self.settle(bundle, task.runs)
        return [task for task in tasks if task not in done]

    def settle(self, bundle: int, runs: int) -> None:
        """Count runs of a bundle as done; after the last one, when they are stored, the bundle is anybody's again."""
        self._left[bundle] -= runs
        if not self._left[bundle]:
            self._writer.after(partial(self._locks.release, bundle))
        if time.monotonic() - self._settled > self._writer.held_s:
            self._writer.flush()
        self._settled = time.monotonic()
