"""The own pool: processes of this machine as a `concurrent.futures.Executor`; one that dies costs its task alone."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from importlib import import_module
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.plain import keep_output_plain

GRACE_S = 5.0
"""So long a process may take to end."""


class _Worker(NamedTuple):
    """A process, and what came of its first work, the import of the user's plugins: without them it cannot go on."""

    executor: ProcessPoolExecutor
    imported: "Future[None]"


class OwnPool(Executor):
    """Processes that are started as they are needed; what is submitted goes to the one that was free last.

    So a process goes on with the recording that it has in memory, if whoever waits for it submits what is next.
    """

    def __init__(self) -> None:
        """Begin without a process."""
        self._idle: list[_Worker] = []
        self._all: list[_Worker] = []

    def submit(self, work: Callable[..., Any], /, *arguments: Any, **named: Any) -> "Future[Any]":  # noqa: ANN401 - goes to the work
        """Give work to a process that has none."""
        told: Future[Any] = Future()
        told.set_running_or_notify_cancel()
        while True:
            worker = self._idle.pop() if self._idle else self._started()
            with suppress(BrokenProcessPool):  # it has died while it had nothing to do
                done = worker.executor.submit(work, *arguments, **named)
                done.add_done_callback(partial(self._tell, worker, told))
                return told

    def _started(self) -> _Worker:
        executor = ProcessPoolExecutor(1, _Spawning(), initializer=_prepare)
        self._all.append(_Worker(executor, executor.submit(_import, plugins.modules_of_user())))
        return self._all[-1]

    def _tell(self, worker: _Worker, told: "Future[Any]", done: "Future[Any]") -> None:
        """Pass on what became of some work; a process that has died is not given any more."""
        error = ChildProcessError("it was ended") if done.cancelled() else done.exception()
        dead = done.cancelled() or isinstance(error, BrokenProcessPool)
        if not dead:
            self._idle.append(worker)
        if error is None:
            told.set_result(done.result())
        else:
            died = ChildProcessError("the process that ran it died") if dead else error
            told.set_exception(_lacking(worker) or died)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002 - Executor's signature
        """End the processes at once, whatever they are doing: what is done was told, the rest is not wanted."""
        children = [child for child in multiprocessing.active_children() if isinstance(child, _Process)]
        for worker in self._all:
            worker.executor.shutdown(wait=False, cancel_futures=True)
        for child in children:
            child.terminate()
        for child in children:
            child.join(GRACE_S)


def _lacking(worker: _Worker) -> PluginError | None:
    """Say that a process could not import the user's plugins."""
    failed = worker.imported.exception() if worker.imported.done() and not worker.imported.cancelled() else None
    if failed is None or isinstance(failed, BrokenProcessPool):
        return None
    said = f"{type(failed).__name__}: {failed}"
    return PluginError(f"A module of plugins cannot be imported where the runs are ({said}); correct it.")


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


def processors() -> int:
    """Return how many this process may use, which can be fewer than there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
