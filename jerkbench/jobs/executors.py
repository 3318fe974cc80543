"""Executors that run the tasks of a sweep: processes of this machine, a Dask cluster, or jobs of a queueing system."""

import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

from jerkbench.errors import JerkbenchError, shared_notices


class ClusterError(JerkbenchError):
    """Raised if a cluster cannot continue. The results of the finished runs are stored."""


class Pool(NamedTuple):
    """An executor that accepts calls, and functions that return its state.

    Attributes:
        executor: The executor to which calls are submitted.
        slots: Function that returns the maximum number of calls that may be submitted at the same time.
        trouble: Function that returns an empty string while the executor works, and otherwise the reason why it cannot
            continue.
    """

    executor: Executor
    slots: Callable[[], int]
    trouble: Callable[[], str] = str


class Workers(ExitStack):
    """The worker processes of one command, which start with its first task and stop when the command ends.

    Attributes:
        count: Number of worker processes.
    """

    def __init__(self, cluster: "Cluster | None" = None, count: int = 1) -> None:
        """Set the cluster and the number of worker processes.

        With one local worker, the current process runs all tasks.
        """
        super().__init__()
        self._cluster, self.count = cluster or LOCAL, count
        self._pool: Pool | None = None

    def pool(self, tasks: int) -> Pool | None:
        """Return the pool that runs ``tasks`` tasks, or None if the current process runs the tasks.

        Raises:
            ClusterError: The cluster cannot be started, or does not answer.
        """
        if self._pool is None and (self._cluster != LOCAL or min(self.count, tasks) > 1):
            self.enter_context(shared_notices())
            self._pool = self.enter_context(self._cluster.open(self.count))
        return self._pool


def processors() -> int:
    """Return the number of processors that this process may use, which can be less than the number in the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Local:
    """A cluster that consists of processes of this machine."""

    @contextmanager
    def open(self, workers: int) -> Iterator[Pool]:
        """Yield a pool of up to ``workers`` processes. Each process is started when it is first needed."""
        with LocalExecutor(workers) as executor:
            yield Pool(executor, lambda: workers + 1)  # the extra call prevents idle workers


LOCAL = Local()
"""The default cluster: processes of this machine."""

GRACE_S = 5.0
"""Maximum time to wait for a terminated process to end [s]."""

_SPAWN = multiprocessing.get_context("spawn")
"""Processes are spawned, because a forked process may hang in libraries that use threads."""


class LocalExecutor(Executor):
    """An executor with a process pool. If a process of the pool dies, a new pool replaces the pool.

    Worker processes end as soon as the pipe to the parent process is closed. The function `shutdown` closes the pipe.
    If the parent process dies, the operating system closes the pipe.
    """

    def __init__(self, workers: int) -> None:
        self._children: set[BaseProcess] = set()
        self._workers = min(workers, 61) if sys.platform == "win32" else workers  # Windows allows at most 61 processes
        self._start()

    def _start(self) -> None:
        self._reader, self._writer = _SPAWN.Pipe(duplex=False)
        self._pool = ProcessPoolExecutor(self._workers, _SPAWN, _start_worker, (self._reader,))

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401 - of the call
        """Submit a call to the process pool. If the pool is broken, a new pool is started first."""
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
        """Terminate the worker processes, also if calls are running.

        This method does not wait until the process pool has stopped. If a worker process is terminated while it writes
        a result, the process pool never stops.
        """
        self._writer.close()
        self._pool.shutdown(wait=False, cancel_futures=cancel_futures)
        for child in self._children:
            child.terminate()  # termination works even if compiled code holds the interpreter lock
        for child in self._children if wait else ():
            child.join(GRACE_S)
        self._children.clear()
        self._reader.close()


@contextmanager
def _without_script() -> Iterator[None]:
    """Hide the module ``__main__`` temporarily, because each spawned process would import and run the user's script."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def _start_worker(reader: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process handles Ctrl-C
    threading.Thread(target=_end_with_parent, args=(reader,), daemon=True).start()


def _end_with_parent(reader: Connection) -> None:
    reader.poll(None)  # blocks until the pipe is closed
    os._exit(1)


ANSWER_S = 30.0
"""Maximum time to wait for an answer of a Dask scheduler [s]."""


