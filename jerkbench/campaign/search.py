"""The search for the best parameter setting of a method, and the score of the selected setting on unused runs."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.campaign.runs import CampaignRuns, Setting, Space, sampler_of
from jerkbench.campaign.split import Cases
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.jobs.job import Job
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import shared_inputs
from jerkbench.parameters import AT_LEAST_ONE, NOT_NEGATIVE, Limited, RScale
from jerkbench.recording import Recording

FAILED_RUN = math.log(100.0)
"""The loss of a failed run and the limit of all losses: log 100, for 100 times the error of the plain filter."""
SETTINGS_AT_ONCE = 16
"""Number of settings that are evaluated as one block. An adaptive sampler receives the losses after each block."""


def log_losses_to(values: FloatArray, level: FloatArray | float) -> FloatArray:
    """Return log(values/level), limited to log 100. A failed run, whose value is NaN, also has the loss log 100."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.fmin(np.log(values / level), FAILED_RUN))


@dataclass(frozen=True)
class Objective:
    """The objective of a tuning: the metric from which the loss of a run is computed, relative to the plain filter.

    Attributes:
        name: Name of the objective.
        metric: Name of the metric.
        column: Name of the column of the rows that contains the metric.
        meaning: Description of the loss.
        reference: Name of the array that the reference of a recording must have (empty if no array is required).
        lacking: End of the error message for a recording whose reference does not have the array.
        relative: Whether the loss is the log ratio to the value of the plain filter. If ``relative`` is False, the loss
            is the difference from the value of the plain filter.
    """

    name: str
    metric: str
    column: str
    meaning: str
    reference: str = ""
    lacking: str = ""
    relative: bool = True

    def values(self, rows: pd.DataFrame) -> FloatArray:
        """Return the (n,) values of the metric in n runs. The value of a failed run is NaN."""
        values = rows[self.column].where(rows["status"] == "ok").to_numpy(dtype=np.float64)
        return np.where(np.isfinite(values) & ((values > 0) | (not self.relative)), values, np.nan)

    def losses(self, values: FloatArray, level: float) -> FloatArray:
        """Return the losses of runs with the given metric values. ``level`` is the mean value of the plain filter."""
        return log_losses_to(values, level) if self.relative else np.asarray(np.fmin(values - level, FAILED_RUN))

    def level(self, values: FloatArray, limit_m: float) -> float:
        """Return the mean value of the successful runs of the plain filter (geometric mean if the loss is a log ratio).

        If all runs of the plain filter failed, return ``limit_m``, or 0 if the loss is a difference.
        """
        values = values[np.isfinite(values)]
        if not len(values):
            return limit_m if self.relative else 0.0
        return float(np.exp(np.log(values).mean()) if self.relative else values.mean())

    def require_reference(self, case: Job, recording: Recording) -> None:
        """Check that a recording has the reference that the objective needs.

        Raises:
            RecordingError: The recording does not have the reference that the objective needs.
        """
        if self.reference and getattr(recording.reference, self.reference, None) is None:
            raise RecordingError(f"{case.labels.dataset} has no reference {self.lacking}.")


_RMSE = "position RMSE as a ratio to the plain filter of the same model, geometric mean; a failed run counts 100"
_INCLINATION = "inclination RMSE as a ratio to mekf at its defaults, geometric mean; a failed run counts 100"
_LIKELIHOOD = "negative log-likelihood of an update [nats], minus the value of the plain filter; lower is better"
_NO_POSITION = "position; use objective=likelihood, withhold fixes (disturbance=withhold), or objective=inclination"
_NO_ATTITUDE = "attitude, so objective=inclination is not possible; give a data set with a reference attitude"
OBJECTIVES = {
    objective.name: objective
    for objective in (
        Objective("rmse", "position_rmse", "position_rmse_m", _RMSE, "enu_m", _NO_POSITION),
        Objective("inclination", "inclination", "inclination_rmse_deg", _INCLINATION, "euler_rad", _NO_ATTITUDE),
        Objective("likelihood", "innovation_likelihood", "innovation_log_loss", _LIKELIHOOD, relative=False),
    )
}


