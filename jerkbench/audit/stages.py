"""The stages of an audit on a cluster: what is stored is not run again."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from jerkbench.audit.methods import Method
from jerkbench.audit.runs import TEST, Stage, mark_of
from jerkbench.audit.scenarios import Scenario, cell_on
from jerkbench.cells.cell import Cell
from jerkbench.clusters.cluster import Cluster
from jerkbench.clusters.scenario_dispatch import done_by_scenario
from jerkbench.errors import JerkbenchError
from jerkbench.execution.progress import Progress
from jerkbench.tuning.space import Setting

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
        only_stored: read what other code may have computed, and run nothing.
        attitude: name of the plugin; None: that of the data set.
    """

    scenarios: Sequence[Scenario]
    folder: Path
    key: str
    cluster: Cluster
    workers: int
    only_stored: bool = False
    attitude: str | None = None

    def run(self, name: str, seeds: tuple[int, ...], settings: Sequence[Settings]) -> pd.DataFrame:
        """Run the ``settings`` of each scenario that are not stored yet, and return the rows of all.

        Raises:
            JerkbenchError: a run failed, or is not stored and may not be run.
            OSError: nothing can be stored.
        """
        stages = list(self._stages(name, seeds, settings))
        left = [stage for stage in stages if not (stage.maker if self.only_stored else stage.done)]
        if left and self.only_stored:
            raise JerkbenchError(
                f"Of {len(stages)} files of the stage {name} in {self.folder}, {len(left)} are missing or of other"
                f" settings, first {left[0].path.name}; run the audit without --stored."
            )
        title = f"Audit, {TITLES.get(name, name)}"
        with Progress(len(stages), len(stages) - len(left), title, "filters and scenarios") as progress:
            for _ in self._outcomes(left):
                progress.advance()
        return pd.concat([stage.read() for stage in stages], ignore_index=True)

    def stored_methods(self, methods: Iterable[Method]) -> list[Method]:
        """Return those of the ``methods`` that were run: adaptations may have come into the tree since.

        Raises:
            JerkbenchError: none was.
        """
        names = {name for path in self.folder.glob("tune-000-*.parquet") for name in (mark_of(path) or [{}])[-1]}
        if stored := [method for method in methods if method.name in names]:
            return stored
        raise JerkbenchError(f"No run of this audit is stored in {self.folder}; run the audit without --stored first.")

    def makers(self) -> list[str]:
        """Return the keys of the code that computed what is stored."""
        return sorted({mark[0] for path in self.folder.glob("*.parquet") if (mark := mark_of(path))})

    def _stages(self, name: str, seeds: tuple[int, ...], settings: Sequence[Settings]) -> Iterator[Stage]:
        for number, (scenario, by_method) in enumerate(zip(self.scenarios, settings, strict=True)):
            for model in dict.fromkeys(method.filter for method in by_method):
                own = {method: values for method, values in by_method.items() if method.filter == model}
                yield Stage(name, number, scenario, seeds, own, self.folder, self.key, self.attitude)

    def _outcomes(self, stages: Sequence[Stage]) -> Iterator[int]:
        """Yield the number of runs of each stage as it is done; those of one scenario share its recordings."""
        if not stages:
            return
        yield from done_by_scenario(Stage.run, stages, self._cells(stages), self.cluster, self.workers)

    def _cells(self, stages: Sequence[Stage]) -> list[Cell]:
        """A cell of each method: what a worker must have."""
        methods = dict.fromkeys(method for stage in stages for method in stage.settings)
        return [cell_on(self.scenarios[0], method.filter, method.adaptation, seeds=1) for method in methods]
