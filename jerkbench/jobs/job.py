"""A job: one combination of a scenario and a method, with the metrics, the parameters of the scoring and the seeds.

The module also checks whether the plugins of a job satisfy their contracts, and converts their exceptions to messages.
"""

import dataclasses
import json
import os
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, cached_property, lru_cache
from typing import Annotated, Any

import numpy as np

from jerkbench import plugins
from jerkbench.contracts import (
    Adaptation,
    AttitudeFilter,
    Dataset,
    Disturbance,
    Engine,
    Estimator,
    Filter,
    Metric,
    ReadingFile,
    has_methods,
)
from jerkbench.errors import DISK_FULL, JerkbenchError, PluginError, notify
from jerkbench.errors import plain as plain_text
from jerkbench.evaluation.evaluated_run import LIMIT_M
from jerkbench.jobs.key import data_fingerprint, key_of
from jerkbench.parameters import NOT_NEGATIVE, Limit, Limited, RScale, scale_of
from jerkbench.plugins import is_builtin, missing_member
from jerkbench.report.labels import GROUPS, Labels, default_labels

WITHOUT_SEEDS = ("one_recording",)
"""Metrics that are default metrics only for jobs without seeds, which have no spread over seeds."""


def metric_names(wanted: Sequence[str], *, seeded: bool = True) -> tuple[str, ...]:
    """Return the names of the metrics to compute.

    A metric of another package is never a default metric, because installing a plugin must not change the keys of jobs.

    Args:
        wanted: Names of metrics. The name "default" selects the default metrics, and "all" selects all metrics. An
            empty list selects the default metrics.
        seeded: Whether the job has random parts and therefore seeds. For a job without seeds, the default metrics
            include the metrics in `WITHOUT_SEEDS`.

    Raises:
        PluginError: ``wanted`` is not a list of names.
    """
    known = plugins.names("metric")
    if not isinstance(wanted, (list, tuple)) or not all(isinstance(name, str) for name in wanted):
        raise PluginError(f"metrics is {wanted}; give a list of names, for example metrics=[position_rmse] or [all].")
    for message in plugins.left_out("metric").values() if "all" in wanted else ():
        notify(message)
    further = () if seeded else WITHOUT_SEEDS
    sets = {"all": known, "default": [name for name in known if name in further or _by_default(name)]}
    return tuple(dict.fromkeys(name for given in wanted or ["default"] for name in sets.get(given, [given])))


@cache
def _by_default(name: str) -> bool:
    return is_builtin(metric := plugins.get("metric", name)) and getattr(metric, "default", True)


# The configuration group ``noise`` sets process noise parameters of the filter.


@dataclasses.dataclass
class Noise:
    """Process noise parameters. Each value that is not None replaces the filter parameter of the same name.

    Attributes:
        accel_mps2: Standard deviation sigma_a of the noise of one acceleration sample [m/s2].
        jerk_mps3_per_sqrt_s: Noise density of the random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: Standard deviation of the jerk at the start [m/s3].
        bias_mps2_per_sqrt_s: Noise density of the random walk of the acceleration bias [m/s2/sqrt(s)].
        initial_bias_mps2: Standard deviation of the acceleration bias at the start [m/s2].
    """

    accel_mps2: float | None = None
    jerk_mps3_per_sqrt_s: float | None = None
    initial_jerk_mps3: float | None = None
    bias_mps2_per_sqrt_s: float | None = None
    initial_bias_mps2: float | None = None


def replaced(cls: type, noise: Mapping[str, Any]) -> dict[str, float]:
    """Return the noise parameters that are not None and that are parameters of the filter class ``cls``."""
    common = {f.name for f in dataclasses.fields(cls)} & {f.name for f in dataclasses.fields(Noise)}
    return {name: value for name, value in noise.items() if value is not None and name in common}


MAX_RUNS = 100_000
"""Maximum number of runs of a job. The rows of a job are in memory until they are stored."""
MAX_FIRST_SEED = 2**62
"""Upper limit of the first seed, not included. Rows store seeds as signed 64-bit integers."""


