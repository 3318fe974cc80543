"""The search: settings are tried, one is chosen, and it is tested on runs that no search has used."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.campaign.runs import CampaignRuns
from jerkbench.campaign.space import Setting, Space, sampler_of
from jerkbench.campaign.split import Cases
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.jobs.progress import Progress
from jerkbench.r_scale import RScale
from jerkbench.recording import Recording

FAILED_RUN = math.log(100.0)
"""The loss of a failed run, and the largest loss of a run: the error is 100 times that of the plain filter."""
SETTINGS_AT_ONCE = 16
"""Settings that are tried together. A learning sampler learns after each block."""


def log_losses_to(values: FloatArray, level: FloatArray | float) -> FloatArray:
    """Return log(values/level), at most log 100; NaN, the value of a failed run, counts log 100."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.fmin(np.log(values / level), FAILED_RUN))


@dataclass(frozen=True)
class Objective:
    """A column of the rows, compared with the plain filter.

    Attributes:
        name: name of the objective.
        metric: metric that computes the column.
        column: column of a row.
        relative: whether the loss is the logarithm of the ratio to the plain filter, or the difference.
        reference: part of the reference that a recording needs; empty: none.
        lacking: message for a recording without that part.
        meaning: description of the loss.
    """

    name: str
    metric: str
    column: str
    relative: bool
    reference: str
    lacking: str
    meaning: str

    def values(self, rows: pd.DataFrame) -> FloatArray:
        """Return the column (n,) of each run; NaN if the run failed."""
        values = rows[self.column].where(rows["status"] == "ok").to_numpy(dtype=np.float64)
        return np.where(np.isfinite(values) & ((values > 0) | (not self.relative)), values, np.nan)

    def losses(self, values: FloatArray, level: float) -> FloatArray:
        """Return the loss of each run, compared with the ``level`` of the plain filter."""
        return log_losses_to(values, level) if self.relative else np.asarray(np.fmin(values - level, FAILED_RUN))

    def level(self, values: FloatArray, limit_m: float) -> float:
        """Return the mean of the successful runs, geometric for errors; ``limit_m`` or 0 if all failed."""
        values = values[np.isfinite(values)]
        if not len(values):
            return limit_m if self.relative else 0.0
        return float(np.exp(np.log(values).mean()) if self.relative else values.mean())

    def require_reference(self, case: Job, recording: Recording) -> None:
        """Check that a recording has the reference that the objective needs.

        Raises:
            RecordingError: It does not.
        """
        if self.reference and getattr(recording.reference, self.reference, None) is None:
            raise RecordingError(f"{case.labels.dataset} has no reference {self.lacking}.")


OBJECTIVES = {
    objective.name: objective
    for objective in (
        Objective(
            name="rmse",
            metric="position_rmse",
            column="position_rmse_m",
            relative=True,
            reference="enu_m",
            lacking="position, so objective=rmse has nothing to compare with; use objective=likelihood, or withhold"
            " fixes: disturbance=withhold; of an attitude alone objective=inclination",
            meaning="position RMSE as a ratio to the plain filter of the same model, geometric mean; a lost run counts"
            " 100",
        ),
        Objective(
            name="inclination",
            metric="inclination",
            column="inclination_rmse_deg",
            relative=True,
            reference="euler_rad",
            lacking="attitude, so objective=inclination has nothing to compare with; use objective=rmse",
            meaning="inclination RMSE as a ratio to mekf at its defaults, geometric mean; a lost run counts 100",
        ),
        Objective(
            name="likelihood",
            metric="innovation_likelihood",
            column="innovation_log_loss",
            relative=False,
            reference="",
            lacking="",
            meaning="nats an update by which the measurements are less likely than under the plain filter of the same"
            " model",
        ),
    )
}


def objective_of(name: str) -> Objective:
    """Return the objective ``name``.

    Raises:
        PluginError: There is none of that name.
    """
    require_known("objective", name, OBJECTIVES)
    return OBJECTIVES[name]


@dataclass(frozen=True, eq=False)
class Trials:
    """Settings in the order in which they were tried.

    Attributes:
        settings: n settings.
        runs: (n, r) loss of each run.
        case: (r,) index of the case of each run.
        failed: (n, r) whether the run failed.
        values: (n, r) column of the objective; NaN if the run failed.
    """

    settings: tuple[Setting, ...]
    runs: FloatArray
    case: IntArray
    failed: BoolArray
    values: FloatArray

    @property
    def losses(self) -> FloatArray:
        """(n, cases) mean loss over the seeds of each case."""
        cases = range(int(self.case.max(initial=-1)) + 1)
        return np.column_stack([self.runs[:, self.case == k].mean(axis=1) for k in cases])

    @property
    def means(self) -> FloatArray:
        """(n,) mean loss over the cases. The search minimises it."""
        return np.asarray(self.losses.mean(axis=1))

    def best(self, count: int) -> list[int]:
        """Return the indices of the ``count`` best settings, the best first; of equal ones the earlier."""
        return [int(k) for k in np.argsort(self.means, kind="stable")[:count]]

    def __len__(self) -> int:
        """Return the number of settings."""
        return len(self.settings)


