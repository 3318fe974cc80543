"""Methods and their search spaces, scenarios, and the computation of the runs of tunings, suites and audits.

The search space consists of the tunable parameters of a method. Samplers select values of these parameters (settings).
"""

import dataclasses
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, require_known
from jerkbench.jobs.executors import Workers
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.names import job_of_parts, refusal
from jerkbench.jobs.plan import Plan, joined_jobs, sharing_scenarios
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.parameters import Range, RScale, ranges_of, type_of

R_RANGE = Range(0.05, 20.0, log=True, source="ours: from a fifth to four times the reported sigma")
"""The range of each factor on the reported R."""
EDGE = 0.02
"""Distance from an end of the range of a parameter, as a fraction of the range, within which a value is at the edge."""
R_STREAMS = tuple(field.name for field in dataclasses.fields(RScale))
"""Streams whose R has a factor: position and velocity."""

Setting = tuple[float, ...]
"""A value for each tunable parameter, in the order of the parameters."""


@dataclass(frozen=True)
class TunableParameter:
    """A parameter that a search may change.

    Attributes:
        part: The part of the method that has the parameter: "filter", "adaptation", "r_scale" or "attitude".
        field: Name of the parameter in this part of the method.
        bounds: Range of the values that a search may evaluate.
        start: Value of the parameter before the search.
        kind: Type of the values. A parameter of the type bool is a switch with the values 1 and 0.
    """

    part: str
    field: str
    bounds: Range
    start: float
    kind: type = float

    @property
    def name(self) -> str:
        """The key of the parameter on the command line, for example "filter.accel_mps2"."""
        return f"{self.part}.{self.field}"

    def value(self, fraction: float) -> float:
        """Return the value of the parameter at a fraction (0 to 1) of its range."""
        value = self.bounds.value(fraction)
        return float(round(value)) if self.kind in (bool, int) else value

    def fraction(self, value: float) -> float:
        """Return the position of a value in the range as a fraction (0 to 1)."""
        return self.bounds.share(min(max(value, self.bounds.low), self.bounds.high))

    def typed(self, value: float) -> float:
        """Return a value converted to the type of the field: bool, int or float."""
        return self.kind(round(value)) if self.kind in (bool, int) else value