@dataclass(frozen=True)
class Dask:
    """A Dask cluster that runs the tasks of a sweep.

    Attributes:
        address: Address of a running Dask scheduler, for example "tcp://HOST:8786". If the address is empty, a
            scheduler and worker processes are started on this machine.
    """

    address: str = ""

    @contextmanager
    def open(self, workers: int) -> Iterator[Pool]:
        """Connect to the Dask scheduler, or start a scheduler and ``workers`` processes on this machine."""
        distributed = required("distributed", "dask")
        with _quiet():
            cluster = self.address or distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,  # threads would not run in parallel, because a run holds the interpreter lock
                memory_limit=0,
                dashboard_address=":0",  # Dask prints a warning if its default port is in use
                scheduler_kwargs={"dashboard": False},
                silence_logs=logging.CRITICAL,
                preload=[__name__],
            )
            with _connected(distributed, cluster) as pool:
                yield pool


def dask_setup(worker: object) -> None:
    """Make a worker process ignore Ctrl-C, because the parent process handles Ctrl-C.

    Dask calls this function at the start of each local worker process.
    """
    del worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@dataclass(frozen=True)
class JobQueue:
    """Jobs of SLURM that run Dask workers. The current process runs the Dask scheduler.

    Attributes:
        jobs: Number of jobs in the queue. A job that ends before the sweep is submitted again.
        processes: Number of worker processes of each job. Each worker process uses one core.
        memory: Memory of each job, for example "8GB".
        walltime: Time limit of each job in the format of the queueing system, for example "01:00:00".
        queue: Name of the partition or queue (by default, the default of the queueing system).
        account: Account that is charged for the jobs (by default, the default of the queueing system).
        interface: Network interface by which workers reach this process, for example "ib0" (by default, selected by
            Dask).
        directives: Additional lines for the header of a job script, for example ["--exclusive"].
        prologue: Commands that a job runs before its workers start, for example ["module load python"].
        python: Path of the Python interpreter of the workers (by default, the path of the current interpreter).
        logs: Folder for the output of the jobs (by default, the default of the queueing system).
    """

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
        """Submit the jobs to the queueing system. Tasks are sent as soon as the first job has started."""
        del workers  # the number of workers is `jobs` times `processes`
        distributed = required("distributed", "slurm")
        with _quiet(), _connected(distributed, cluster := self._cluster()) as pool:
            cluster.adapt(minimum_jobs=self.jobs, maximum_jobs=self.jobs)  # a job that ends early is submitted again
            yield pool

    def _cluster(self) -> Any:  # noqa: ANN401 - dask-jobqueue has no types
        jobqueue = required("dask_jobqueue", "slurm")
        named = {name: getattr(self, name) for name in ("queue", "account", "interface", "python")}
        named["log_directory"] = self.logs
        try:
            return jobqueue.SLURMCluster(
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
            raise ClusterError(f"cluster=slurm cannot start: {error}.") from error


Cluster: TypeAlias = Local | Dask | JobQueue


@contextmanager
def _connected(distributed: Any, cluster: Any) -> Iterator[Pool]:  # noqa: ANN401 - Dask has no types
    """Connect to a Dask scheduler, and yield a pool that sends calls to this scheduler.

    If ``cluster`` is a cluster object and not an address, the cluster is closed at the end.
    """
    with ExitStack() as stack:
        name = cluster if isinstance(cluster, str) else "of this process"
        if not isinstance(cluster, str):
            stack.callback(cluster.close, timeout=5)
        try:
            client = distributed.Client(cluster, timeout=ANSWER_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise ClusterError(f"The Dask scheduler {cluster} does not answer: {error}.") from error
        stack.callback(client.close, timeout=5)
        executor = client.get_executor(pure=False)  # by default, Dask merges equal calls
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
    """Import and return a module that the optional dependencies "dask" install.

    Raises:
        ClusterError: The module is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        needed = f"the package {error.name}, which is not installed: pip install 'jerkbench[dask]'"
        raise ClusterError(f"cluster={cluster} needs {needed}.") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Disable logging temporarily, because Dask logs a traceback for each closed connection."""
    logging.disable()
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