@dataclass(frozen=True)
class Evaluator:
    """Runs settings on cases.

    Attributes:
        space: search space of the method.
        objective: loss of a run.
        runs: where runs are computed and stored.
        threads: number of threads of the engine in each process.
    """

    space: Space
    objective: Objective
    runs: CampaignRuns
    threads: int = 1

    def trials(self, settings: Sequence[Setting], cases: Sequence[Job]) -> Trials:
        """Try each setting on each case.

        Raises:
            JerkbenchError: A run failed, and not because the filter diverged.
        """
        objective = self.objective
        jobs = [job for case in cases for job in self._jobs(settings, case)]
        rows = self.runs.rows(jobs, [objective.column], Progress(0), strict=True, threads=self.threads)
        size = [len(case.draws) * (len(settings) + 1) for case in cases]
        losses, failed, values = [], [], []
        for case, own in zip(cases, np.split(np.arange(len(rows)), np.cumsum(size)[:-1]), strict=True):
            of_case = rows.iloc[own]
            *tried, plain = objective.values(of_case).reshape(len(settings) + 1, -1)
            *ok, plain_ok = (of_case["status"] == "ok").to_numpy().reshape(len(settings) + 1, -1)
            if (plain_ok & of_case[objective.column].isna().to_numpy()[-len(plain) :]).any():
                raise PluginError(
                    f"The filter {case.method.plain['filter']['name']} has no {objective.column} over"
                    f" {case.labels.scenario}, so objective={objective.name} cannot be used; take another objective."
                )
            level = objective.level(plain, case.evaluation.divergence_limit_m)
            losses.append(objective.losses(np.array(tried), level))
            failed.append(~np.array(ok))
            values.append(np.array(tried))
        of_run = np.repeat(np.arange(len(cases)), [len(case.draws) for case in cases])
        return Trials(tuple(settings), np.hstack(losses), of_run, np.hstack(failed), np.hstack(values))

    def _jobs(self, settings: Sequence[Setting], case: Job) -> Iterator[Job]:
        """The job of each setting and of the plain filter, with the objective as the only metric."""
        name = self.objective.metric
        evaluation = replace(case.evaluation, metrics=(plugins.create("metric", {"name": name}),), names=(name,))
        for job in (*(self.space.applied(case, setting) for setting in settings), plain_job(case)):
            yield replace(job, evaluation=evaluation)


def plain_job(job: Job) -> Job:
    """Return the job with the default parameters of its filter, without adaptation, with R as reported.

    For `attitude_only` the plain filter is `mekf` with its default parameters.
    """
    scenario, method = job.scenario, job.method
    if is_attitude_only(method.filter):
        mekf = plugins.create("attitude", {"name": "mekf"})
        plain = {**scenario.plain, "attitude": {"name": "mekf", **asdict(mekf)}}
        return replace(job, scenario=replace(scenario, attitude=mekf, plain=plain))
    name = method.plain["filter"]["name"]
    model, none, r_scale = (
        plugins.create("filter", {"name": name}),
        plugins.create("adaptation", {"name": "none"}),
        RScale(),
    )
    plain = {
        **method.plain,
        "filter": {"name": name, **asdict(model)},
        "adaptation": {"name": "none"},
        "r_scale": asdict(r_scale),
    }
    return replace(job, method=replace(method, filter=model, adaptation=none, r_scale=r_scale, plain=plain))


@dataclass(frozen=True)
class Budget:
    """The effort of a tuning, the same for every method of a comparison.

    Attributes:
        trials: settings that are tried on the cases to tune on, the one before the search among them.
        sampler: sobol, tpe or cma_es.
        finalists: number of the best settings that are tried again on the cases to choose on.
        seed: seed of the sampler.
        restarts: number of searches; the setting of the first one is taken, and the others show the luck of a search.
    """

    trials: int = 64
    sampler: str = "sobol"
    finalists: int = 8
    seed: int = 0
    restarts: int = 1

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.trials < 1 or self.finalists < 1 or self.seed < 0:
            raise PluginError(
                f"trials is {self.trials}, finalists {self.finalists} and sampler_seed {self.seed}; at least one trial"
                " and one finalist are needed, and a seed is not negative."
            )
        if self.restarts < 1:
            raise PluginError(f"restarts is {self.restarts}; at least one search is needed.")


class SearchOutcome(NamedTuple):
    """The result of a search.

    Attributes:
        setting: the chosen setting.
        place: its index among the trials.
        trials: all settings, on the cases to tune on.
    """

    setting: Setting
    place: int
    trials: Trials


