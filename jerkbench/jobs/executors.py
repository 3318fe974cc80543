"""Executors of a sweep: processes of this machine, a Dask cluster, or the jobs of a queue."""

import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any, NamedTuple, Protocol

from jerkbench.errors import JerkbenchError
from jerkbench.notices import shared_notices


class ClusterError(JerkbenchError):
    """A cluster that cannot continue. Finished runs are stored."""


class Pool(NamedTuple):
    """An open executor.

    Attributes:
        executor: takes calls.
        slots: returns how many calls may be submitted at the same time.
        trouble: returns why no result can come any more, or an empty string.
    """

    executor: Executor
    slots: Callable[[], int]
    trouble: Callable[[], str] = str


class Cluster(Protocol):
    """A place that can run tasks."""

    def open(self, workers: int) -> AbstractContextManager[Pool]:
        """Start ``workers`` processes, or connect to those that are running.

        Raises:
            ClusterError: a package is not installed, or the scheduler does not answer.
        """
        ...


class Workers(ExitStack):
    """The workers of a command. They are started with the first task and stopped at the end of the command."""

    def __init__(self, cluster: "Cluster | None" = None, count: int = 1) -> None:
        """Use ``count`` processes if the cluster starts them itself; one local worker is this process."""
        super().__init__()
        self._cluster, self._count = cluster or LOCAL, count
        self._pool: Pool | None = None

    @property
    def count(self) -> int:
        """Number of processes."""
        return self._count

    def pool(self, tasks: int) -> Pool | None:
        """Return the pool for this number of tasks. None: they run in this process.

        Raises:
            ClusterError: the cluster cannot be opened.
        """
        if self._pool is None and (self._cluster != LOCAL or min(self._count, tasks) > 1):
            self.enter_context(shared_notices())
            self._pool = self.enter_context(self._cluster.open(self._count))
        return self._pool


def processors() -> int:
    """Return the number of processors that this process may use. It can be smaller than that of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Local:
    """Processes of this machine."""

    @contextmanager
    def open(self, workers: int) -> Iterator[Pool]:
        """Start up to ``workers`` processes, each when it is needed."""
        executor = LocalExecutor(workers)
        try:
            yield Pool(executor, lambda: workers + 1)  # one call waits, so that no worker does
        finally:
            executor.shutdown()


LOCAL = Local()
"""The processes of this machine."""

GRACE_S = 5.0
"""Time that a terminated process gets to end."""

_SPAWN = multiprocessing.get_context("spawn")
"""A forked process may hang in libraries that hold threads."""


class LocalExecutor(Executor):
    """A process pool that starts again after one of its processes has died.

    The processes end as soon as the pipe to this process is closed: by `shutdown`, or because this process has died.
    """

    def __init__(self, workers: int) -> None:
        """Use up to ``workers`` processes."""
        self._children: set[BaseProcess] = set()
        self._workers = min(workers, 61) if sys.platform == "win32" else workers  # the limit of Windows
        self._start()

    def _start(self) -> None:
        self._reader, self._writer = _SPAWN.Pipe(duplex=False)
        self._pool = ProcessPoolExecutor(self._workers, _SPAWN, _start_worker, (self._reader,))

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401 - of the call
        """Submit a call, to a new pool if the last one is broken."""
        before = {*multiprocessing.active_children()}
        with _without_script():
            try:
                return self._pool.submit(call, *arguments, **named)
            except BrokenProcessPool:
                self.shutdown()
                self._start()
                return self._pool.submit(call, *arguments, **named)
            finally:
                self._children |= {*multiprocessing.active_children()} - before

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """Terminate the processes: finished results have been received, and the others are not needed.

        Nothing waits for the pool itself: a process that is terminated while it writes leaves it without an answer.
        """
        self._writer.close()
        self._pool.shutdown(wait=False, cancel_futures=cancel_futures)
        for child in self._children:
            child.terminate()  # also while compiled code holds the interpreter
        for child in self._children if wait else ():
            child.join(GRACE_S)
        self._children.clear()
        self._reader.close()


@contextmanager
def _without_script() -> Iterator[None]:
    """Hide the user's script: `spawn` imports the parent's ``__main__``, so each new process would run it again."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def _start_worker(reader: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    threading.Thread(target=_end_with_parent, args=(reader,), daemon=True).start()


def _end_with_parent(reader: Connection) -> None:
    reader.poll(None)  # returns when the pipe is closed
    os._exit(1)


ANSWER_S = 30.0
"""Time that a Dask scheduler gets to answer."""


