"""The pool of processes; a process goes on with cells of the recording that it has already."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from importlib import import_module
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Generic, TypeVar

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.notices import shared_notices
from jerkbench.plain import keep_output_plain

Task = TypeVar("Task")
Result = TypeVar("Result")

GRACE_S = 5.0
"""So long a process may take to end."""


def run_grouped(
    work: Callable[[Task], Result],
    groups: Iterable[list[Task]],
    workers: int,
    ended: Callable[[list[int]], None] | None = None,
    admit: Callable[[Task], bool] | None = None,
) -> Iterator[tuple[Task, Result | Exception]]:
    """Yield each task with its result as it is done, or with what kept it from being done (its process died).

    A worker takes the tasks of one group in their order. When no group is left it helps with the longest.

    Args:
        work: what is done with a task.
        groups: tasks.
        workers: number of processes; with one it is done here.
        ended: is told the numbers of the processes that were ended, whatever they were doing.
        admit: is asked when a task's turn has come; what it refuses is left out.
    """
    waiting = [group for group in groups if group]
    workers = min(workers, sum(map(len, waiting)))
    if workers <= 1:
        yield from ((task, work(task)) for group in waiting for task in group if admit is None or admit(task))
        return
    with shared_notices():
        yield from _pooled(_Pool(work, Groups(waiting, workers, admit), workers), ended)


def _pooled(
    pool: "_Pool[Task, Result]", ended: Callable[[list[int]], None] | None
) -> Iterator[tuple[Task, Result | Exception]]:
    """Yield what the pool does, and end its processes, whatever happens."""
    try:
        yield from pool.results()
    finally:
        numbers = pool.close()
        if ended is not None:
            ended(numbers)


class Groups(Generic[Task]):
    """Who is to do which task next."""

    def __init__(self, groups: Iterable[list[Task]], workers: int, admit: Callable[[Task], bool] | None = None) -> None:
        """Nobody has begun."""
        self._admit = admit
        self.waiting = [deque(group) for group in groups if group]
        self._current: list[deque[Task] | None] = [None] * workers

    def next_task(self, worker: int) -> Task | None:
        """Take the next task of the worker's group; of another, where its own is done; None where none is left."""
        while (task := self._pop(worker)) is not None:
            if self._admit is None or self._admit(task):
                return task
        return None

    def _pop(self, worker: int) -> Task | None:
        group = self._current[worker]
        if not group:
            untouched = [g for g in self.waiting if g and not any(g is current for current in self._current)]
            group = max(untouched or self.waiting, key=len)
            self._current[worker] = group
        return group.popleft() if group else None


class _Pool(Generic[Task, Result]):
    """One single-process executor a worker, so that it is known who has which recording in memory."""

    def __init__(self, work: Callable[[Task], Result], groups: Groups[Task], workers: int) -> None:
        self.work, self.groups = work, groups
        self.executors = [_executor() for _ in range(workers)]

    def results(self) -> Iterator[tuple[Task, Result | Exception]]:
        """Yield each task with its result, or with what kept it from being done."""
        running: dict[Future[Result], tuple[int, Task]] = {}
        for worker in range(len(self.executors)):
            self._start(worker, running)
        while running:
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                worker, task = running.pop(future)
                yield task, self._result(future, worker)
                self._start(worker, running)

    def close(self) -> list[int]:
        """End the workers at once, whatever they are doing: what is done is stored, the rest is not wanted."""
        children = multiprocessing.active_children()
        for executor, _ in self.executors:
            executor.shutdown(wait=False, cancel_futures=True)
        for child in children:
            child.terminate()
        for child in children:
            child.join(GRACE_S)
        return [child.pid for child in children if child.pid is not None and _has_ended(child)]

    def _start(self, worker: int, running: dict[Future[Result], tuple[int, Task]]) -> None:
        if (task := self.groups.next_task(worker)) is not None:
            running[self.executors[worker][0].submit(self.work, task)] = (worker, task)

    def _result(self, future: Future[Result], worker: int) -> Result | Exception:
        try:
            return future.result()
        except OSError:  # nothing more can be stored: the sweep has to end
            raise
        except BrokenProcessPool:
            failed = self.executors[worker][1].exception()
            self.executors[worker] = _executor()
            if failed is None or isinstance(failed, BrokenProcessPool):
                return ChildProcessError("the process that ran it died")
            said = f"{type(failed).__name__}: {failed}"
            return PluginError(f"A module of plugins cannot be imported where the runs are ({said}); correct it.")
        except Exception as error:  # noqa: BLE001 - a plugin that cannot be sent to a process, for example
            return error


def _has_ended(child: BaseProcess) -> bool:
    """Whether a process is gone; `is_alive` says no for a moment where the executor's thread has waited for it, too."""
    return bool(multiprocessing.connection.wait([child.sentinel], 0))


def _end_with_parent() -> None:
    """Wait for the parent's end: its queue would never say so, because this process holds both ends of it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


class _Process(SpawnProcess):
    """A process that does not run the user's script again: `spawn` imports the parent's ``__main__`` otherwise."""

    def start(self) -> None:
        """Start it while an empty module stands for the script."""
        script = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            super().start()
        finally:
            sys.modules["__main__"] = script


class _Spawning(SpawnContext):
    """Spawn: a forked process may hang in libraries that hold threads."""

    Process = _Process


def _executor() -> tuple[ProcessPoolExecutor, Future[None]]:
    """A process, and what came of its first work, the import of the user's plugins: without them it cannot go on."""
    executor = ProcessPoolExecutor(1, _Spawning(), initializer=_prepare)
    return executor, executor.submit(_import, plugins.modules_of_user())


def _import(modules: Iterable[str]) -> None:
    for module in modules:
        import_module(module)


def _prepare() -> None:
    """Use one thread; Ctrl-C is for the parent, without which nothing is left to do."""
    from threadpoolctl import threadpool_limits

    keep_output_plain()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpool_limits(1)


# The processors that we may use: how many, and which instructions they have.

ARITHMETIC = ("amx", "avx", "fma", "neon", "sse", "sve")
"""Beginnings of the names of instructions that decide in which order, and how often, sums are rounded."""


def processors() -> int:
    """Return how many this process may use, which can be fewer than there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def processor_kind() -> str:
    """Return what machine code is made for here: the processor's family, and its instructions for arithmetic."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    names = sorted(name for name, present in features.items() if present and name.startswith(ARITHMETIC))
    return f"{binding.get_host_cpu_name()}: {' '.join(names)}"