def search(evaluator: Evaluator, cases: Cases, budget: Budget, advance: Callable[[int], object] = int) -> SearchOutcome:
    """Try ``budget.trials`` settings and choose one. The cases to test on are not used.

    Args:
        evaluator: Runs the settings.
        cases: Cases to tune and to choose on.
        budget: Effort of the search.
        advance: Called with the number of settings of each block.

    Raises:
        JerkbenchError: The sampler is unknown, or a run failed.
    """
    space, sampler = evaluator.space, sampler_of(budget.sampler, len(evaluator.space.parameters), budget.seed)
    blocks: list[Trials] = []
    for start in range(0, budget.trials, SETTINGS_AT_ONCE):
        first = [] if start else [space.start]
        count = min(SETTINGS_AT_ONCE, budget.trials - start) - len(first)
        blocks.append(evaluator.trials([*first, *map(space.setting, sampler.ask(count) if count else ())], cases.tune))
        if count:
            sampler.tell(blocks[-1].means[len(first) :].tolist())
        advance(len(blocks[-1]))
    settings = tuple(setting for block in blocks for setting in block.settings)
    runs, failed, values = (np.concatenate([getattr(b, name) for b in blocks]) for name in ("runs", "failed", "values"))
    trials = Trials(settings, runs, blocks[0].case, failed, values)
    best = trials.best(budget.finalists if cases.choose else 1)
    if cases.choose:
        best = [best[k] for k in evaluator.trials([settings[place] for place in best], cases.choose).best(1)]
    return SearchOutcome(settings[best[0]], best[0], trials)


class TuningScore(NamedTuple):
    """Losses on runs that the search has not used, mean over the seeds of each case.

    Attributes:
        before: (cases,) loss of the setting before the search.
        chosen: (cases,) loss of the chosen setting.
        failed_before: number of failed runs of the setting before the search.
        failed: number of failed runs of the chosen setting.
        runs: number of runs of each.
        errors_before: (n,) geometric mean over the cases of the errors of the setting before the search, for each seed
            that all cases share; infinite if a run failed; empty without common seeds, or if the objective is no error.
        errors: (n,) the same of the chosen setting.
    """

    before: FloatArray
    chosen: FloatArray
    failed_before: int
    failed: int
    runs: int
    errors_before: FloatArray
    errors: FloatArray


def score(evaluator: Evaluator, setting: Setting, cases: Sequence[Job]) -> TuningScore:
    """Return the losses of the setting before the search and of ``setting`` on cases that the search has not used."""
    both = evaluator.trials([evaluator.space.start, setting], cases)
    errors = np.empty((2, 0))
    shared = all(case.scenario.seeded and case.draws == cases[0].draws for case in cases)
    if shared and evaluator.objective.relative:
        errors = np.exp(np.log(both.values).reshape(2, len(cases), -1).mean(axis=1))
        errors[np.isnan(errors)] = np.inf
    (before, chosen), (failed_before, failed) = both.losses, both.failed.sum(axis=1).tolist()
    return TuningScore(before, chosen, failed_before, failed, both.failed.shape[1], errors[0], errors[1])


@dataclass(frozen=True, eq=False)
class Tuning:
    """A tuned method.

    Attributes:
        name: name of the method, fit for a file.
        evaluator: search space and objective.
        cases: cases to tune, to choose and to test on.
        budget: effort.
        outcomes: result of each search, the first search first.
        scores: score of each search on the cases to test on.
        interval_s: nominal interval of the IMU [s]; None: there is no IMU.
    """

    name: str
    evaluator: Evaluator
    cases: Cases
    budget: Budget
    outcomes: tuple[SearchOutcome, ...]
    scores: tuple[TuningScore, ...]
    interval_s: float | None

    @property
    def space(self) -> Space:
        """Search space of the method."""
        return self.evaluator.space

    @property
    def objective(self) -> Objective:
        """The loss of a run."""
        return self.evaluator.objective

    @property
    def job(self) -> Job:
        """The first scenario with the method before the search."""
        return self.cases.tune[0]

    @property
    def outcome(self) -> SearchOutcome:
        """Result of the first search, so that all methods have the same effort."""
        return self.outcomes[0]

    @property
    def setting(self) -> Setting:
        """The chosen setting."""
        return self.outcome.setting

    @property
    def score(self) -> TuningScore:
        """Score of the chosen setting on the cases to test on."""
        return self.scores[0]


def tune(
    name: str, cases: Cases, evaluator: Evaluator, budget: Budget, advance: Callable[[int], object] = int
) -> Tuning:
    """Tune one method. Stored runs are not computed again.

    Raises:
        JerkbenchError: A recording lacks the reference of the objective, or a run failed.
    """
    first = cases.tune[0]
    recording = shared_inputs().recording(first.scenario, first.draws[0])
    evaluator.objective.require_reference(first, recording)
    budgets = [replace(budget, seed=budget.seed + k) for k in range(budget.restarts)]
    outcomes = tuple(search(evaluator, cases, own, advance) for own in budgets)
    scores = tuple(score(evaluator, outcome.setting, cases.test) for outcome in outcomes)
    interval_s = recording.imu.nominal_interval_s if recording.imu is not None else None
    return Tuning(name, evaluator, cases, budget, outcomes, scores, interval_s)
