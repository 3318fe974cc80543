"""The contract of a cluster: it takes an order and yields what became of each task."""

import importlib
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Generic, Protocol, TypeVar

from jerkbench.errors import JerkbenchError
from jerkbench.jobs.identity import Identity
from jerkbench.jobs.pool import run_grouped

Task = TypeVar("Task")
Result = TypeVar("Result")


class ClusterError(JerkbenchError):
    """A cluster that cannot go on; what is done is stored."""


@dataclass(frozen=True)
class Order(Generic[Task, Result]):
    """The work of a sweep, as a cluster gets it.

    Attributes:
        work: what is done with a task.
        groups: tasks that share their recordings, together.
        bundle: names the stretch of its group that a task belongs to; a bundle is sent, and fails, as a whole.
        admit: is given tasks of one bundle when their turn has come, and returns those that are to be done.
        identity: code, versions and plugins that a worker must have.
        ended: is told the numbers of the processes of this machine that were ended, whatever they were doing.
    """

    work: Callable[[Task], Result]
    groups: Sequence[list[Task]]
    bundle: Callable[[Task], Hashable]
    admit: Callable[[Sequence[Task]], list[Task]]
    identity: Identity
    ended: Callable[[list[int]], None]


class Cluster(Protocol):
    """Somewhere to run a sweep."""

    def run(self, order: Order[Task, Result], workers: int) -> Iterator[tuple[Task, Result | Exception]]:
        """Yield each task with its result as it is done, or with what kept it from being done.

        Args:
            order: what is to be done.
            workers: number of processes, where the cluster starts them itself.

        Raises:
            ClusterError: the cluster cannot go on, or its workers are not fit for the order.
            OSError: a result could not be stored.
        """
        ...


def required(module: str, cluster: str) -> ModuleType:
    """Return a module that a cluster needs, of the extra ``dask``.

    Raises:
        ClusterError: it is not installed; says how it would be.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ClusterError(
            f"cluster={cluster} needs the package {error.name}, which is not installed: pip install 'jerkbench[dask]'."
        ) from error


# This machine: the own pool of processes.


@dataclass(frozen=True)
class Local:
    """The processes of the own pool, each of which goes on with tasks of the recording that it has already."""

    def run(self, order: Order[Task, Result], workers: int) -> Iterator[tuple[Task, Result | Exception]]:
        """Run it here; with one worker, in this process."""
        return run_grouped(order.work, order.groups, workers, order.ended, lambda task: bool(order.admit([task])))