@dataclass(frozen=True)
class Space:
    """The tunable parameters of a method.

    Attributes:
        parameters: Parameters of the filter, the adaptation and the scale of R, or parameters of the attitude filter.
    """

    parameters: tuple[TunableParameter, ...]

    @property
    def start(self) -> Setting:
        """The values of all parameters before the search."""
        return tuple(parameter.start for parameter in self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the tunable parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def setting(self, fractions: FloatArray) -> Setting:
        """Return the setting at the given fractions of the ranges, shape (d,)."""
        return tuple(p.value(float(fraction)) for p, fraction in zip(self.parameters, fractions, strict=True))

    def fractions(self, settings: Sequence[Setting]) -> FloatArray:
        """Return the positions of parameter values in their ranges as fractions, shape (number of settings, d)."""
        return np.array(
            [[p.fraction(v) for p, v in zip(self.parameters, setting, strict=True)] for setting in settings]
        )

    def of_part(self, part: str, setting: Setting) -> dict[str, Any]:
        """Return the values of a setting for one part of the method, as a mapping from parameter name to value."""
        pairs = zip(self.parameters, setting, strict=True)
        return {parameter.field: parameter.typed(value) for parameter, value in pairs if parameter.part == part}

    def applied(self, job: Job, setting: Setting) -> Job:
        """Return a copy of the job with the values of ``setting``.

        Raises:
            PluginError: The plugin rejects this combination of values, although each value is in its range.
        """
        return job.at({part: self.of_part(part, setting) for part in ("filter", "adaptation", "r_scale", "attitude")})

    def at_edge(self, setting: Setting) -> list[str]:
        """Return a message for each parameter whose value is at an end of its range. Switches are skipped."""
        messages = []
        for parameter, value in zip(self.parameters, setting, strict=True):
            fraction = 0.5 if parameter.kind is bool else parameter.fraction(value)
            if min(fraction, 1.0 - fraction) <= EDGE:
                end = "low" if fraction <= EDGE else "high"
                where = f"{parameter.name} = {value:g} lies at the {end} end of its range ({parameter.bounds})"
                messages.append(f"{where}; the best may lie beyond.")
        return messages


def space_of(job: Job, selected: Collection[str] = (), measured: Collection[str] = R_STREAMS) -> Space:
    """Return the search space of the method of a job: the parameters with a range, and the factors on R.

    For `attitude_only`, the space consists of the parameters of the attitude filter.

    Args:
        job: The job with the values before the search.
        selected: Names of the parameters to tune. If ``selected`` is empty, all parameters are tuned.
        measured: Streams (position, velocity) that the recordings contain. Factors on R of other streams are not tuned.

    Raises:
        PluginError: The method has no tunable parameter, or a selected name is unknown.
    """
    parts = ("attitude",) if is_attitude_only(job.method.filter) else ("filter", "adaptation")
    parameters = [parameter for part in parts for parameter in _parameters(part, job.part(part))]
    if not parameters:
        names = " and ".join(f"the {part} {job.spec[part]['name']}" for part in parts)
        raise PluginError(f"There is nothing to tune: no parameter of {names} has a range (see `jerkbench show`).")
    if parts != ("attitude",):
        scale, streams = job.method.r_scale, [name for name in R_STREAMS if name in measured]
        parameters += [TunableParameter("r_scale", n, R_RANGE, getattr(scale, n)) for n in streams]
    for name in selected:
        require_known("parameter", name, [parameter.name for parameter in parameters])
    return Space(tuple(parameter for parameter in parameters if not selected or parameter.name in selected))


def _parameters(part: str, plugin: object) -> Sequence[TunableParameter]:
    return [
        TunableParameter(part, name, bounds, float(getattr(plugin, name)), type_of(type(plugin), name))
        for name, bounds in ranges_of(type(plugin)).items()
    ]


class Sobol:
    """A sampler of a scrambled Sobol sequence, which covers the search space evenly and does not depend on the losses.

    The coverage is the same for all methods, so this sampler is suitable for comparisons.

    Source: A. B. Owen, "Scrambling Sobol' and Niederreiter-Xing points", Journal of Complexity 14, 1998,
    doi:10.1006/jcom.1998.0487; `scipy.stats.qmc.Sobol`.
    """

    def __init__(self, dimensions: int, seed: int) -> None:
        from scipy.stats import qmc

        self._sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed), bits=30)

    def suggest(self, count: int) -> FloatArray:
        """Return the next ``count`` points of the Sobol sequence as fractions of the ranges, shape (count, d)."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # SciPy warns if the number of points is not a power of two
            return np.asarray(self._sequence.random(count), dtype=np.float64)

    def observe(self, losses: Sequence[float]) -> None:
        """Ignore the losses, because a Sobol sequence does not depend on losses."""


class Optuna:
    """A sampler of the library Optuna (extra ``tune``), which uses the losses of all earlier settings."""

    def __init__(self, dimensions: int, seed: int, sampler: str, **options: Any) -> None:  # noqa: ANN401 - Optuna's
        try:
            import cmaes  # noqa: F401 - imported late by Optuna's CMA-ES
            import optuna
        except ImportError as error:
            needed = f"{error.name}: `pip install 'jerkbench[tune]'`, or use sampler=sobol"
            raise PluginError(f"The samplers tpe and cma_es need {needed}.") from error
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._study = optuna.create_study(sampler=getattr(optuna.samplers, sampler)(seed=seed, **options))
        unit = optuna.distributions.FloatDistribution(0.0, 1.0)
        self._shares: dict[str, Any] = {f"{k}": unit for k in range(dimensions)}
        self._trials: list[Any] = []

    def suggest(self, count: int) -> FloatArray:
        """Return the next ``count`` settings that Optuna suggests as fractions of the ranges, shape (count, d)."""
        self._trials = [self._study.ask(self._shares) for _ in range(count)]
        return np.array([[trial.params[name] for name in self._shares] for trial in self._trials])

    def observe(self, losses: Sequence[float]) -> None:
        """Report the losses of the last suggested settings to Optuna."""
        for trial, loss in zip(self._trials, losses, strict=True):
            self._study.tell(trial, loss)


Sampler = Sobol | Optuna
"""An algorithm that selects settings. Samplers are deterministic: the same calls return the same settings."""

SAMPLERS: dict[str, Callable[[int, int], Sampler]] = {
    "sobol": Sobol,
    "tpe": partial(Optuna, sampler="TPESampler"),
    "cma_es": partial(Optuna, sampler="CmaEsSampler", warn_independent_sampling=False),
}


def sampler_of(name: str, dimensions: int, seed: int) -> Sampler:
    """Create the sampler with the name ``name``.

    Raises:
        PluginError: The name is unknown, or the library of the sampler is not installed.
    """
    require_known("sampler", name, SAMPLERS)
    return SAMPLERS[name](dimensions, seed)


# The methods and scenarios of suites and audits, and the computation of their runs.

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
