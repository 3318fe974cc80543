"""Chunks of tasks on their way to an executor and back. What a worker loses when it dies is run again."""

import gc
import math
import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from socket import gethostname
from typing import Any, Generic, TypeVar

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.jobs.executors import ClusterError, Pool
from jerkbench.jobs.key import code_digest, versions
from jerkbench.notices import keep_output_plain

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
Work = Callable[[Sequence[_Task]], tuple[int, _Result]]
"""Runs the first tasks of a chunk. Returns how many it has finished, and their result."""

MAX_DEATHS = 3
"""A task is given up after so many workers have died with it: with its chunk beside others, with it alone, alone."""
MAX_FIRST_DEATHS = 100
"""Workers may die so often before the first result: more can only mean that none of them can start."""
POLL_S = 2.0
"""Time without a result after which the executor is checked."""


@dataclass(eq=False)
class _Chunk(Generic[_Task]):
    """Tasks that are sent together, and how many workers have died with them."""

    tasks: list[_Task]
    deaths: int = 0


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
    waiting = deque(_Chunk(list(chunk)) for chunk in chunks)
    if pool is not None:
        yield from _Dispatch(work, waiting, pool, parts).outcomes()
        return
    while waiting:
        tasks = waiting.popleft().tasks
        count, result = work(tasks)
        yield tasks[:count], result
        if tasks[count:]:
            waiting.appendleft(_Chunk(tasks[count:]))


class _Dispatch(Generic[_Task, _Result]):
    def __init__(
        self,
        work: Work[_Task, _Result],
        waiting: deque[_Chunk[_Task]],
        pool: Pool,
        parts: Callable[[_Task], Sequence[_Task]],
    ) -> None:
        self.work, self.waiting, self.pool, self.parts = work, waiting, pool, parts
        self.suspects: deque[_Chunk[_Task]] = deque()  # one of them may end any worker: they run one at a time
        self.running: dict[Future[tuple[int, Any]], _Chunk[_Task]] = {}
        self.died = 0.0  # workers, before the first result
        self.identity = code_identity()

    def outcomes(self) -> Iterator[tuple[list[_Task], _Result | Exception]]:
        try:
            while self.waiting or self.suspects or self.running:
                yield from self._submit()
                if not self.running:
                    continue
                finished, _ = wait(self.running, POLL_S, FIRST_COMPLETED)
                for future in finished:
                    received = list(self._received(self.running.pop(future), future))
                    yield from self._submit()  # before the caller stores the results
                    yield from received
                if not finished and (trouble := self.pool.trouble()):
                    raise ClusterError(trouble)
        finally:
            for future in self.running:
                future.cancel()

    def _submit(self) -> Iterator[tuple[list[_Task], Exception]]:
        while (self.waiting or (self.suspects and not self.running)) and len(self.running) < self._slots():
            chunk = (self.waiting or self.suspects).popleft()
            try:
                content = pickle.dumps((self.work, chunk.tasks))
            except Exception as error:  # noqa: BLE001 - a plugin decides what pickling it raises
                yield from self._raised(chunk, error)
                continue
            sent = content, str(Path.cwd()), plugins.modules_of_user(), self.identity
            try:
                self.running[self.pool.executor.submit(run_chunk, *sent)] = chunk
            except Exception as error:
                raise ClusterError(self.pool.trouble() or f"The executor takes no tasks: {error}.") from error

    def _slots(self) -> int:
        try:
            return self.pool.slots()
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
        except Exception as error:  # noqa: BLE001 - each executor has exceptions of its own for a dead worker
            yield from self._died(chunk, error)
            return
        self.died = -math.inf  # workers can start here
        if isinstance(result, Exception):
            yield from self._raised(chunk, result)
            return
        yield chunk.tasks[:count], result
        rest = chunk.tasks[count:]
        halves = [rest] if self.waiting else [rest[: len(rest) // 2], rest[len(rest) // 2 :]]
        self.waiting.extendleft(_Chunk(half) for half in reversed(halves) if half)

    def _raised(self, chunk: _Chunk[_Task], error: Exception) -> Iterator[tuple[list[_Task], Exception]]:
        alone = [part for task in chunk.tasks for part in self.parts(task)]
        if len(alone) > 1:
            self.waiting.extendleft(_Chunk([part], chunk.deaths) for part in reversed(alone))
        else:
            yield chunk.tasks, error

    def _died(self, chunk: _Chunk[_Task], error: Exception) -> Iterator[tuple[list[_Task], Exception]]:
        deaths, self.died = chunk.deaths + 1, self.died + 1
        if self.died > MAX_FIRST_DEATHS:
            raise ClusterError(f"The worker processes end before they return anything ({error}).") from error
        if deaths < MAX_DEATHS - 1:
            self.suspects.append(_Chunk(chunk.tasks, deaths))
            return
        if deaths < MAX_DEATHS:
            self.suspects.extendleft(_Chunk([part], deaths) for task in chunk.tasks for part in self.parts(task))
            return
        said = " ".join(str(error).split())
        yield from (([task], ChildProcessError(f"its worker process died ({said})")) for task in chunk.tasks)


Identity = tuple[str, tuple[tuple[str, str], ...]]


def code_identity() -> Identity:
    """Return the digest of the code that workers need, and the versions of the libraries."""
    return code_digest("audit", "jobs", "suite", "tuning"), tuple(versions().items())


def run_chunk(content: bytes, folder: str, modules: Sequence[str], identity: Identity) -> tuple[int, Any]:
    """Run a chunk in a worker. An exception that it raises is returned, as it is not the end of the worker.

    Raises:
        ClusterError: the worker has different code than the process that planned.
    """
    if identity != code_identity():
        raise ClusterError(
            f"A worker on {gethostname()} has another version of jerkbench or of a library; install the same there."
        )
    try:
        _prepare(folder, tuple(modules))
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