def objective_of(name: str) -> Objective:
    """Return the objective with the name ``name``.

    Raises:
        PluginError: The name of the objective is unknown.
    """
    require_known("objective", name, OBJECTIVES)
    return OBJECTIVES[name]


@dataclass(frozen=True, eq=False)
class Trials:
    """The settings that a search has evaluated, in order, and the results of their runs.

    Attributes:
        settings: The n evaluated settings.
        runs: (n, r) loss of each setting in each run.
        case: (r,) index of the case to which each run belongs.
        failed: (n, r) True if the run failed.
        values: (n, r) metric value of each setting in each run, or NaN if the run failed.
    """

    settings: tuple[Setting, ...]
    runs: FloatArray
    case: IntArray
    failed: BoolArray
    values: FloatArray

    @property
    def losses(self) -> FloatArray:
        """Mean loss of each setting over the seeds of each case, shape (n, number of cases)."""
        cases = range(int(self.case.max(initial=-1)) + 1)
        return np.column_stack([self.runs[:, self.case == k].mean(axis=1) for k in cases])

    @property
    def means(self) -> FloatArray:
        """Mean loss of each setting over all cases, shape (n,). The search minimises this mean loss."""
        return np.asarray(self.losses.mean(axis=1))

    def best(self, count: int) -> list[int]:
        """Return the indices of the ``count`` settings with the lowest mean losses, in the order of the mean loss.

        Settings with equal mean losses are returned in the order of the trials.
        """
        return [int(k) for k in np.argsort(self.means, kind="stable")[:count]]

    def __len__(self) -> int:
        return len(self.settings)


@dataclass(frozen=True)
class Evaluator:
    """Runs a method with different settings on cases, and computes the losses.

    Attributes:
        space: Search space of the method.
        objective: The objective, which defines the loss of a run.
        runs: Object that computes and stores the runs.
        threads: Number of threads of the engine in each process.
    """

    space: Space
    objective: Objective
    runs: CampaignRuns
    threads: int = 1

    def trials(self, settings: Sequence[Setting], cases: Sequence[Job]) -> Trials:
        """Run each setting on each case, and return the losses.

        Raises:
            JerkbenchError: A run failed for a reason other than divergence.
        """
        objective = self.objective
        jobs = [job for case in cases for job in self._jobs(settings, case)]
        rows = self.runs.rows(jobs, [objective.column], Progress(0), strict=True, threads=self.threads)
        size = [len(case.draws) * (len(settings) + 1) for case in cases]
        losses, failed, values = [], [], []
        for case, positions in zip(cases, np.split(np.arange(len(rows)), np.cumsum(size)[:-1]), strict=True):
            of_case = rows.iloc[positions]
            *tried, plain = objective.values(of_case).reshape(len(settings) + 1, -1)
            *ok, plain_ok = (of_case["status"] == "ok").to_numpy().reshape(len(settings) + 1, -1)
            if (plain_ok & of_case[objective.column].isna().to_numpy()[-len(plain) :]).any():
                lacking = f"has no {objective.column} in {case.labels.scenario}; use another objective"
                raise PluginError(f"The filter {case.method.plain['filter']['name']} {lacking}.")
            level = objective.level(plain, case.protocol.divergence_limit_m)
            losses.append(objective.losses(np.array(tried), level))
            failed.append(~np.array(ok))
            values.append(np.array(tried))
        of_run = np.repeat(np.arange(len(cases)), [len(case.draws) for case in cases])
        return Trials(tuple(settings), np.hstack(losses), of_run, np.hstack(failed), np.hstack(values))

    def _jobs(self, settings: Sequence[Setting], case: Job) -> Iterator[Job]:
        """Yield a job for each setting and a job for the plain filter.

        Each job computes only the metric of the objective.
        """
        name = self.objective.metric
        metrics = {name: plugins.create("metric", {"name": name})}
        for job in (*(self.space.applied(case, setting) for setting in settings), plain_job(case)):
            yield replace(job, metrics=metrics)


