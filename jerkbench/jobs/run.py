"""The loop of a sweep: the missing runs of a plan are computed, in this process or by an executor, and stored.

Several processes may write to one study. Each writes files of its own, and a row that exists twice counts once.
"""

import gc
import math
import os
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from socket import gethostname
from typing import Any, Generic, Self, TypeVar

import pyarrow as pa

from jerkbench import plugins
from jerkbench.engines import announce
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.jobs.executors import ClusterError, Pool, Workers
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.plan import Plan, chunks_of, missing
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Result, Task, failed_rows, streams, work
from jerkbench.jobs.store import SEEN_COLUMNS, RowBlock, Store, table_of
from jerkbench.notices import keep_output_plain

MAX_CHUNK_S = 10.0
"""A worker returns its results after this time, and the rest of its chunk is sent again, maybe to another worker, which
has to prepare its recordings once more. In this process each task is stored as it is finished."""

MIN_FLUSH_S, MAX_FLUSH_S = 1.0, 5.0
"""Rows are written in batches. The interval is 10 % of the elapsed time within these limits, so that a long sweep does
not leave thousands of small files. A process that is killed loses one interval."""
MAX_HELD_ROWS = 20_000
"""Rows that wait in memory to be written."""

MAX_DEATHS = 3
"""A task has failed after so many workers have died with it: with its chunk, with its chunk alone, and by itself."""
MAX_FIRST_DEATHS = 100
"""If so many workers die before the first result, none of them can start."""
POLL_S = 2.0
"""Time without a result after which the executor is checked."""


