"""Methods on scenarios, the settings that a search tries, and their runs: a stored run is not computed again."""

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
"""The column that a campaign minimises."""
LIMITS = Protocol()
MAX_JOBS = 20_000
"""Number of jobs that are in memory at the same time."""
MAX_FILES = 16
"""Number of small files of rows after which they are joined into one."""


@dataclass(frozen=True)
class FaultScenario:
    """A data set with a disturbance.

    Attributes:
        noise: label of the data set.
        dataset: name and parameters of the data set.
        fault: label of the disturbance.
        disturbance: name and parameters of the disturbance.
    """

    noise: str
    dataset: Mapping[str, Any]
    fault: str
    disturbance: Mapping[str, Any]


@dataclass(frozen=True)
class MethodSpec:
    """A filter with an adaptation, as plain data.

    Attributes:
        filter: name and parameters of the filter.
        adaptation: name and parameters of the adaptation.
        r_scale: factors on the reported R.
    """

    filter: Mapping[str, Any]
    adaptation: Mapping[str, Any]
    r_scale: Mapping[str, float]

    @classmethod
    def named(cls, filter: str, adaptation: str) -> "MethodSpec":  # noqa: A002 - name of the group
        """Return plugins with their default parameters."""
        return cls({"name": filter}, {"name": adaptation}, {})

    @property
    def name(self) -> str:
        """Names of the filter and the adaptation."""
        return f"{self.filter['name']} + {self.adaptation['name']}"

    def job(
        self, scenario: FaultScenario, limits: Protocol = LIMITS, metrics: Sequence[str] = ("position_rmse",)
    ) -> Job:
        """Return the job of the method on a scenario, with the attitude filter of the data set.

        Raises:
            PluginError: The method cannot be made, or its parts do not fit together.
        """
        single = {
            "dataset": scenario.dataset,
            "attitude": None,
            "filter": self.filter,
            "adaptation": self.adaptation,
            "engine": "compiled",
        }
        job = job_of_parts(single, [scenario.disturbance], None, limits, metrics, self.r_scale or None)
        if reason := refusal(job):
            raise PluginError(f"This method cannot enter: {reason}.")
        return dataclasses.replace(job, labels=job.labels._replace(dataset=scenario.noise, disturbance=scenario.fault))


def tunable_space(job: Job) -> Space:
    """Return the search space of a method. It is empty if no part has a parameter with a range, as for a program."""
    scenario, method = job.scenario, job.method
    parts = (scenario.attitude,) if is_attitude_only(method.filter) else (method.filter, method.adaptation)
    return space_of(job) if any(ranges_of(type(part)) for part in parts) else Space(())


def tried_settings(trials: int, space: Space, scramble: int = 0) -> tuple[Setting, ...]:
    """Return the settings that one search tries: the default setting, then points of a Sobol sequence.

    Two methods with the same number of parameters try the same fractions of their ranges.
    """
    if not space.parameters or trials < 2:
        return (space.start,)
    return (space.start, *map(space.setting, _points(len(space.parameters), scramble, trials - 1)))


_points: Callable[[int, int, int], FloatArray] = lru_cache(256)(lambda k, seed, n: sampler_of("sobol", k, seed).ask(n))
"""Cached, because scrambling a sequence takes as long as several runs."""


@dataclass(frozen=True)
class CampaignRuns:
    """The place where the runs of a campaign are computed and stored.

    Attributes:
        folder: folder of the stored rows.
        workers: processes that compute; None: this process.
    """

    folder: Path
    workers: Workers | None = None

    def rows(
        self,
        jobs: Iterable[Job],
        numbers: Sequence[str],
        progress: Progress,
        *,
        strict: bool = False,
        threads: int = 1,
    ) -> pd.DataFrame:
        """Compute the runs of ``jobs`` that are not stored, and return all their rows in order.

        Args:
            jobs: The jobs, with the seeds that are wanted. Those of one scenario should be consecutive.
            numbers: Columns of metrics to return.
            progress: Advanced for each finished job.
            strict: Raise an error of the input or of a plugin instead of storing a failed row.
            threads: Number of threads of the engine in each process.

        Returns:
            Position of the job (``place``), seed, status, reason, run_s and the numbers.

        Raises:
            JerkbenchError: Nothing can be stored, or the cluster cannot continue.
        """
        store, parts, start, rest = Store(self.folder), [], 0, iter(jobs)
        while several := sharing_scenarios(islice(rest, MAX_JOBS)):
            run_missing(
                Plan(joined_jobs(several)), store, self.workers, strict=strict, progress=progress, threads=threads
            )
            progress.advance(count=len(several) - len({job.key for job in several}))  # several settings are one run
            rows = store.rows(several, numbers).astype(dict.fromkeys(numbers, float))
            parts.append(rows.assign(place=rows["place"] + start))
            start += len(several)
        store.compact(MAX_FILES)
        return pd.concat(parts, ignore_index=True)

    def rows_of_settings(
        self, job: Job, settings: Iterable[tuple[Setting, Sequence[int]]], numbers: Sequence[str], progress: Progress
    ) -> pd.DataFrame:
        """Return the rows of one job with several settings, each with its seeds."""
        space = tunable_space(job)
        jobs = (dataclasses.replace(space.applied(job, setting), draws=seeds) for setting, seeds in settings)
        return self.rows(jobs, numbers, progress)
