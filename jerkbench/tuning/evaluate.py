"""The evaluation of settings on cases."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.contracts import Metric
from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.cluster import Cluster
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.rows import Row, run_settings
from jerkbench.jobs.scenario_dispatch import done_by_scenario
from jerkbench.tuning.objectives import Objective
from jerkbench.tuning.space import Setting, Space
from jerkbench.tuning.splits import TuningCase
from jerkbench.tuning.trials import Trials


class Worth(NamedTuple):
    """What settings are worth on one case.

    Attributes:
        losses: (n, draws) of each run.
        lost: (n,) how many runs of each setting were lost.
    """

    losses: FloatArray
    lost: FloatArray


@dataclass(frozen=True, eq=False)
class CaseTask:
    """Settings to try on one case, as a cluster gets them.

    Attributes:
        number: of the case.
        case: the case.
        settings: to try.
        space: whose they are.
        objective: what they are worth.
    """

    number: int
    case: TuningCase
    settings: tuple[Setting, ...]
    space: Space
    objective: Objective

    def run(self) -> tuple[int, Worth]:
        """Return the number of the case with what came out."""
        return self.number, Evaluator(self.space, self.objective, threads=1).worth(self.settings, self.case)


class Evaluator:
    """Runs settings over cases; what the plain filter has there is found once for each case."""

    def __init__(
        self,
        space: Space,
        objective: Objective,
        threads: int,
        inputs: Inputs | None = None,
        cluster: Cluster | None = None,
    ) -> None:
        """Evaluate settings of ``space`` by ``objective``.

        Args:
            space: the knobs.
            objective: what a setting is worth.
            threads: how many the engine may use; of a cluster, how many processes it starts.
            inputs: recordings that are known already.
            cluster: runs the cases; None: this process does.
        """
        self.space, self.objective = space, objective
        self._cluster = cluster
        self._threads, self._inputs = threads, inputs or Inputs()
        self._metrics: tuple[Metric, ...] = (plugins.create("metric", {"name": objective.metric}),)
        self._levels: dict[int, tuple[TuningCase, float]] = {}

    def trials(self, settings: Sequence[Setting], cases: Sequence[TuningCase]) -> Trials:
        """Try each of ``settings`` on each of ``cases``.

        Raises:
            JerkbenchError: a run failed for another reason than that the filter diverged.
        """
        numbers = np.repeat(np.arange(len(cases)), [len(case.draws) for case in cases])
        tried = self._elsewhere(settings, cases) if self._cluster else [self.worth(settings, case) for case in cases]
        losses = np.hstack([own.losses for own in tried])
        return Trials(tuple(settings), losses, numbers, np.sum([own.lost for own in tried], axis=0))

    def worth(self, settings: Sequence[Setting], case: TuningCase) -> Worth:
        """Try each of ``settings`` on one case."""
        level, runs = self.level(case), self.rows(settings, case)
        lost = np.array([sum(run["status"] != "ok" for run in rows) for rows in runs], dtype=np.float64)
        return Worth(np.array([self.objective.losses(rows, level) for rows in runs]), lost)

    def _elsewhere(self, settings: Sequence[Setting], cases: Sequence[TuningCase]) -> list[Worth]:
        """Try them on the cluster, each case by itself."""
        assert self._cluster is not None  # noqa: S101 - for mypy
        tasks = [CaseTask(k, case, tuple(settings), self.space, self.objective) for k, case in enumerate(cases)]
        cells = [case.cell for case in cases]
        done = dict(done_by_scenario(CaseTask.run, tasks, cells, self._cluster, self._threads))
        return [done[number] for number in range(len(cases))]

    def rows(self, settings: Sequence[Setting], case: TuningCase) -> list[list[Row]]:
        """Return the rows of the runs of each setting."""
        return self._run([self.space.applied(case.cell, setting) for setting in settings], case)

    def level(self, case: TuningCase) -> float:
        """Return the objective's level of the plain filter: the same one at its defaults, R as reported."""
        known = self._levels.get(id(case))
        if known is None or known[0] is not case:
            (rows,) = self._run([plain_cell(case.cell)], case)
            self._require_value(rows, case)
            self._levels[id(case)] = known = case, self.objective.level(rows, case.cell.protocol.divergence_limit_m)
        return known[1]

    def _require_value(self, rows: Sequence[Row], case: TuningCase) -> None:
        """Check that runs that came to their end have a value, or every setting would count as lost."""
        column = self.objective.column
        if any(row["status"] == "ok" and np.isnan(row.get(column, np.nan)) for row in rows):
            raise PluginError(
                f"The filter {case.cell.spec['filter']['name']} has no {column} over {case.scenario}, so"
                f" objective={self.objective.name} cannot be used; take another objective."
            )

    def _run(self, cells: Sequence[Cell], case: TuningCase) -> list[list[Row]]:
        names = [self.objective.metric]
        measured = [
            dataclasses.replace(cell, metrics=self._metrics, spec={**cell.spec, "metrics": names}) for cell in cells
        ]
        runs = run_settings(measured, case.draws, case.fingerprint, self._threads, self._inputs)
        failed = next((row for rows in runs for row in rows if row["status"] == "failed"), None)
        if failed is not None:
            raise PluginError(f"A run over {case.scenario} failed: {failed['reason']}")
        return runs


def plain_cell(cell: Cell) -> Cell:
    """Return the cell with its filter at its defaults, without adaptation, with R as reported."""
    name = cell.spec["filter"]["name"]
    model, none = plugins.create("filter", {"name": name}), plugins.create("adaptation", {"name": "none"})
    spec = {
        **cell.spec,
        "filter": {"name": name, **dataclasses.asdict(model)},
        "adaptation": {"name": "none"},
        "r_scale": {"position": 1.0, "velocity": 1.0},
    }
    labels = cell.labels._replace(filter=name, adaptation="none", noise="default")
    r_scale = type(cell.r_scale)()
    return dataclasses.replace(cell, filter=model, adaptation=none, r_scale=r_scale, spec=spec, labels=labels)


def require_scorable(objective: Objective, cases: Sequence[TuningCase], load: Callable[[TuningCase], object]) -> None:
    """Check that the recordings have what the objective asks for.

    Raises:
        RecordingError: one has no reference position, and the objective compares with it.
    """
    for case in cases:
        recording = load(case)
        reference = getattr(recording, "reference", None)
        if objective.needs_reference and (reference is None or reference.enu_m is None):
            raise RecordingError(
                f"{case.cell.labels.dataset} has no reference position, so objective={objective.name} has nothing to"
                " compare with; use objective=likelihood, or withhold fixes: disturbance=withhold."
            )