def run_missing(
    plan: Plan,
    store: Store,
    workers: Workers | None = None,
    *,
    strict: bool = False,
    progress: Progress | None = None,
    threads: int = 1,
) -> None:
    """Compute the runs of a plan that are not stored, and store them. Damaged files are set aside.

    Args:
        plan: the jobs.
        store: their results.
        workers: where they run; default: this process.
        strict: raise an error of the input or of a plugin instead of storing it as a failed row.
        progress: a bar that is advanced for every finished job; default: a new one.
        threads: number of threads that the engine may use in each process.

    Raises:
        JerkbenchError: the results cannot be written, or as ``strict`` says.
        ClusterError: the cluster cannot continue. Finished runs are stored.
    """
    store.prepare()
    known = store.known([job.key for job in plan.jobs])
    to_do = {job.key: set(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    done = sum(not seeds for seeds in to_do.values())
    chunks = chunks_of(plan.jobs, to_do, workers.count if workers else 1)
    made_by = origin()
    announce([job.method for job in plan.jobs if to_do[job.key] and streams(job)])
    with nullcontext(progress) if progress else Progress(len(plan.jobs), done) as bar, Writer(store) as writer:
        bar.skip(done if progress else 0)
        pool = workers.pool(sum(map(len, chunks))) if workers and chunks else None
        limit_s = MAX_CHUNK_S if pool else 0.0
        compute = partial(_run_tasks, made_by=made_by, strict=strict, threads=threads, limit_s=limit_s)
        for tasks, outcome in outcomes(compute, chunks, pool, Task.parts):
            if strict and isinstance(outcome, Exception):
                raise outcome
            table = _failed(tasks[0], outcome, made_by) if isinstance(outcome, Exception) else outcome
            writer.add(table)
            statuses: dict[str, list[str]] = {}
            for key, seed, status in zip(*(table[name].to_pylist() for name in SEEN_COLUMNS), strict=True):
                to_do[key].discard(seed)
                statuses.setdefault(key, []).append(status)
            for key, of_job in statuses.items():
                bar.advance(of_job, count=not to_do[key])


def _run_tasks(
    tasks: Sequence[Task], *, made_by: Mapping[str, Any], strict: bool, threads: int, limit_s: float
) -> tuple[int, pa.Table]:
    """Run tasks for about ``limit_s``, at least one. Returns how many are finished, and their rows."""
    started, finished, blocks = time.monotonic(), 0, list[RowBlock]()
    while finished == 0 or (finished < len(tasks) and time.monotonic() - started < limit_s):
        task = tasks[finished]
        results = work(task, strict=strict, threads=threads)
        blocks += [block_of(job, result, made_by) for job, result in zip(task.jobs, results, strict=True)]
        finished += 1
    return finished, table_of(blocks)


def _failed(task: Task, error: Exception, made_by: Mapping[str, Any]) -> pa.Table:
    reason = f"{type(error).__name__}: {error}"
    return table_of([block_of(job, Result(failed_rows(job, task.draws, reason), []), made_by) for job in task.jobs])


def origin() -> dict[str, Any]:
    """Return the provenance that is stored with each run: code, versions, commit."""
    return {"code": code_digest(), "versions": versions(), "commit": git_commit()}


def block_of(job: Job, result: Result, made_by: Mapping[str, Any] | None = None) -> RowBlock:
    """Return the rows of a job as they are stored, with their provenance (default: `origin`)."""
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


class Writer:
    """Writes rows to a store, those of many tasks into one file, and the last ones also after an error."""

    def __init__(self, store: Store) -> None:
        """Write to ``store``."""
        self._store, self._held = store, list[pa.Table]()
        self._started = self._written = time.monotonic()

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Write the last rows."""
        self.flush()

    def add(self, table: pa.Table) -> None:
        """Accept rows, and write them if the last file is old enough."""
        self._held.append(table)
        now = time.monotonic()
        interval_s = min(max(0.1 * (now - self._started), MIN_FLUSH_S), MAX_FLUSH_S)
        if now - self._written > interval_s or sum(map(len, self._held)) > MAX_HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        """Write a file."""
        if self._held:
            self._store.write(self._held)
        self._held, self._written = [], time.monotonic()


_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
Work = Callable[[Sequence[_Task]], tuple[int, _Result]]
"""Runs the first tasks of a chunk. Returns how many it has finished, and their result."""


def outcomes(
    work: Work[_Task, _Result],
    chunks: Iterable[Sequence[_Task]],
    pool: Pool | None,
    parts: Callable[[_Task], Sequence[_Task]] = lambda task: [task],
) -> Iterator[tuple[list[_Task], _Result | Exception]]:
    """Yield the tasks that are finished, with their result, or a single task with the exception that ended it.

    If a worker dies or raises an exception, the parts of its tasks are run again alone, to find the one that causes it.

    Args:
        work: is called with the tasks of a chunk.
        chunks: the tasks, in order.
        pool: where they run. None: in this process, which raises what `work` raises.
        parts: cuts a task into its smallest parts.

    Raises:
        ClusterError: a worker has different code, or no result can come any more.
    """
    if pool is not None:
        yield from _Dispatch(work, chunks, pool, parts).outcomes()
        return
    for chunk in chunks:
        tasks = list(chunk)
        while tasks:
            count, result = work(tasks)
            yield tasks[:count], result
            tasks = tasks[count:]


@dataclass(eq=False)
class _Chunk(Generic[_Task]):
    """Tasks that are sent together, and the number of workers that have died with them."""

    tasks: list[_Task]
    deaths: int = 0


class _Dispatch(Generic[_Task, _Result]):
    """Chunks on their way to an executor and back."""

    def __init__(
        self,
        work: Work[_Task, _Result],
        chunks: Iterable[Sequence[_Task]],
        pool: Pool,
        parts: Callable[[_Task], Sequence[_Task]],
    ) -> None:
        self.work, self.pool, self.parts = work, pool, parts
        self.waiting = deque(_Chunk(list(chunk)) for chunk in chunks)
        self.suspects: deque[_Chunk[_Task]] = deque()  # one of them may kill any worker: they run one at a time
        self.running: dict[Future[tuple[int, Any]], _Chunk[_Task]] = {}
        self.deaths = 0.0  # of workers, before the first result

    def outcomes(self) -> Iterator[tuple[list[_Task], _Result | Exception]]:
        try:
            while self.waiting or self.suspects or self.running:
                yield from self._submit()
                finished, _ = wait(self.running, POLL_S, FIRST_COMPLETED)
                for future in finished:
                    yield from self._received(self.running.pop(future), future)
                if not finished and (trouble := self.pool.trouble()):
                    raise ClusterError(trouble)
        finally:
            for future in self.running:
                future.cancel()

    def _submit(self) -> Iterator[tuple[list[_Task], Exception]]:
        identity = code_identity()
        while (self.waiting or (self.suspects and not self.running)) and len(self.running) < self._ask(self.pool.slots):
            chunk = (self.waiting or self.suspects).popleft()
            try:
                content = pickle.dumps((self.work, chunk.tasks))
            except Exception as error:  # noqa: BLE001 - a plugin decides what pickling it raises
                yield from self._raised(chunk, error)
                continue
            sent = content, str(Path.cwd()), tuple(plugins.modules_of_user()), identity
            self.running[self._ask(self.pool.executor.submit, run_chunk, *sent)] = chunk

    def _ask(self, call: Callable[..., Any], *arguments: object) -> Any:  # noqa: ANN401 - of the call
        try:
            return call(*arguments)
        except Exception as error:
            raise ClusterError(self.pool.trouble() or f"The cluster does not answer: {error}.") from error

    def _received(
        self, chunk: _Chunk[_Task], future: "Future[tuple[int, Any]]"
    ) -> Iterator[tuple[list[_Task], _Result | Exception]]:
        try:
            count, result = future.result()
        except ClusterError:
            raise
        except CancelledError as error:
            raise ClusterError(self.pool.trouble() or "The cluster has cancelled the tasks.") from error
        except Exception as error:  # noqa: BLE001 - each executor has its own exceptions for a dead worker
            yield from self._died(chunk, error)
            return
        self.deaths = -math.inf  # workers can start
        if isinstance(result, Exception):
            yield from self._raised(chunk, result)
            return
        yield chunk.tasks[:count], result
        rest = chunk.tasks[count:]
        middle = 0 if self.waiting else len(rest) // 2  # at the end, two workers share the rest
        self.waiting.extendleft(_Chunk(half) for half in (rest[middle:], rest[:middle]) if half)

    def _raised(self, chunk: _Chunk[_Task], error: Exception) -> Iterator[tuple[list[_Task], Exception]]:
        alone = [part for task in chunk.tasks for part in self.parts(task)]
        if len(alone) > 1:
            self.waiting.extendleft(_Chunk([part], chunk.deaths) for part in reversed(alone))
        else:
            yield chunk.tasks, error

    def _died(self, chunk: _Chunk[_Task], error: Exception) -> Iterator[tuple[list[_Task], Exception]]:
        deaths, self.deaths = chunk.deaths + 1, self.deaths + 1
        if self.deaths > MAX_FIRST_DEATHS:
            raise ClusterError(f"The worker processes end before they return anything ({error}).") from error
        if deaths < MAX_DEATHS - 1:
            self.suspects.append(_Chunk(chunk.tasks, deaths))
        elif deaths < MAX_DEATHS:
            self.suspects.extendleft(_Chunk([part], deaths) for task in chunk.tasks for part in self.parts(task))
        else:
            message = f"its worker process died ({' '.join(str(error).split())})"
            yield from (([task], ChildProcessError(message)) for task in chunk.tasks)


def code_identity() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return the hash of the code that a worker runs and stores with, and the versions of its libraries."""
    return code_digest("jobs", "campaign"), tuple(versions().items())


def run_chunk(content: bytes, folder: str, modules: tuple[str, ...], identity: object) -> tuple[int, Any]:
    """Run a chunk in a worker. An exception is returned as the result, because it does not end the worker.

    Raises:
        ClusterError: the worker has different code than the process that planned.
    """
    if identity != code_identity():
        raise ClusterError(
            f"A worker on {gethostname()} has another version of jerkbench or of a library; install the same there."
        )
    try:
        _prepare(folder, modules)
        work, tasks = pickle.loads(content)  # noqa: S301 - from the process that planned, through its own cluster
        result: tuple[int, Any] = work(tasks)
    except JerkbenchError as error:
        return 0, error
    except Exception as error:  # noqa: BLE001 - an exception class of a plugin may not survive pickling
        return 0, ChildProcessError(f"{type(error).__name__}: {error}")
    gc.collect(1)  # cycles of plugins
    return result


@cache
def _prepare(folder: str, modules: tuple[str, ...]) -> None:
    """Import the user's plugins, use one thread, and work in the folder of the plan: its paths may be relative.

    The garbage collector runs as rarely as in a command (it took a tenth of a run), and after each chunk.
    """
    from threadpoolctl import threadpool_limits

    gc.set_threshold(50_000, 20, 100)
    keep_output_plain()
    threadpool_limits(1)
    if Path(folder).is_dir():
        os.chdir(folder)
    for module in modules:
        try:
            import_module(module)
        except Exception as error:
            raise PluginError(
                f"The plugin module {module} cannot be imported in a worker process ({type(error).__name__}: {error})."
            ) from error
