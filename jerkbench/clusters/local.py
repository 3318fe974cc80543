"""This machine: the own pool of processes."""

from collections.abc import Iterator
from dataclasses import dataclass

from jerkbench.clusters.cluster import Order, Result, Task
from jerkbench.execution.pool import run_grouped


@dataclass(frozen=True)
class Local:
    """The processes of the own pool, each of which goes on with tasks of the recording that it has already."""

    def run(self, order: Order[Task, Result], workers: int) -> Iterator[tuple[Task, Result | Exception]]:
        """Run it here; with one worker, in this process."""
        return run_grouped(order.work, order.groups, workers, order.ended, lambda task: bool(order.admit([task])))
