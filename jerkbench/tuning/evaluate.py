"""The evaluation of settings on cases: their runs, as losses against the plain filter."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Metric
from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Row
from jerkbench.optional import is_attitude_only
from jerkbench.results.store import Store
from jerkbench.sweep.sweep import joined_plan, planned, rows_of, run_sweep
from jerkbench.sweep.tasks import MOST_TASKS
from jerkbench.tuning.objectives import Objective
from jerkbench.tuning.space import Setting, Space
from jerkbench.tuning.splits import TuningCase


@dataclass(frozen=True, eq=False)
class Trials:
    """Settings, in the order in which they were tried.

    Attributes:
        settings: n of them.
        runs: (n, r) loss of each of its runs.
        case: (r,) which case each of them is of.
        lost: (n,) how many of its runs were lost.
    """

    settings: tuple[Setting, ...]
    runs: FloatArray
    case: IntArray
    lost: FloatArray

    @property
    def losses(self) -> FloatArray:
        """(n, cases) mean loss on each case, over its draws."""
        cases = range(int(self.case.max(initial=-1)) + 1)
        return np.column_stack([self.runs[:, self.case == k].mean(axis=1) for k in cases])

    @property
    def means(self) -> FloatArray:
        """(n,) mean loss over the cases: the objective."""
        return np.asarray(self.losses.mean(axis=1))

    def best(self, count: int) -> list[int]:
        """Return the places of the ``count`` best, the best first; of equals the earlier."""
        return [int(k) for k in np.argsort(self.means, kind="stable")[:count]]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.settings)


def joined_trials(parts: Sequence[Trials]) -> Trials:
    """Return several as one."""
    settings = tuple(setting for part in parts for setting in part.settings)
    runs, lost = (np.concatenate(arrays) for arrays in ([p.runs for p in parts], [p.lost for p in parts]))
    return Trials(settings, runs, parts[0].case, lost)


@dataclass(frozen=True)
class Runs:
    """Where runs are done and stored.

    Attributes:
        folder: of what is stored.
        workers: who does them; None: this process.
    """

    folder: Path
    workers: Workers | None = None


class Evaluator:
    """Runs settings over cases; a run that is stored already is not done again."""

    def __init__(
        self,
        space: Space,
        objective: Objective,
        threads: int,
        runs: Runs,
    ) -> None:
        """Evaluate settings of ``space`` by ``objective``.

        Args:
            space: the knobs.
            objective: what a setting is worth.
            threads: how many the engine may use in each process.
            runs: where they are done and stored, those of other searches, too.
        """
        self.space, self.objective, self._threads, self._runs = space, objective, threads, runs
        self._metrics: tuple[Metric, ...] = (plugins.create("metric", {"name": objective.metric}),)

    def trials(self, settings: Sequence[Setting], cases: Sequence[TuningCase]) -> Trials:
        """Try each of ``settings`` on each of ``cases``.

        Raises:
            JerkbenchError: a run failed for another reason than that the filter diverged.
        """
        worths = [self._worth(rows, case) for rows, case in zip(self.rows(settings, cases), cases, strict=True)]
        numbers = np.repeat(np.arange(len(cases)), [len(case.draws) for case in cases])
        losses, lost = zip(*worths, strict=True)
        return Trials(tuple(settings), np.hstack(losses), numbers, np.sum(lost, axis=0, dtype=np.float64))

    def rows(self, settings: Sequence[Setting], cases: Sequence[TuningCase]) -> list[list[list[Row]]]:
        """Return for each case the rows of each setting, and last those of the plain filter."""
        jobs = planned((cell, case.draws) for case in cases for cell in self._cells(settings, case))
        store, quiet = Store(self._runs.folder), Progress(0)
        run_sweep(
            joined_plan(jobs),
            store,
            self._runs.workers,
            strict=True,
            progress=quiet,
            threads=self._threads,
            least=MOST_TASKS,
        )
        rows = rows_of(jobs, store, [self.objective.column])
        each: Iterator[Any] = (own.to_dict("records") for _, own in rows.groupby("place", sort=False))
        return [[next(each) for _ in range(len(settings) + 1)] for _ in cases]

    def _cells(self, settings: Sequence[Setting], case: TuningCase) -> Iterator[Cell]:
        """The cell of each setting, and that of the plain filter, with the objective as their only metric."""
        names = [self.objective.metric]
        for cell in (*(self.space.applied(case.cell, setting) for setting in settings), plain_cell(case.cell)):
            yield dataclasses.replace(cell, metrics=self._metrics, spec={**cell.spec, "metrics": names})

    def _worth(self, rows: Sequence[list[Row]], case: TuningCase) -> tuple[FloatArray, list[int]]:
        """Return (n, draws) the loss of each run, and how many runs of each setting were lost."""
        *tried, plain = rows
        self._require_value(plain, case)
        level = self.objective.level(plain, case.cell.protocol.divergence_limit_m)
        losses = np.array([self.objective.losses(own, level) for own in tried])
        return losses, [sum(run["status"] != "ok" for run in own) for own in tried]

    def _require_value(self, rows: Sequence[Row], case: TuningCase) -> None:
        """Check that runs that came to their end have a value, or every setting would count as lost."""
        column = self.objective.column
        if any(row["status"] == "ok" and np.isnan(row.get(column, np.nan)) for row in rows):
            raise PluginError(
                f"The filter {case.cell.spec['filter']['name']} has no {column} over {case.scenario}, so"
                f" objective={self.objective.name} cannot be used; take another objective."
            )


def plain_cell(cell: Cell) -> Cell:
    """Return the cell with its filter at its defaults, without adaptation, with R as reported.

    Where nothing is navigated it is `mekf` at its defaults: a Kalman filter without adaptation.
    """
    name = cell.spec["filter"]["name"]
    if is_attitude_only(cell.filter):
        plain = plugins.create("attitude", {"name": "mekf"})
        spec = {**cell.spec, "attitude": {"name": "mekf", **dataclasses.asdict(plain)}}
        return dataclasses.replace(cell, attitude=plain, spec=spec)
    model, none = plugins.create("filter", {"name": name}), plugins.create("adaptation", {"name": "none"})
    spec = {
        **cell.spec,
        "filter": {"name": name, **dataclasses.asdict(model)},
        "adaptation": {"name": "none"},
        "r_scale": {"position": 1.0, "velocity": 1.0},
    }
    r_scale = type(cell.r_scale)()
    return dataclasses.replace(cell, filter=model, adaptation=none, r_scale=r_scale, spec=spec)


def trial_table(trials: Trials, names: Sequence[str], scenarios: Sequence[str]) -> pd.DataFrame:
    """Return a row for each trial: its number, its values, the loss of each scenario and their mean."""
    values = np.array(trials.settings, dtype=np.float64).reshape(len(trials), len(names))
    columns: dict[str, Any] = {"trial": range(len(trials))}
    columns |= {name: values[:, k] for k, name in enumerate(names)}
    columns |= {f"loss: {scenario}": trials.losses[:, k] for k, scenario in enumerate(scenarios)}
    return pd.DataFrame({**columns, "loss": trials.means, "lost_runs": trials.lost})


LACKING = {
    "enu_m": (
        "position",
        "use objective=likelihood, or withhold fixes: disturbance=withhold; of an attitude alone objective=inclination",
    ),
    "euler_rad": ("attitude", "use objective=rmse"),
}
"""What a recording without that part of the reference lacks, and what else there is."""


def require_scorable(objective: Objective, cases: Sequence[TuningCase], load: Callable[[TuningCase], object]) -> None:
    """Check that the recordings have what the objective asks for.

    Raises:
        RecordingError: one has no such reference.
    """
    for case in cases:
        reference = getattr(load(case), "reference", None)
        if objective.reference and getattr(reference, objective.reference, None) is None:
            what, other = LACKING[objective.reference]
            raise RecordingError(
                f"{case.cell.labels.dataset} has no reference {what}, so objective={objective.name} has nothing to"
                f" compare with; {other}."
            )
