"""The main loop of a sweep, which computes the runs that are not stored yet, and stores their rows.

The current process or an executor computes the runs. Several processes may write to one study, because each process
writes separate files. If two processes store the same run, only one of its rows counts.
"""

import gc
import math
import os
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from socket import gethostname
from typing import Any, Generic, Self, TypeVar

import pyarrow as pa

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError, make_output_plain
from jerkbench.jobs.executors import ClusterError, Pool, Workers
from jerkbench.jobs.key import code_digest, git_commit, plugin_packages, processor_kind, versions
from jerkbench.jobs.plan import Plan, chunks_of, missing
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import NotedRows, Task, failed_rows, shared_inputs, task_rows
from jerkbench.jobs.store import SEEN_COLUMNS, RowBlock, Store, table_of

MAX_CHUNK_S = 10.0
"""Time after which a worker returns its results [s]. The rest of its chunk is sent again, possibly to another worker,
which has to load the recordings again. Without workers, the rows of each task are stored as soon as it is finished."""

MIN_FLUSH_S, MAX_FLUSH_S = 1.0, 5.0
"""Limits of the interval between two files of rows [s]. Within the limits, the interval is 10 % of the elapsed time, so
that a long sweep does not write thousands of small files. A killed process loses the rows of one interval."""
MAX_HELD_ROWS = 20_000
"""Maximum number of rows in memory."""

MAX_DEATHS = 3
"""Number of dead workers after which a task has failed.

The task has then run in its chunk, again in its chunk while no other chunk was running, and finally alone.
"""
MAX_FIRST_DEATHS = 100
"""Maximum number of workers that may die before the first result. If more die, workers probably cannot start."""
POLL_S = 2.0
"""Time to wait for a result before the state of the executor is checked [s]."""