@dataclasses.dataclass(frozen=True)
class Protocol(Limited):
    """The seeds of a job, and the parameters that define how its runs are scored.

    Attributes:
        seeds: Number of runs of a job with random parts. Each run has a different seed.
        first_seed: The seed of the first run. The seeds of a job are consecutive.
        burn_in_s: Duration at the start of a run whose errors are not counted [s].
        divergence_limit_m: Position error above which a run counts as diverged [m]. With an infinite limit, no run
            counts as diverged. The module `jerkbench.evaluation.evaluated_run` defines the default limit and decides
            which runs diverged.
    """

    seeds: Annotated[int, Limit(lambda count: 1 <= count <= MAX_RUNS, f"give 1 to {MAX_RUNS}.")] = 5
    first_seed: Annotated[int, Limit(lambda seed: 0 <= seed < MAX_FIRST_SEED, "give 0 or more, below 2**62.")] = 0
    burn_in_s: Annotated[float, NOT_NEGATIVE] = 5.0
    divergence_limit_m: Annotated[float, Limit(lambda limit: limit > 0, "it must be more than 0.")] = LIMIT_M

    @property
    def limits(self) -> dict[str, float]:
        """The parameters of the scoring, without the seeds. The key of a job includes these parameters."""
        return {name: value for name, value in vars(self).items() if name not in ("seeds", "first_seed")}


def is_random(model: object) -> bool:
    """Return whether a filter may give different results for different seeds on the same recording (see `PerSeed`)."""
    return bool(getattr(model, "random", False))


Config = Mapping[str, Any]


@dataclasses.dataclass(frozen=True, eq=False)
class Scenario:
    """The inputs of a method: a data set, disturbances and an attitude filter.

    Attributes:
        dataset: The data set, which loads or simulates the recordings.
        disturbances: The disturbances, in the order in which they change the recording.
        attitude: The attitude filter.
        plain: The configuration as {kind: {"name": ..., parameters}}. The value of the kind "disturbance" is a list.
    """

    dataset: Dataset
    disturbances: tuple[Disturbance, ...]
    attitude: AttitudeFilter
    plain: Config

    @cached_property
    def data(self) -> str:
        """The fingerprint of the data set and of the files that disturbances read, computed on first access."""
        return data_fingerprint(self.dataset, self.disturbances)

    @property
    def seeded(self) -> bool:
        """True if the data set or a disturbance is random."""
        return self.dataset.seeded or any(d.seeded for d in self.disturbances)

    def draws(self, protocol: Protocol, *, random: bool = False) -> range:
        """Return the seeds to run. Without random parts, return the phases (starts) of the decimation of the recording.

        Args:
            protocol: The number of seeds and the first seed.
            random: Whether the results of the filter depend on the seed, for example because it reads one file for each
                seed.
        """
        phases = max((d.replicates() for d in self.disturbances), default=1)
        if self.seeded or (random and phases == 1):
            return range(protocol.first_seed, protocol.first_seed + protocol.seeds)
        return range(phases)


