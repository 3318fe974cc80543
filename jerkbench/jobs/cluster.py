"""Where tasks run: in this process, in the own pool, or on a cluster; opened once, when the first task comes."""

import importlib
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from types import ModuleType, TracebackType
from typing import NamedTuple, Protocol, Self

from jerkbench.errors import JerkbenchError
from jerkbench.jobs.pool import OwnPool
from jerkbench.notices import shared_notices


class ClusterError(JerkbenchError):
    """A cluster that cannot go on; what is done is stored."""


class Lent(NamedTuple):
    """Workers that are there.

    Attributes:
        executor: takes work.
        slots: how much work may be on its way.
        trouble: says why no result will come any more; empty: one may.
        elsewhere: whether they may have other code than this process; then sending costs, and tasks go in bundles.
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


class Workers:
    """The workers of a command, which are opened when the first task comes, and closed at its end."""

    def __init__(self, cluster: Cluster = LOCAL, count: int = 1) -> None:
        """Take ``count`` processes where the cluster starts them itself; with one of `LOCAL`, this process works."""
        self._cluster, self._count = cluster, count
        self._stack = ExitStack()
        self._lent: Lent | None = None

    def __enter__(self) -> Self:
        """Nothing is opened yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close what was opened."""
        self._lent = None
        self._stack.__exit__(kind, error, trace)

    def lent(self, tasks: int) -> Lent | None:
        """Return who does so many tasks; None: this process.

        Raises:
            ClusterError: the cluster cannot be opened.
        """
        if self._lent is None and (self._cluster != LOCAL or min(self._count, tasks) > 1):
            self._stack.enter_context(shared_notices())
            self._lent = self._stack.enter_context(self._cluster.open(self._count))
        return self._lent


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