def run_missing(
    plan: Plan,
    store: Store,
    workers: Workers | None = None,
    *,
    strict: bool = False,
    progress: Progress | None = None,
    threads: int = 1,
) -> None:
    """Compute and store the runs of a plan that are not stored yet. Runs in damaged files are computed again.

    Args:
        plan: The plan with the jobs of the sweep.
        store: The store of the results.
        workers: The processes that compute the runs (by default, only the current process).
        strict: Whether to raise errors of inputs and plugins instead of storing rows with the status "failed".
        progress: The progress bar, which is advanced for every finished job (by default, a new bar).
        threads: Number of threads that the engine may use in each process.

    Raises:
        JerkbenchError: The results cannot be written, or an input or a plugin failed and ``strict`` is set.
        ClusterError: The cluster cannot continue. The results of the finished runs are stored.
    """
    store.prepare()
    known = store.known([job.key for job in plan.jobs])
    to_do = {job.key: set(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    chunks = chunks_of(plan.jobs, to_do, workers.count if workers else 1)
    made_by = origin()
    bar = progress or Progress(len(plan.jobs))
    bar.skip(sum(not seeds for seeds in to_do.values()))
    with nullcontext() if progress else bar, Writer(store) as writer:
        pool = workers.pool(sum(map(len, chunks))) if workers and chunks else None
        limit_s = MAX_CHUNK_S if pool else 0.0
        compute = partial(_run_tasks, made_by=made_by, strict=strict, threads=threads, limit_s=limit_s)
        for tasks, outcome in outcomes(compute, chunks, pool, Task.parts):
            if strict and isinstance(outcome, Exception):
                raise outcome
            table = _failed(tasks[0], outcome, made_by) if isinstance(outcome, Exception) else outcome
            writer.add(table)
            for key, seed, status in zip(*(table[name].to_pylist() for name in SEEN_COLUMNS), strict=True):
                to_do[key].discard(seed)
                bar.advance([status], count=not to_do[key])


def _run_tasks(tasks: Sequence[Task], *, limit_s: float, **options: Any) -> tuple[int, pa.Table]:  # noqa: ANN401 - of `work`
    """Run the first task, and further tasks until ``limit_s`` seconds have passed.

    Return the number of finished tasks, and a table with the rows of these tasks.
    """
    started, finished, blocks = time.monotonic(), 0, list[RowBlock]()
    while finished == 0 or (finished < len(tasks) and time.monotonic() - started < limit_s):
        blocks += work(tasks[finished], **options)
        finished += 1
    return finished, table_of(blocks)


def _failed(task: Task, error: Exception, made_by: Mapping[str, Any]) -> pa.Table:
    reason = f"{type(error).__name__}: {error}"
    return table_of(blocks_of(task, [(failed_rows(job, task.draws, reason), []) for job in task.jobs], made_by))


def work(task: Task, made_by: Mapping[str, Any], *, strict: bool = False, threads: int = 1) -> list[RowBlock]:
    """Run a task, and return the rows and the metadata of each of its jobs.

    Args:
        task: The task, which contains some seeds of one or several jobs.
        made_by: Provenance of the rows (code, versions, commit), as returned by `origin`.
        strict: Whether to raise errors of inputs and plugins instead of returning rows with the status "failed".
        threads: Number of threads that the engine may use.

    Raises:
        JerkbenchError: An input or a plugin failed, and ``strict`` is set.
    """
    inputs, scenario = shared_inputs(), task.jobs[0].scenario
    started = time.perf_counter()
    for draw in task.draws:  # load the inputs first, because the measured time must cover only the filter
        with suppress(Exception):  # the run raises the exception again, and its row gets the status "failed"
            inputs.attitude(inputs.recording(scenario, draw), scenario.attitude)
    prepared = time.perf_counter()
    pieces = task_rows(task, strict=strict, threads=threads)
    finished, share = time.perf_counter(), len(task.jobs)
    run_s = float(f"{(finished - prepared) / share / len(task.draws):.4g}")
    cost = {"seconds": round((finished - started) / share, 3), "run_s": run_s, "processor": processor_kind()}
    return blocks_of(task, pieces, {**made_by, **cost})


def blocks_of(task: Task, pieces: Iterable[NotedRows], made_by: Mapping[str, Any]) -> list[RowBlock]:
    """Return the rows and the metadata of each job of a task.

    The provenance ``made_by`` is added to the metadata of every job.
    """
    made_by = {**NO_COST, **made_by, "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    blocks = []
    for job, (rows, notes) in zip(task.jobs, pieces, strict=True):
        job_parts = {"labels": job.labels._asdict(), "spec": job.spec, "protocol": job.protocol.limits}
        metadata = {**job_parts, "data": job.scenario.data, "notes": notes, **made_by}
        blocks.append(RowBlock(job.key, len(job.draws), rows, metadata))
    return blocks


NO_COST = {"seconds": 0.0, "run_s": 0.0, "processor": ""}
"""Metadata about computing time and processor, for rows that were not computed."""


def origin() -> dict[str, Any]:
    """Return the provenance that is stored with each run: the hash of the code, the versions, and the commit."""
    return {"code": code_digest(), "versions": versions(), "packages": plugin_packages(), "commit": git_commit()}


class Writer:
    """A context manager that collects the rows of several tasks and writes them into one file.

    When the context ends, also by an exception, the remaining rows are written.
    """

    def __init__(self, store: Store) -> None:
        self._store, self._held = store, list[pa.Table]()
        self._started = self._written = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.flush()

    def add(self, table: pa.Table) -> None:
        """Add rows. If enough time has passed since the last file, or if too many rows are in memory, write a file."""
        self._held.append(table)
        now = time.monotonic()
        interval_s = min(max(0.1 * (now - self._started), MIN_FLUSH_S), MAX_FLUSH_S)
        if now - self._written > interval_s or sum(map(len, self._held)) > MAX_HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        """Write the rows that are in memory to a new file."""
        if self._held:
            self._store.write(self._held)
        self._held, self._written = [], time.monotonic()


_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
Work = Callable[[Sequence[_Task]], tuple[int, _Result]]
"""A function that runs the first tasks of a chunk. The function returns the number of finished tasks, and their result.
"""
Splitter = Callable[[_Task], Sequence[_Task]]
"""A function that divides a task into its smallest parts."""


def outcomes(
    work: Work[_Task, _Result],
    chunks: Iterable[Sequence[_Task]],
    pool: Pool | None,
    parts: Splitter[_Task] = lambda task: [task],
) -> Iterator[tuple[list[_Task], _Result | Exception]]:
    """Yield either a list of finished tasks with their result, or a list of one failed task with its exception.

    If a worker dies or raises an exception, each part of its tasks is run again separately, to find the part that
    fails.

    Args:
        work: The function that runs the tasks of a chunk.
        chunks: Lists of tasks. Each list (chunk) is sent to one worker.
        pool: The executor that calls ``work``. If ``pool`` is None, the current process calls ``work``, and exceptions
            of ``work`` are not caught.
        parts: Function that divides a task into its smallest parts.

    Raises:
        ClusterError: A worker has another version of the code, or the executor cannot continue.
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
    """Tasks that are sent together to one worker, and the number of workers that died while running these tasks."""

    tasks: list[_Task]
    deaths: int = 0


class _Dispatch(Generic[_Task, _Result]):
    """Submits chunks of tasks to an executor, and receives their results."""

    def __init__(
        self, work: Work[_Task, _Result], chunks: Iterable[Sequence[_Task]], pool: Pool, parts: Splitter[_Task]
    ) -> None:
        self.work, self.pool, self.parts = work, pool, parts
        self.waiting = deque(_Chunk(list(chunk)) for chunk in chunks)
        self.suspects: deque[_Chunk[_Task]] = deque()  # chunks with which a worker died run one at a time
        self.running: dict[Future[tuple[int, Any]], _Chunk[_Task]] = {}
        self.deaths = 0.0  # number of workers that died before the first result

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
        while (self.waiting or (self.suspects and not self.running)) and len(self.running) < self._call(
            self.pool.slots
        ):
            chunk = (self.waiting or self.suspects).popleft()
            try:
                content = pickle.dumps((self.work, chunk.tasks))
            except Exception as error:  # noqa: BLE001 - pickling a plugin may raise any exception
                yield from self._raised(chunk, error)
                continue
            sent = content, str(Path.cwd()), tuple(plugins.modules_of_user()), identity
            self.running[self._call(self.pool.executor.submit, run_chunk, *sent)] = chunk

    def _call(self, call: Callable[..., Any], *arguments: object) -> Any:  # noqa: ANN401 - of the call
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
        except Exception as error:  # noqa: BLE001 - each executor has different exceptions for a dead worker
            yield from self._died(chunk, error)
            return
        self.deaths = -math.inf  # a result shows that workers can start
        if isinstance(result, Exception):
            yield from self._raised(chunk, result)
            return
        yield chunk.tasks[:count], result
        rest = chunk.tasks[count:]
        middle = 0 if self.waiting else len(rest) // 2  # without waiting chunks, two workers share the rest
        self.waiting.extendleft(_Chunk(half) for half in (rest[middle:], rest[:middle]) if half)

    def _raised(self, chunk: _Chunk[_Task], error: Exception) -> Iterator[tuple[list[_Task], Exception]]:
        parts = [part for task in chunk.tasks for part in self.parts(task)]
        if len(parts) > 1:
            self.waiting.extendleft(_Chunk([part], chunk.deaths) for part in reversed(parts))
        else:
            yield chunk.tasks, error

    def _died(self, chunk: _Chunk[_Task], error: Exception) -> Iterator[tuple[list[_Task], Exception]]:
        deaths, self.deaths = chunk.deaths + 1, self.deaths + 1
        if self.deaths > MAX_FIRST_DEATHS:
            raise ClusterError(f"The worker processes end before they return a result ({error}).") from error
        if deaths < MAX_DEATHS - 1:
            self.suspects.append(_Chunk(chunk.tasks, deaths))
        elif deaths < MAX_DEATHS:
            self.suspects.extendleft(_Chunk([part], deaths) for task in chunk.tasks for part in self.parts(task))
        else:
            message = f"its worker process died ({' '.join(str(error).split())})"
            yield from (([task], ChildProcessError(message)) for task in chunk.tasks)


def code_identity() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return the hash of the code that computes and stores rows, and the versions of the libraries."""
    return code_digest("jobs", "campaign"), tuple(versions().items())


def run_chunk(content: bytes, folder: str, modules: tuple[str, ...], identity: object) -> tuple[int, Any]:
    """Run a chunk of tasks in a worker. The worker returns an exception of a task instead of raising it, and continues.

    Raises:
        ClusterError: The worker and the process that sent the chunk have different versions of the code.
    """
    if identity != code_identity():
        other = "another version of jerkbench or of a library; install the same version"
        raise ClusterError(f"A worker on {gethostname()} has {other}.")
    try:
        _prepare(folder, modules)
        work, tasks = pickle.loads(content)  # noqa: S301 - sent by this user through their own cluster
        result: tuple[int, Any] = work(tasks)
    except JerkbenchError as error:
        return 0, error
    except Exception as error:  # noqa: BLE001 - an exception class of a plugin may not survive pickling
        return 0, ChildProcessError(f"{type(error).__name__}: {error}")
    gc.collect(1)  # frees reference cycles of plugins, because automatic collections are rare
    return result


@cache
def _prepare(folder: str, modules: tuple[str, ...]) -> None:
    """Prepare a worker: import the user's plugins, limit libraries to one thread, and change the working directory.

    The new working directory is the directory of the process that sent the chunk, because paths may be relative.
    Automatic garbage collections are made rare, because they took a tenth of the computing time. The function
    `run_chunk` starts the garbage collector after each chunk of tasks.
    """
    from threadpoolctl import threadpool_limits

    gc.set_threshold(50_000, 20, 100)
    make_output_plain()
    threadpool_limits(1)
    if Path(folder).is_dir():
        os.chdir(folder)
    for module in modules:
        try:
            import_module(module)
        except Exception as error:
            reason = f"({type(error).__name__}: {error})"
            raise PluginError(f"The plugin module {module} cannot be imported in a worker process {reason}.") from error