@dataclasses.dataclass(frozen=True, eq=False)
class Method:
    """A navigation filter with its adaptation, its engine and the scale of R.

    Attributes:
        filter: Kinematic filter, or an estimator that does not need an engine.
        adaptation: Adaptation, which changes R (or also P, Q or the gain) at each update.
        engine: Engine, which runs kinematic filters.
        r_scale: Factors by which the reported R is multiplied.
        plain: The configuration as {attribute: {"name": ..., parameters}}.
    """

    filter: Filter | Estimator
    adaptation: Adaptation
    engine: Engine
    r_scale: RScale
    plain: Config


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """A combination of a scenario and a method that is ready to run.

    Attributes:
        labels: Names of the data set, the filter and the other parts of the combination in tables.
        scenario: The data set, the disturbances and the attitude filter.
        method: The filter, the adaptation, the engine and the scale of R.
        metrics: The metrics by name.
        protocol: The parameters of the scoring. The job runs the seeds in ``draws`` and ignores the seeds in
            ``protocol``.
        draws: The seeds to run in order, or the phases of the decimation for a job without random parts.
    """

    labels: Labels
    scenario: Scenario
    method: Method
    metrics: Mapping[str, Metric]
    protocol: Protocol
    draws: Sequence[int]

    @property
    def seeded(self) -> bool:
        """True if the scenario or the filter is random."""
        return self.scenario.seeded or is_random(self.method.filter)

    @property
    def spec(self) -> dict[str, Any]:
        """The configuration of the job as plain data, from which `build` creates an equal job."""
        return {**self.scenario.plain, **self.method.plain, "metrics": list(self.metrics)}

    @cached_property
    def key(self) -> str:
        """Hash of the configuration, the code and the data that determine the results of the job, without the seeds."""
        model = self.method.filter
        data = [self.scenario.data, model.fingerprint() if has_methods(model, ReadingFile) else ""]
        identity = {"labels": self.labels, "spec": self.spec, "protocol": self.protocol.limits, "data": data}
        return key_of(identity, (type(plugin) for _, _, plugin in self.parts()))

    def part(self, kind: str) -> Any:  # noqa: ANN401 - the kind decides the contract
        """Return the plugin of a kind of which each job has exactly one, such as the filter."""
        return getattr(self.scenario if kind in self.scenario.plain else self.method, kind)

    def at(self, values: Mapping[str, Config]) -> "Job":
        """Return a copy of the job in which some parameters have other values.

        Args:
            values: The new parameter values as {kind: {parameter: value}}. The kind is filter, adaptation, r_scale or
                attitude.

        Raises:
            PluginError: A plugin rejects a new value.
        """
        owners: dict[str, Any] = {"scenario": self.scenario, "method": self.method}
        for kind, changes in values.items():
            name = "scenario" if kind in self.scenario.plain else "method"
            owner = owners[name]
            plain = {**owner.plain, kind: {**owner.plain[kind], **changes}}
            plugin = dataclasses.replace(getattr(owner, kind), **changes)
            owners[name] = dataclasses.replace(owner, plain=plain, **{kind: plugin}) if changes else owner
        return dataclasses.replace(self, **owners)

    def parts(self) -> Iterator[tuple[str, str, Any]]:
        """Yield the kind, the name and the object of each plugin of the job."""
        spec = self.spec
        for kind in GROUPS:
            yield kind, spec[kind]["name"], self.part(kind)
        for part, disturbance in zip(spec["disturbance"], self.scenario.disturbances, strict=True):
            yield "disturbance", part["name"], disturbance
        yield from (("metric", name, metric) for name, metric in self.metrics.items())


def build(spec: Config, protocol: Protocol, labels: Labels | None = None) -> Job:
    """Create a job from a configuration of plain data (dictionaries, lists, texts and numbers).

    Args:
        spec: The configuration. The keys dataset, attitude, filter, adaptation and engine have the value {"name": ...,
            parameters}. The key disturbance has a list of mappings {"name": ..., parameters}. Optional keys are noise
            (parameters of the filter), r_scale (factors on the reported R) and metrics (names, or "all").
        protocol: The seeds and the parameters of the scoring.
        labels: The labels in tables. By default, the labels are the names of the plugins.

    Raises:
        PluginError: A plugin or parameter is unknown, or the plugins are not compatible.
    """
    noise = replaced(plugins.get("filter", spec["filter"]["name"]), spec.get("noise", {}))
    plugin, plain = {}, {}
    for kind in GROUPS:
        plugin[kind], plain[kind] = _part(kind, {**spec[kind], **(noise if kind == "filter" else {})})
    several, r_scale = [_part("disturbance", part) for part in spec["disturbance"]], scale_of(spec.get("r_scale"))
    driven = {"dataset": plain["dataset"], "disturbance": [d for _, d in several], "attitude": plain["attitude"]}
    scenario = Scenario(plugin["dataset"], tuple(d for d, _ in several), plugin["attitude"], driven)
    navigates = {**{kind: plain[kind] for kind in GROUPS[2:]}, "r_scale": dataclasses.asdict(r_scale)}
    method = Method(plugin["filter"], plugin["adaptation"], plugin["engine"], r_scale, navigates)
    names = metric_names(spec.get("metrics") or (), seeded=scenario.seeded)
    metrics = {name: _part("metric", {"name": name})[0] for name in names}
    labels = labels or default_labels({**driven, **navigates})
    if label := getattr(method.filter, "table_label", ""):
        labels = labels._replace(filter=label)
    draws = scenario.draws(protocol, random=is_random(method.filter))
    return Job(Labels(*map(plain_text, labels)), scenario, method, metrics, protocol, draws)


