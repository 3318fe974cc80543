"""The evaluation of settings on cases: their runs, as losses against the plain filter by an objective."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.contracts import Metric, is_attitude_only
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.jobs.job import Job
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Row
from jerkbench.recording import Recording
from jerkbench.timeline import RScale
from jerkbench.tuning.entrant import Site
from jerkbench.tuning.space import Setting, Space

# The objectives: what a setting is worth on a case, as one number; the smaller, the better.

LOST_RUN = math.log(100.0)
"""What a lost run counts, and the most that any counts: a hundred times the error of the plain filter."""


@dataclass(frozen=True)
class Objective:
    """A column of a run's row, compared with what the plain filter has in it.

    Attributes:
        name: what one asks for.
        metric: the metric that gives the column.
        column: of a row.
        relative: whether the logarithm of the ratio to the plain filter counts, or the difference.
        reference: the part of the reference that a recording needs to be tuned on; empty: none.
        meaning: what its numbers say, one phrase.
    """

    name: str
    metric: str
    column: str
    relative: bool
    reference: str
    meaning: str

    def losses(self, rows: Sequence[Row], plain: float) -> FloatArray:
        """Return (len(rows),) the loss of each run; ``plain`` is the `level` of the plain filter over the scenario.

        With c the column: log(c/plain), or c - plain; of a run that is lost log 100, and never more than that.
        """
        values = self.values(rows)
        losses = np.log(values / plain) if self.relative else values - plain
        return np.asarray(np.fmin(losses, LOST_RUN))  # of NaN and a number the number

    def level(self, rows: Sequence[Row], limit_m: float) -> float:
        """Return the mean of the runs that came to their end: geometric of errors, plain of scores.

        Where all are lost it is the error at which a run is lost, ``limit_m``, or a score of 0.
        """
        values = self.values(rows)
        values = values[np.isfinite(values)]
        if not len(values):
            return limit_m if self.relative else 0.0
        return float(np.exp(np.log(values).mean()) if self.relative else values.mean())

    def values(self, rows: Sequence[Row]) -> FloatArray:
        """Return (len(rows),) the column of each run; NaN if the run was lost."""
        values = np.array(
            [row.get(self.column, math.nan) if row["status"] == "ok" else math.nan for row in rows], float
        )
        return np.where(np.isfinite(values) & ((values > 0) | (not self.relative)), values, math.nan)


RATIO = "position RMSE as a ratio to the plain filter of the same model, geometric mean; a lost run counts 100"
TILT = "inclination RMSE as a ratio to mekf at its defaults, geometric mean; a lost run counts 100"
LESS_LIKELY = "nats an update by which the measurements are less likely than under the plain filter of the same model"

OBJECTIVES = {
    "rmse": Objective("rmse", "position_rmse", "position_rmse_m", True, "enu_m", RATIO),  # noqa: FBT003 - relative
    "inclination": Objective("inclination", "inclination", "inclination_rmse_deg", True, "euler_rad", TILT),  # noqa: FBT003 - relative
    "likelihood": Objective("likelihood", "innovation_likelihood", "innovation_log_loss", False, "", LESS_LIKELY),  # noqa: FBT003
}


def objective_of(name: str) -> Objective:
    """Return the objective ``name``.

    Raises:
        PluginError: there is none.
    """
    require_known("objective", name, OBJECTIVES)
    return OBJECTIVES[name]


@dataclass(frozen=True, eq=False)
class Trials:
    """Settings, in the order in which they were tried.

    Attributes:
        settings: n of them.
        runs: (n, r) loss of each of its runs.
        case: (r,) which case each of them is of.
        lost: (n, r) whether the run was lost.
        values: (n, r) the column of the objective, as `Objective.values` returns it.
    """

    settings: tuple[Setting, ...]
    runs: FloatArray
    case: IntArray
    lost: BoolArray
    values: FloatArray

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
    runs, lost, values = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("runs", "lost", "values")
    )
    return Trials(settings, runs, parts[0].case, lost, values)


@dataclass(frozen=True)
class Evaluator:
    """Runs settings over cases; a run that is stored already is not done again.

    Attributes:
        space: the knobs.
        objective: what a setting is worth.
        threads: how many the engine may use in each process.
        runs: where they are done and stored, those of other searches, too.
    """

    space: Space
    objective: Objective
    threads: int
    runs: Site

    def trials(self, settings: Sequence[Setting], cases: Sequence[Job]) -> Trials:
        """Try each of ``settings`` on each of ``cases``.

        Raises:
            JerkbenchError: a run failed for another reason than that the filter diverged.
        """
        worths = [self._worth(rows, case) for rows, case in zip(self.rows(settings, cases), cases, strict=True)]
        numbers = np.repeat(np.arange(len(cases)), [len(case.draws) for case in cases])
        losses, lost, values = map(np.hstack, zip(*worths, strict=True))
        return Trials(tuple(settings), losses, numbers, lost, values)

    def rows(self, settings: Sequence[Setting], cases: Sequence[Job]) -> list[list[list[Row]]]:
        """Return for each case the rows of each setting, and last those of the plain filter."""
        jobs = [job for case in cases for job in self._jobs(settings, case)]
        how = {"strict": True, "progress": Progress(0), "threads": self.threads}
        rows = self.runs.rows_of(jobs, [self.objective.column], **how)
        each: Iterator[Any] = (own.to_dict("records") for _, own in rows.groupby("place", sort=False))
        return [[next(each) for _ in range(len(settings) + 1)] for _ in cases]

    def _jobs(self, settings: Sequence[Setting], case: Job) -> Iterator[Job]:
        """The job of each setting, and that of the plain filter, with the objective as their only metric."""
        metric: Metric = plugins.create("metric", {"name": self.objective.metric})
        evaluation = dataclasses.replace(case.evaluation, metrics=(metric,), names=(self.objective.metric,))
        for job in (*(self.space.applied(case, setting) for setting in settings), plain_job(case)):
            yield dataclasses.replace(job, evaluation=evaluation)

    def _worth(self, rows: Sequence[list[Row]], case: Job) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Return (n, draws) the loss of each run, whether it was lost, and its value."""
        *tried, plain = rows
        column = self.objective.column
        if any(row["status"] == "ok" and np.isnan(row.get(column, np.nan)) for row in plain):  # all would count as lost
            raise PluginError(
                f"The filter {case.method.plain['filter']['name']} has no {column} over {case.labels.scenario}, so"
                f" objective={self.objective.name} cannot be used; take another objective."
            )
        level = self.objective.level(plain, case.evaluation.divergence_limit_m)
        losses = np.array([self.objective.losses(own, level) for own in tried])
        lost = np.array([[row["status"] != "ok" for row in own] for own in tried])
        return losses, lost, np.array([self.objective.values(own) for own in tried])


