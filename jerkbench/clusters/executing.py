"""The base of the clusters that hand bundles to an executor (`concurrent.futures`)."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Protocol

from jerkbench.clusters.bundles import run_bundles
from jerkbench.clusters.cluster import Order, Result, Task
from jerkbench.clusters.connection import Connection
from jerkbench.notices import shared_notices


class Executing(Protocol):
    """A cluster that opens a connection to an engine and sends bundles through it."""

    def connect(self, workers: int) -> AbstractContextManager[Connection]:
        """Start the engine, or reach it.

        Raises:
            ClusterError: a package is not installed, or nobody answers.
        """
        ...

    def run(self, order: Order[Task, Result], workers: int) -> Iterator[tuple[Task, Result | Exception]]:
        """Send the order's bundles through the engine."""
        with shared_notices(), self.connect(workers) as connection:
            yield from run_bundles(connection, order)