def _part(kind: str, config: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Return the plugin that a configuration describes, and its name and parameters as plain data.

    The plugin is cached, because plugins are immutable and many jobs use the same plugin.
    """
    cls = plugins.get(kind, str(config.get("name")))
    try:
        text = json.dumps(config)
    except TypeError:  # parameters from Python code cannot always be converted to JSON, the cache key
        return _new_part(kind, config)
    return _made(kind, cls, text)


@lru_cache(maxsize=4096)
def _made(kind: str, cls: type, config: str) -> tuple[Any, dict[str, Any]]:
    del cls  # the class is part of the cache key, because another class can have the same name
    return _new_part(kind, json.loads(config))


def _new_part(kind: str, config: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Create a plugin, and return it with its name and parameters.

    A plugin of another package that lacks a required method is rejected here, before the first run.
    """
    plugin = plugins.create(kind, config)
    if not is_builtin(type(plugin)) and (message := missing_member(kind, plugin)):
        raise PluginError(message)
    return plugin, {"name": config["name"], **dataclasses.asdict(plugin)}


# The error messages about a job.

TRACEBACK = "JERKBENCH_TRACEBACK"
"""Environment variable for authors of plugins. If set, a single run raises the original exception of a plugin."""


def reason_of(error: Exception) -> str:
    """Return the text of an exception, with the name of the function and the number of the line that raised it."""
    if isinstance(error, np.linalg.LinAlgError):
        check = "check the covariances of the measurements (`jerkbench data inspect`) and the parameters of the method"
        return f"a matrix is singular, or not positive definite, to working precision ({error}); {check}"
    at = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({at.name}, line {at.lineno})"


@contextmanager
def plugin_errors(job: Job) -> Iterator[None]:
    """Convert exceptions of a plugin to `PluginError`.

    Errors of jerkbench, and errors because the disk is full, are raised unchanged.

    Raises:
        PluginError: A plugin raised an exception, and the environment variable `TRACEBACK` is not set.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except Exception as error:
        if os.environ.get(TRACEBACK) or (isinstance(error, OSError) and error.errno in DISK_FULL):
            raise
        culprit, why = _culprit(job, error), reason_of(error)
        raise PluginError(f"{culprit} failed: {why}. Set {TRACEBACK}=1 to see the traceback.") from error


def _culprit(job: Job, error: Exception) -> str:
    """Return the kind and name of the plugin whose method raised the exception.

    If the traceback contains no method of a plugin, the result names the filter and the adaptation. The result never
    names the engine, because the engine calls the other plugins.
    """
    named = [(f"{kind} {name}", plugin) for kind, name, plugin in job.parts() if kind != "engine"]
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        instance = frame.f_locals.get("self")
        if names := [name for name, plugin in named if plugin is instance]:
            return f"The {names[0]}"
    return f"The filter {job.spec['filter']['name']} with the adaptation {job.spec['adaptation']['name']}"


def unfit(job: Job) -> str:
    """Return a message about the first plugin of the job that violates its contract, or an empty string."""
    return next((message for _, message in contract_violations(job)), "")


def contract_violations(job: Job) -> Iterator[tuple[str, str]]:
    """Yield a name ("KIND NAME") and a message for each plugin of another package that violates its contract."""
    for kind, name, plugin in job.parts():
        if not is_builtin(type(plugin)):
            from jerkbench.plugins.checks import complaint

            if message := complaint(kind, plugin):
                yield f"{kind} {name}", message
