"""Dask: processes of this machine, a scheduler with workers anywhere, or the jobs of a queue."""

import logging
import math
import signal
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from jerkbench.jobs.cluster import ClusterError, Lent, required

ANSWER_S = 30.0
"""So long a scheduler may take to answer."""
BELIEVED_S = 1.0
"""So long a number of threads is believed: to ask for it costs the scheduler some work for each worker."""
TALKATIVE = ("distributed", "tornado", "asyncio")
"""Packages that log a connection which is lost as an error of their own, with a traceback."""


SPARING: Mapping[str, bool | str] = MappingProxyType(
    {
        "distributed.worker.profile.enabled": False,  # it looks at what runs every 10 ms
        "distributed.admin.tick.interval": "1s",  # each loop asks itself every 20 ms whether it is late
        "distributed.admin.system-monitor.interval": "10s",  # for the dashboard, which we do not start
    }
)
"""Dask's name of each setting, and its value: what watches its workers all the time is off, or rare.

A run holds the interpreter. Whatever wakes another thread of its process takes that away and gives it back, which costs
far more than what the thread does.
"""


@dataclass(frozen=True)
class Dask:
    """A Dask cluster.

    Attributes:
        address: of a scheduler that runs already, "tcp://HOST:8786"; empty: processes of this machine are started.
    """

    address: str = ""

    @contextmanager
    def open(self, workers: int) -> Iterator[Lent]:
        """Reach the scheduler, or start processes."""
        distributed = required("distributed", "dask")
        with quiet(), sparing(), lent_by(distributed, self._cluster(distributed, workers), workers) as lent:
            yield lent

    def _cluster(self, distributed: Any, workers: int) -> Any:  # noqa: ANN401 - Dask has no types
        if self.address:
            return self.address
        return distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,  # a run holds the interpreter
            memory_limit=0,  # a worker that is paused or ended for its memory would be a surprise
            dashboard_address=":0",  # Dask listens all the same, and warns where somebody else has its usual port
            scheduler_kwargs={"dashboard": False},
            silence_logs=logging.CRITICAL,
            preload=[__name__],
        )


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C to the sweep, which ends its workers; Dask calls this in each worker of this machine."""
    del worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def lent_by(distributed: Any, cluster: Any, workers: int) -> Iterator[Lent]:  # noqa: ANN401 - Dask has no types
    """Lend the workers of a scheduler, which sends what a lost one had to another by itself.

    Args:
        distributed: the module.
        cluster: what was started here, and ends here; or the address of a scheduler, which stays.
        workers: a guess of how many there are, until they are there.

    Raises:
        ClusterError: nobody answers.
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
        executor = client.get_executor(pure=False)  # the same bundle twice is run twice
        gone = f"The Dask scheduler {name} is gone. What is done is stored; the same command goes on from there."
        slots = Slots(client, workers)
        try:
            yield Lent(executor, slots, lambda: "" if client.status == "running" else gone, elsewhere=True)
        finally:
            if client.status == "running":  # else there is nobody to tell
                with suppress(CancelledError, OSError, TimeoutError):
                    executor.shutdown(wait=False)


class Slots:
    """How much work may be on its way: twice the number of threads that there were a moment ago."""

    def __init__(self, client: Any, workers: int) -> None:  # noqa: ANN401 - Dask has no types
        """Ask by ``client``; ``workers`` is a guess until they are there."""
        self._client, self._workers = client, workers
        self._threads, self._asked_s = 0, -math.inf

    def __call__(self) -> int:
        """Return it; a scheduler that is gone names no threads."""
        now_s = time.monotonic()
        if now_s >= self._asked_s + BELIEVED_S:
            workers = self._client.scheduler_info(n_workers=-1).get("workers", {})
            self._threads, self._asked_s = sum(worker["nthreads"] for worker in workers.values()), now_s
        return 2 * (self._threads or self._workers)


@contextmanager
def quiet() -> Iterator[None]:
    """Leave it to us to say what a person has to know."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in TALKATIVE]
    loggers = {logging.getLogger(name): logging.getLogger(name).level for name in names}
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in loggers.items():
            logger.setLevel(level)


@contextmanager
def sparing() -> Iterator[None]:
    """Set them for what is started here meanwhile: scheduler, client, and workers, which inherit them."""
    dask = required("dask", "dask")
    with dask.config.set(dict(SPARING)):
        yield


def exports() -> list[str]:
    """Return the lines of a shell script that set them, as Dask reads them, for the workers that it starts."""
    variables = {name.upper().replace("-", "_").replace(".", "__"): value for name, value in SPARING.items()}
    return [f"export DASK_{variable}={value}" for variable, value in variables.items()]


# Job queues: workers of Dask that SLURM, PBS or LSF starts, and starts again where a job is lost.


@dataclass(frozen=True)
class JobQueue:
    """Jobs of a queue, each with some worker processes; the scheduler is this process.

    Attributes:
        system: slurm, pbs or lsf.
        jobs: how many jobs are kept in the queue.
        processes: worker processes of a job, one core each.
        memory: of a job, "8GB".
        walltime: of a job, as the queue writes it: "01:00:00".
        queue: partition or queue; empty: the system's default.
        account: what is charged; empty: the system's default.
        interface: network interface by which workers reach this process, "ib0"; empty: Dask looks for one.
        directives: more lines for the head of a job's script: ["--exclusive"].
        prologue: commands of a job before its workers start: ["module load python"].
        python: the interpreter of the workers; empty: this one, at the same path.
        logs: folder of the jobs' output; empty: as the system has it.
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
    def open(self, workers: int) -> Iterator[Lent]:
        """Submit the jobs; work begins with the first that runs."""
        del workers  # jobs and processes say how many
        distributed = required("distributed", self.system)
        with quiet(), sparing():
            cluster = self._cluster()
            with lent_by(distributed, cluster, self.jobs * self.processes) as lent:
                cluster.adapt(minimum_jobs=self.jobs, maximum_jobs=self.jobs)  # which submits another where one is lost
                yield lent

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
                job_script_prologue=[*exports(), *self.prologue],
                worker_extra_args=["--no-dashboard"],
                scheduler_options={"dashboard": False},
                **{name: value for name, value in named.items() if value},
            )
        except (OSError, ValueError, RuntimeError) as error:
            raise ClusterError(f"cluster={self.system} cannot start: {error}.") from error