def plain_job(job: Job) -> Job:
    """Return the job with its filter at its defaults, without adaptation, with R as reported.

    Where nothing is navigated it is `mekf` at its defaults: a Kalman filter without adaptation.
    """
    scenario, method = job.scenario, job.method
    if is_attitude_only(method.filter):
        mekf = plugins.create("attitude", {"name": "mekf"})
        plain = {**scenario.plain, "attitude": {"name": "mekf", **dataclasses.asdict(mekf)}}
        return dataclasses.replace(job, scenario=dataclasses.replace(scenario, attitude=mekf, plain=plain))
    name = method.plain["filter"]["name"]
    model, none = plugins.create("filter", {"name": name}), plugins.create("adaptation", {"name": "none"})
    told = RScale()
    plain = {
        **method.plain,
        "filter": {"name": name, **dataclasses.asdict(model)},
        "adaptation": {"name": "none"},
        "r_scale": dataclasses.asdict(told),
    }
    own = dataclasses.replace(method, filter=model, adaptation=none, r_scale=told, plain=plain)
    return dataclasses.replace(job, method=own)


def trial_table(trials: Trials, names: Sequence[str], scenarios: Sequence[str]) -> pd.DataFrame:
    """Return a row for each trial: its number, its values, the loss of each scenario and their mean."""
    values = np.array(trials.settings, dtype=np.float64).reshape(len(trials), len(names))
    columns: dict[str, Any] = {"trial": range(len(trials))}
    columns |= {name: values[:, k] for k, name in enumerate(names)}
    columns |= {f"loss: {scenario}": trials.losses[:, k] for k, scenario in enumerate(scenarios)}
    return pd.DataFrame({**columns, "loss": trials.means, "lost_runs": trials.lost.sum(axis=1)})


LACKING = {
    "enu_m": (
        "position",
        "use objective=likelihood, or withhold fixes: disturbance=withhold; of an attitude alone objective=inclination",
    ),
    "euler_rad": ("attitude", "use objective=rmse"),
}
"""What a recording without that part of the reference lacks, and what else there is."""


def require_scorable(objective: Objective, case: Job, recording: Recording) -> None:
    """Check that a recording has what the objective asks for.

    Raises:
        RecordingError: it has no such reference.
    """
    if objective.reference and getattr(recording.reference, objective.reference, None) is None:
        what, other = LACKING[objective.reference]
        raise RecordingError(
            f"{case.labels.dataset} has no reference {what}, so objective={objective.name} has nothing to"
            f" compare with; {other}."
        )