@dataclass(frozen=True)
class Dask:
    """A Dask cluster.

    Attributes:
        address: of a running scheduler, "tcp://HOST:8786"; empty: processes of this machine are started.
    """

    address: str = ""

    @contextmanager
    def open(self, workers: int) -> Iterator[Pool]:
        """Connect to the scheduler, or start processes."""
        distributed = required("distributed", "dask")
        with _quiet(), _connected(distributed, self.address or self._local_cluster(distributed, workers)) as pool:
            yield pool

    def _local_cluster(self, distributed: Any, workers: int) -> Any:  # noqa: ANN401 - Dask has no types
        return distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,  # a run holds the interpreter
            memory_limit=0,
            dashboard_address=":0",  # Dask warns if its usual port is in use
            scheduler_kwargs={"dashboard": False},
            silence_logs=logging.CRITICAL,
            preload=[__name__],
        )


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C to the parent, which ends its workers. Dask calls this function in each local worker."""
    del worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@dataclass(frozen=True)
class JobQueue:
    """Jobs of a queue (SLURM, PBS or LSF), each with some Dask workers. The scheduler is this process.

    Attributes:
        system: slurm, pbs or lsf.
        jobs: number of jobs; one that is lost is submitted again.
        processes: worker processes of a job, one core each.
        memory: of a job, "8GB".
        walltime: of a job, in the format of the queue: "01:00:00".
        queue: partition or queue; empty: the system's default.
        account: account that is charged; empty: the system's default.
        interface: network interface by which workers reach this process, "ib0"; empty: Dask looks for one.
        directives: more lines for the head of a job's script: ["--exclusive"].
        prologue: commands of a job before its workers start: ["module load python"].
        python: interpreter of the workers; empty: this one, at the same path.
        logs: folder of the jobs' output; empty: the system's default.
    """

    system: str
    jobs: int = 2
    processes: int = 1
    memory: str = "4GB"
    walltime: str = "01:00:00"
    queue: str = ""
    account: str = ""
    interface: str = ""
    directives: list[str] = field(default_factory=list)
    prologue: list[str] = field(default_factory=list)
    python: str = ""
    logs: str = ""

    @contextmanager
    def open(self, workers: int) -> Iterator[Pool]:
        """Submit the jobs. Work starts with the first one that runs."""
        del workers  # jobs and processes give the number
        distributed = required("distributed", self.system)
        with _quiet():
            cluster = self._cluster()
            with _connected(distributed, cluster) as pool:
                cluster.adapt(minimum_jobs=self.jobs, maximum_jobs=self.jobs)  # submits another job if one is lost
                yield pool

    def _cluster(self) -> Any:  # noqa: ANN401 - dask-jobqueue has no types
        jobqueue = required("dask_jobqueue", self.system)
        kind = {"slurm": jobqueue.SLURMCluster, "pbs": jobqueue.PBSCluster, "lsf": jobqueue.LSFCluster}[self.system]
        named = {
            "queue": self.queue,
            "project" if self.system == "lsf" else "account": self.account,
            "interface": self.interface,
            "python": self.python,
            "log_directory": self.logs,
        }
        try:
            return kind(
                cores=self.processes,
                processes=self.processes,
                memory=self.memory,
                walltime=self.walltime,
                job_extra_directives=self.directives,
                job_script_prologue=self.prologue,
                worker_extra_args=["--no-dashboard"],
                scheduler_options={"dashboard": False},
                **{name: value for name, value in named.items() if value},
            )
        except (OSError, ValueError, RuntimeError) as error:
            raise ClusterError(f"cluster={self.system} cannot start: {error}.") from error


@contextmanager
def _connected(distributed: Any, cluster: Any) -> Iterator[Pool]:  # noqa: ANN401 - Dask has no types
    """Yield the executor of a Dask scheduler, given by its address or by a cluster, which is closed at the end."""
    with ExitStack() as stack:
        name = cluster if isinstance(cluster, str) else "of this process"
        if not isinstance(cluster, str):
            stack.callback(cluster.close, timeout=5)
        try:
            client = distributed.Client(cluster, timeout=ANSWER_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise ClusterError(f"The Dask scheduler {cluster} does not answer: {error}.") from error
        stack.callback(client.close, timeout=5)
        executor = client.get_executor(pure=False)  # two equal calls are two calls
        gone = f"The Dask scheduler {name} is gone. Finished runs are stored; the same command continues the sweep."
        try:
            yield Pool(
                executor,
                lambda: 2 * max(1, sum(client.nthreads().values())),
                lambda: "" if client.status == "running" else gone,
            )
        finally:
            if client.status == "running":
                with suppress(CancelledError, OSError, TimeoutError):
                    executor.shutdown(wait=False)


def required(module: str, cluster: str) -> ModuleType:
    """Return a module of the extra ``dask``.

    Raises:
        ClusterError: it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise ClusterError(
            f"cluster={cluster} needs the package {error.name}, which is not installed: pip install 'jerkbench[dask]'."
        ) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Disable logging: Dask reports each lost connection with a traceback."""
    logging.disable()
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
