"""Where tasks run: in this process, in the own pool, or on a cluster; opened once, when the first task comes.

The own pool are processes of this machine as a `concurrent.futures.Executor`; of one that dies the bundle runs again.
"""

import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, NamedTuple, Protocol

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.notices import keep_output_plain, shared_notices


class ClusterError(JerkbenchError):
    """A cluster that cannot go on; what is done is stored."""


class Lent(NamedTuple):
    """Workers that are there.

    Attributes:
        executor: takes work.
        slots: how much work may be on its way.
        trouble: says why no result will come any more; empty: one may.
        elsewhere: whether they may have other code than this process.
    """

    executor: Executor
    slots: Callable[[], int]
    trouble: Callable[[], str] = str
    elsewhere: bool = False


class Cluster(Protocol):
    """Somewhere to run tasks."""

    def open(self, workers: int) -> AbstractContextManager[Lent]:
        """Start ``workers`` processes, or reach those that there are.

        Raises:
            ClusterError: a package is not installed, or nobody answers.
        """
        ...


GRACE_S = 5.0
"""So long a process may take to end."""


@dataclass(eq=False)
class _Worker:
    """A process of the own pool.

    Attributes:
        executor: the process.
        imported: what came of its first work, the import of the user's plugins: without them it cannot go on.
        group: what it has worked for last; it has the recordings of that in memory.
    """

    executor: ProcessPoolExecutor
    imported: "Future[None]"
    group: Hashable = None


class OwnPool(Executor):
    """Processes that are started as they are needed; each goes on with the group whose recordings it has in memory."""

    def __init__(self) -> None:
        """Begin without a process."""
        self._idle: list[_Worker] = []
        self._all: list[_Worker] = []

    def submit(self, work: Callable[..., Any], /, *sent: Any, group: Hashable = None, **named: Any) -> "Future[Any]":  # noqa: ANN401 - goes to the work
        """Give work to a process that has none: to the one that worked for its ``group`` last, or was free last."""
        told: Future[Any] = Future()
        told.set_running_or_notify_cancel()
        while True:
            if self._idle:
                place = max(range(len(self._idle)), key=lambda k: (self._idle[k].group == group, k))
                worker = self._idle.pop(place)
            else:
                executor = ProcessPoolExecutor(1, _Spawning(), initializer=_prepare)
                worker = _Worker(executor, executor.submit(_import, plugins.modules_of_user()))
                self._all.append(worker)
            with suppress(BrokenProcessPool):  # it has died while it had nothing to do
                done = worker.executor.submit(work, *sent, **named)
                worker.group = group
                done.add_done_callback(partial(self._tell, worker, told))
                return told

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
    """Write plain text; Ctrl-C is for the parent, without which nothing is left to do."""
    keep_output_plain()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@dataclass(frozen=True)
class Local:
    """The processes of the own pool."""

    @contextmanager
    def open(self, workers: int) -> Iterator[Lent]:
        """Lend ``workers`` processes, of which each is started when it is needed."""
        with OwnPool() as pool:
            yield Lent(pool, lambda: workers)


LOCAL = Local()
"""The own pool of processes."""


class Workers(ExitStack):
    """The workers of a command, which are opened when the first task comes, and closed at its end."""

    def __init__(self, cluster: Cluster = LOCAL, count: int = 1) -> None:
        """Take ``count`` processes where the cluster starts them itself; with one of `LOCAL`, this process works."""
        super().__init__()
        self._cluster, self._count = cluster, count
        self._lent: Lent | None = None

    def lent(self, tasks: int) -> Lent | None:
        """Return who does so many tasks; None: this process.

        Raises:
            ClusterError: the cluster cannot be opened.
        """
        if self._lent is None and (self._cluster != LOCAL or min(self._count, tasks) > 1):
            self.enter_context(shared_notices())
            self._lent = self.enter_context(self._cluster.open(self._count))
        return self._lent


def required(module: str, cluster: str) -> ModuleType:
    """Return a module that a cluster needs, of the extra ``dask``.

    Raises:
        ClusterError: it is not installed; says how it would be.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise ClusterError(
            f"cluster={cluster} needs the package {error.name}, which is not installed: pip install 'jerkbench[dask]'."
        ) from error


def processors() -> int:
    """Return how many this process may use, which can be fewer than there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