def plain_job(job: Job) -> Job:
    """Return the job of the plain filter, which has default parameters, no adaptation, and an unscaled R.

    For the filter `attitude_only`, the plain filter is the attitude filter `mekf` with its default parameters.
    """
    scenario, method = job.scenario, job.method
    if is_attitude_only(method.filter):
        mekf = plugins.create("attitude", {"name": "mekf"})
        plain = {**scenario.plain, "attitude": {"name": "mekf", **asdict(mekf)}}
        return replace(job, scenario=replace(scenario, attitude=mekf, plain=plain))
    name = method.plain["filter"]["name"]
    model, none = plugins.create("filter", {"name": name}), plugins.create("adaptation", {"name": "none"})
    plain = {"filter": {"name": name, **asdict(model)}, "adaptation": {"name": "none"}, "r_scale": asdict(RScale())}
    plain = {**method.plain, **plain}
    return replace(job, method=replace(method, filter=model, adaptation=none, r_scale=RScale(), plain=plain))


@dataclass(frozen=True)
class Budget(Limited):
    """The budget of a tuning. All methods of a comparison have the same budget.

    Attributes:
        trials: Number of settings that a search evaluates, including the setting before the search.
        sampler: Name of the sampler: sobol, tpe or cma_es.
        finalists: Number of the best settings that are evaluated again on the validation cases.
        seed: Seed of the sampler.
    """

    trials: Annotated[int, AT_LEAST_ONE] = 64
    sampler: str = "sobol"
    finalists: Annotated[int, AT_LEAST_ONE] = 8
    seed: Annotated[int, NOT_NEGATIVE] = 0


Advance = Callable[[int], object]
"""A callback that is called with the number of settings that were tried."""


class SearchOutcome(NamedTuple):
    """The result of a search.

    Attributes:
        setting: The selected setting.
        best: Index of the selected setting in ``trials``.
        trials: All evaluated settings with their results on the tuning cases.
    """

    setting: Setting
    best: int
    trials: Trials


def search(evaluator: Evaluator, cases: Cases, budget: Budget, advance: Advance = int) -> SearchOutcome:
    """Evaluate ``budget.trials`` settings and select one of them. The search does not use the test cases.

    Args:
        evaluator: Object that runs the settings and computes their losses.
        cases: The tuning cases and the validation cases.
        budget: The budget of the search.
        advance: Function that is called after each block of settings with the number of settings in the block.

    Raises:
        JerkbenchError: The sampler is unknown, or a run failed.
    """
    space, sampler = evaluator.space, sampler_of(budget.sampler, len(evaluator.space.parameters), budget.seed)
    blocks: list[Trials] = []
    for start in range(0, budget.trials, SETTINGS_AT_ONCE):
        first = [] if start else [space.start]
        count = min(SETTINGS_AT_ONCE, budget.trials - start) - len(first)
        blocks.append(
            evaluator.trials([*first, *map(space.setting, sampler.suggest(count) if count else ())], cases.tune)
        )
        if count:
            sampler.observe(blocks[-1].means[len(first) :].tolist())
        advance(len(blocks[-1]))
    settings = tuple(setting for block in blocks for setting in block.settings)
    runs, failed, values = (np.concatenate([getattr(b, name) for b in blocks]) for name in ("runs", "failed", "values"))
    trials = Trials(settings, runs, blocks[0].case, failed, values)
    best = trials.best(budget.finalists if cases.choose else 1)
    if cases.choose:
        best = [best[k] for k in evaluator.trials([settings[index] for index in best], cases.choose).best(1)]
    return SearchOutcome(settings[best[0]], best[0], trials)


