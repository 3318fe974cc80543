"""Dask: processes of this machine, or a scheduler with workers anywhere."""

import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from jerkbench.jobs.bundles import run_bundles
from jerkbench.jobs.cluster import ClusterError, Order, Result, Task, required
from jerkbench.notices import shared_notices

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


class OverDask:
    """A cluster whose bundles go through a client of Dask."""

    def connect(self, workers: int) -> "AbstractContextManager[DaskConnection]":
        """Start the workers, or reach them.

        Raises:
            ClusterError: a package is not installed, or nobody answers.
        """
        raise NotImplementedError

    def run(self, order: Order[Task, Result], workers: int) -> Iterator[tuple[Task, Result | Exception]]:
        """Send the order's bundles through it."""
        with shared_notices(), self.connect(workers) as connection:
            yield from run_bundles(connection, order)


@dataclass(frozen=True)
class Dask(OverDask):
    """A Dask cluster.

    Attributes:
        address: of a scheduler that runs already, "tcp://HOST:8786"; empty: processes of this machine are started.
    """

    address: str = ""

    @contextmanager
    def connect(self, workers: int) -> Iterator["DaskConnection"]:
        """Reach the scheduler, or start processes."""
        distributed = required("distributed", "dask")
        with (
            quiet(),
            sparing(),
            ended(self._cluster(distributed, workers)) as cluster,
            client_of(distributed, cluster) as client,
        ):
            yield DaskConnection(client, workers, self.address or "of this process")

    def _cluster(self, distributed: Any, workers: int) -> Any:  # noqa: ANN401 - Dask has no types
        if self.address:
            return self.address
        return distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,  # a run holds the interpreter
            memory_limit=0,  # a worker that is paused or ended for its memory would be a surprise
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
            preload=["jerkbench.jobs.dask_worker_setup"],
        )


class DaskConnection:
    """A client of a scheduler, which sends what a lost worker had to another one by itself."""

    def __init__(self, client: Any, workers: int, name: str) -> None:  # noqa: ANN401 - Dask has no types
        """Send by ``client``; ``workers`` is a guess until they are there."""
        self._client, self._name, self._workers = client, name, workers
        self._threads, self._asked_s = 0, -math.inf
        self._executor = client.get_executor(pure=False)  # the same bundle twice is run twice

    def submit(self, work: Callable[..., Any], *arguments: Any) -> "Future[Any]":  # noqa: ANN401 - goes to the work
        """Hand over a piece of work."""
        future: Future[Any] = self._executor.submit(work, *arguments)
        return future

    def room(self) -> int:
        """Return twice the number of threads that there were a moment ago; a scheduler that is gone names none."""
        now_s = time.monotonic()
        if now_s >= self._asked_s + BELIEVED_S:
            self._threads, self._asked_s = self._count(), now_s
        return 2 * (self._threads or self._workers)

    def trouble(self) -> str:
        """Say that the scheduler is gone."""
        if self._client.status == "running":
            return ""
        return f"The Dask scheduler {self._name} is gone. What is done is stored; the same command goes on from there."

    def close(self) -> None:
        """Cancel what waits; what a worker is running it runs to its end."""
        with suppress(CancelledError, OSError, TimeoutError):
            self._executor.shutdown(wait=False)

    def _count(self) -> int:
        workers = self._client.scheduler_info(n_workers=-1).get("workers", {})
        return sum(worker["nthreads"] for worker in workers.values())


@contextmanager
def client_of(distributed: Any, cluster: Any) -> Iterator[Any]:  # noqa: ANN401 - Dask has no types
    """Open a client of a cluster, or of an address.

    Raises:
        ClusterError: nobody answers.
    """
    try:
        client = distributed.Client(cluster, timeout=ANSWER_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ClusterError(f"The Dask scheduler {cluster} does not answer: {error}.") from error
    try:
        yield client
    finally:
        client.close(timeout=5)


@contextmanager
def ended(cluster: Any) -> Iterator[Any]:  # noqa: ANN401 - as above
    """Close a cluster that was started here; an address stays what it is."""
    try:
        yield cluster
    finally:
        if not isinstance(cluster, str):
            cluster.close(timeout=5)


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
    """Return the lines of a shell script that set them for the workers that it starts."""
    return [f"export {variable(name)}={value}" for name, value in SPARING.items()]


def variable(name: str) -> str:
    """Return the environment variable that Dask reads a setting from."""
    return "DASK_" + name.upper().replace("-", "_").replace(".", "__")
