"""Methods and scenarios of tunings, suites and audits, candidate settings of a search, and the computation of runs."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.campaign.space import Setting, Space, sampler_of, space_of
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError
from jerkbench.jobs.executors import Workers
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.names import job_of_parts, refusal
from jerkbench.jobs.plan import Plan, joined_jobs, sharing_scenarios
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.parameters import ranges_of

POSITION_ERROR = "position_rmse_m"
"""Column with the position error, from which suites and audits compute the loss of a run."""
METRICS = ("position_rmse",)
LIMITS = Protocol()
MAX_JOBS = 20_000
"""Maximum number of jobs that are in memory at the same time."""
MAX_FILES = 16
"""Number of small files with stored rows from which these files are joined into one file."""


@dataclass(frozen=True)
class FaultScenario:
    """A data set with one disturbance.

    Attributes:
        noise: Label of the data set in tables.
        dataset: Name and parameters of the data set.
        fault: Label of the disturbance in tables.
        disturbance: Name and parameters of the disturbance.
    """

    noise: str
    dataset: Mapping[str, Any]
    fault: str
    disturbance: Mapping[str, Any]


@dataclass(frozen=True)
class MethodSpec:
    """A filter with an adaptation, as plain data.

    Attributes:
        filter: Name and parameters of the filter.
        adaptation: Name and parameters of the adaptation.
        r_scale: Factors on the reported measurement covariance R, by the name of the stream (position or velocity).
    """

    filter: Mapping[str, Any]
    adaptation: Mapping[str, Any]
    r_scale: Mapping[str, float]

    @classmethod
    def named(cls, filter: str, adaptation: str) -> "MethodSpec":  # noqa: A002 - name of the group
        """Return the specification of a filter and an adaptation with their default parameters."""
        return cls({"name": filter}, {"name": adaptation}, {})

    @property
    def name(self) -> str:
        """The names of the filter and the adaptation."""
        return f"{self.filter['name']} + {self.adaptation['name']}"

    def job(self, scenario: FaultScenario, limits: Protocol = LIMITS, metrics: Sequence[str] = METRICS) -> Job:
        """Return the job that runs the method on a scenario, with the attitude filter that the data set prefers.

        Raises:
            PluginError: The method cannot be created, or its filter does not support the adaptation or the data set.
        """
        single = {"dataset": scenario.dataset, "attitude": None, "engine": "compiled"}
        single |= {"filter": self.filter, "adaptation": self.adaptation}
        job = job_of_parts(single, [scenario.disturbance], None, limits, metrics, self.r_scale or None)
        if reason := refusal(job):
            raise PluginError(f"This method cannot run on the drives of a suite or an audit: {reason}.")
        return dataclasses.replace(job, labels=job.labels._replace(dataset=scenario.noise, disturbance=scenario.fault))


def tunable_space(job: Job) -> Space:
    """Return the search space of the method of a job. The search space is empty if no parameter is tunable."""
    scenario, method = job.scenario, job.method
    parts = (scenario.attitude,) if is_attitude_only(method.filter) else (method.filter, method.adaptation)
    return space_of(job) if any(ranges_of(type(part)) for part in parts) else Space(())


def tried_settings(trials: int, space: Space, scramble: int = 0) -> tuple[Setting, ...]:
    """Return the candidate settings of a search: the default setting, followed by points of a Sobol sequence.

    For methods with the same number of parameters, the points are at the same fractions of the parameter ranges.
    """
    if not space.parameters or trials < 2:
        return (space.start,)
    return (space.start, *map(space.setting, _points(len(space.parameters), scramble, trials - 1)))


_points: Callable[[int, int, int], FloatArray] = lru_cache(256)(
    lambda k, seed, n: sampler_of("sobol", k, seed).suggest(n)
)
"""Points of a Sobol sequence. They are cached, because scrambling a Sobol sequence takes as long as several runs."""


@dataclass(frozen=True)
class CampaignRuns:
    """Computes the runs of a tuning, a suite or an audit, and stores their rows.

    Attributes:
        folder: Folder of the stored rows.
        workers: Processes that compute the runs. If ``workers`` is None, the current process computes the runs.
    """

    folder: Path
    workers: Workers | None = None

    def rows(
        self, jobs: Iterable[Job], numbers: Sequence[str], progress: Progress, *, strict: bool = False, threads: int = 1
    ) -> pd.DataFrame:
        """Compute the runs of ``jobs`` that are not stored, and return the rows of all runs in order.

        Args:
            jobs: The jobs, with the requested seeds. Jobs of the same scenario should be consecutive.
            numbers: Names of the metric columns to return.
            progress: A progress bar that is advanced for each finished job.
            strict: Whether to raise errors of inputs and plugins instead of storing failed rows.
            threads: Number of threads of the engine in each process.

        Returns:
            A table with the columns ``job_index`` (index of the job in ``jobs``), ``seed``, ``status``, ``reason``,
            ``run_s`` (duration of the run [s]) and the columns ``numbers``.

        Raises:
            JerkbenchError: The rows cannot be stored, or the cluster cannot continue.
        """
        store, parts, start, rest = Store(self.folder), [], 0, iter(jobs)
        while several := sharing_scenarios(islice(rest, MAX_JOBS)):
            plan = Plan(joined_jobs(several))
            run_missing(plan, store, self.workers, strict=strict, progress=progress, threads=threads)
            progress.advance(count=len(several) - len({job.key for job in several}))  # equal jobs run only once
            rows = store.rows(several, numbers).astype(dict.fromkeys(numbers, float))
            parts.append(rows.assign(job_index=rows["job_index"] + start))
            start += len(several)
        store.compact(MAX_FILES)
        return pd.concat(parts, ignore_index=True)

    def rows_of_settings(
        self, job: Job, settings: Iterable[tuple[Setting, Sequence[int]]], numbers: Sequence[str], progress: Progress
    ) -> pd.DataFrame:
        """Run one job with several settings, and return the rows.

        Each element of ``settings`` is a setting with its seeds.
        """
        space = tunable_space(job)
        jobs = (dataclasses.replace(space.applied(job, setting), draws=seeds) for setting, seeds in settings)
        return self.rows(jobs, numbers, progress)