class TuningScore(NamedTuple):
    """Losses on the test cases, which the search has not used. Each loss is the mean over the seeds of a case.

    Attributes:
        before: Losses of the setting before the search, shape (number of cases,).
        tuned: Losses of the selected setting, shape (number of cases,).
        failed_before: Number of failed runs of the setting before the search.
        failed: Number of failed runs of the selected setting.
        runs: Number of runs of each of the two settings.
        errors_before: (n,) errors of the setting before the search for the n common seeds of all cases, as geometric
            means over the cases. An error is infinite if a run with this seed failed. The array is empty if the cases
            have no common seeds, or if the loss is a difference.
        errors: Errors of the selected setting, in the same form as ``errors_before``.
        correlation: Mean correlation of successive innovations with the selected setting, or NaN if the objective is
            not the likelihood. The likelihood assumes a correlation of 0.
    """

    before: FloatArray
    tuned: FloatArray
    failed_before: int
    failed: int
    runs: int
    errors_before: FloatArray
    errors: FloatArray
    correlation: float = math.nan


def score(evaluator: Evaluator, setting: Setting, cases: Sequence[Job]) -> TuningScore:
    """Return the losses of the setting before the search and of ``setting`` on the test cases."""
    both = evaluator.trials([evaluator.space.start, setting], cases)
    errors = np.empty((2, 0))
    shared = all(case.scenario.seeded and case.draws == cases[0].draws for case in cases)
    if shared and evaluator.objective.relative:
        errors = np.exp(np.log(both.values).reshape(2, len(cases), -1).mean(axis=1))
        errors[np.isnan(errors)] = np.inf
    (before, tuned), (failed_before, failed) = both.losses, both.failed.sum(axis=1).tolist()
    correlation = math.nan
    if evaluator.objective.name == "likelihood":
        innovation = {"innovation": plugins.create("metric", {"name": "innovation"})}
        jobs = [replace(evaluator.space.applied(case, setting), metrics=innovation) for case in cases]
        rows = evaluator.runs.rows(jobs, ["innovation_correlation"], Progress(0), threads=evaluator.threads)
        correlation = float(rows["innovation_correlation"].mean())
    return TuningScore(before, tuned, failed_before, failed, both.failed.shape[1], errors[0], errors[1], correlation)


@dataclass(frozen=True, eq=False)
class Tuning:
    """A tuned method with the result of its search.

    Attributes:
        name: Name of the method, suitable as a file name.
        space: The search space of the method.
        objective: The objective, which defines the loss of a run.
        cases: The cases for tuning, validation and test.
        budget: The budget of the tuning.
        outcome: The result of the search.
        score: The score of the selected setting on the test cases.
        interval_s: Nominal sampling interval of the IMU [s], or None if the recording has no IMU.
    """

    name: str
    space: Space
    objective: Objective
    cases: Cases
    budget: Budget
    outcome: SearchOutcome
    score: TuningScore
    interval_s: float | None

    @property
    def job(self) -> Job:
        """The job of the first tuning case, with the parameter values before the search."""
        return self.cases.tune[0]

    @property
    def setting(self) -> Setting:
        """The setting that the search has selected."""
        return self.outcome.setting


def tune(name: str, cases: Cases, evaluator: Evaluator, budget: Budget, advance: Advance = int) -> Tuning:
    """Tune one method, and score the selected setting on the test cases. Stored runs are not computed again.

    Raises:
        JerkbenchError: A recording lacks the reference of the objective, or a run failed.
    """
    first = cases.tune[0]
    recording = shared_inputs().recording(first.scenario, first.draws[0])
    evaluator.objective.require_reference(first, recording)
    outcome = search(evaluator, cases, budget, advance)
    tested = score(evaluator, outcome.setting, cases.test)
    interval_s = recording.imu.nominal_interval_s if recording.imu is not None else None
    return Tuning(name, evaluator.space, evaluator.objective, cases, budget, outcome, tested, interval_s)
