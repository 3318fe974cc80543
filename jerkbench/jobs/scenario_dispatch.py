"""Pieces of work on a cluster, those of one scenario together."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from operator import attrgetter
from typing import TypeVar

from jerkbench.jobs.cell import Cell
from jerkbench.jobs.cluster import Cluster, Order
from jerkbench.jobs.identity import identity_of

Numbered = TypeVar("Numbered")
Result = TypeVar("Result")


def done_by_scenario(
    work: Callable[[Numbered], Result],
    pieces: Sequence[Numbered],
    cells: Iterable[Cell],
    cluster: Cluster,
    workers: int,
) -> Iterator[Result]:
    """Yield the result of each piece as it is done; those of one scenario (``number``) share its recordings.

    Args:
        work: what is done with a piece.
        pieces: each with the ``number`` of its scenario.
        cells: what a worker must have.
        cluster: what runs them.
        workers: number of processes, where the cluster starts them.

    Raises:
        JerkbenchError: what a piece raised, or the cluster.
    """
    number = attrgetter("number")
    groups = [list(group) for _, group in groupby(sorted(pieces, key=number), key=number)]
    order = Order(work, groups, bundle=number, admit=list, identity=identity_of(cells), ended=lambda _: None)
    for _, result in cluster.run(order, workers):
        if isinstance(result, Exception):
            raise result
        yield result
