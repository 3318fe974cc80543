"""The stages of an audit on a cluster: what is stored is not run again."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import TypeVar

import pandas as pd

from jerkbench.audit.methods import Method
from jerkbench.audit.runs import TEST, Stage
from jerkbench.audit.scenarios import Scenario, cell_on
from jerkbench.cells.cell import Cell
from jerkbench.clusters.cluster import Cluster, Order
from jerkbench.clusters.identity import identity_of
from jerkbench.execution.progress import Progress
from jerkbench.tuning.space import Setting

Numbered = TypeVar("Numbered")
Result = TypeVar("Result")

TITLES = {"tune": "settings tried", "choose": "finalists", TEST: "scored unseen"}

Settings = Mapping[Method, tuple[Setting, ...]]
"""What is run of each method."""


@dataclass(frozen=True)
class Stages:
    """The place where stages are run and stored.

    Attributes:
        scenarios: of the audit, in order.
        folder: where runs are stored.
        key: of the code and the libraries.
        cluster: what runs them.
        workers: number of processes, where the cluster starts them.
    """

    scenarios: Sequence[Scenario]
    folder: Path
    key: str
    cluster: Cluster
    workers: int

    def run(self, name: str, seeds: tuple[int, ...], settings: Sequence[Settings]) -> pd.DataFrame:
        """Run the ``settings`` of each scenario that are not stored yet, and return the rows of all.

        Raises:
            JerkbenchError: a run failed.
            OSError: nothing can be stored.
        """
        stages = list(self._stages(name, seeds, settings))
        left = [stage for stage in stages if not stage.done]
        title = f"Audit, {TITLES[name]}"
        with Progress(len(stages), len(stages) - len(left), title, "filters and scenarios") as progress:
            for _ in self._outcomes(left):
                progress.advance()
        return pd.concat([stage.read() for stage in stages], ignore_index=True)

    def _stages(self, name: str, seeds: tuple[int, ...], settings: Sequence[Settings]) -> Iterator[Stage]:
        for number, (scenario, asked) in enumerate(zip(self.scenarios, settings, strict=True)):
            for model in dict.fromkeys(method.filter for method in asked):
                own = {method: values for method, values in asked.items() if method.filter == model}
                yield Stage(name, number, scenario, seeds, own, self.folder, self.key)

    def _outcomes(self, stages: Sequence[Stage]) -> Iterator[int]:
        """Yield the number of runs of each stage as it is done; those of one scenario share its recordings."""
        if not stages:
            return
        yield from done_by_scenario(Stage.run, stages, self._cells(stages), self.cluster, self.workers)

    def _cells(self, stages: Sequence[Stage]) -> list[Cell]:
        """A cell of each method: what a worker must have."""
        methods = dict.fromkeys(method for stage in stages for method in stage.settings)
        return [cell_on(self.scenarios[0], method.filter, method.adaptation, seeds=1) for method in methods]


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
