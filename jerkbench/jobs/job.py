"""A job: one combination of a scenario, a method and a way to score it, with the seeds to run of it."""

import dataclasses
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from typing import Any, NamedTuple

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
    on_request,
)
from jerkbench.errors import PluginError
from jerkbench.evaluation.evaluated_run import LIMIT_M
from jerkbench.jobs.key import data_fingerprint, key_of
from jerkbench.notices import notify
from jerkbench.notices import plain as plain_text
from jerkbench.plugins import missing_member
from jerkbench.r_scale import RScale, scale_of
from jerkbench.report.labels import GROUPS, Labels, default_labels

# The names of the metrics of a cell: those that are asked for, or those by default.

WITHOUT_SEEDS = ("one_recording",)
"""Metrics that are computed by default where a cell has no seeds, which would say how far to trust its numbers."""


def metric_names(wanted: Sequence[str], *, seeded: bool = True) -> tuple[str, ...]:
    """Return the names that are asked for; of none or "default" our own usual ones, of "all" every one.

    One from elsewhere is never among the usual ones, or its installation would change the key of every cell.

    Args:
        wanted: names.
        seeded: whether the cell has seeds; without them it has `WITHOUT_SEEDS` by default.

    Raises:
        PluginError: it is no list of names.
    """
    known = plugins.names("metric")
    if not isinstance(wanted, (list, tuple)) or not all(isinstance(name, str) for name in wanted):
        raise PluginError(f"metrics is {wanted}; give a list of names: metrics=[position_rmse,velocity_rmse] or [all].")
    for sentence in plugins.left_out("metric").values() if "all" in wanted else ():
        notify(sentence)
    alone = () if seeded else WITHOUT_SEEDS
    usual = [name for name in known if name in alone or _by_default(plugins.get("metric", name))]
    several = {"all": known, "default": usual}
    return tuple(dict.fromkeys(name for asked in wanted or ["default"] for name in several.get(asked, [asked])))


@cache
def _by_default(metric: type) -> bool:
    return plugins.is_own(metric) and not on_request(metric)


# The group ``noise``: process noise that replaces the filter's own.


@dataclasses.dataclass
class Noise:
    """Process noise parameters; one that is set replaces the filter's own field of that name.

    Attributes:
        accel_mps2: sigma_a, noise of one sample of the acceleration [m/s2].
        jerk_mps3_per_sqrt_s: random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: one sigma of the jerk at the start [m/s3].
        bias_mps2_per_sqrt_s: random walk of the acceleration bias [m/s2/sqrt(s)].
        initial_bias_mps2: one sigma of the acceleration bias at the start [m/s2].
    """

    accel_mps2: float | None = None
    jerk_mps3_per_sqrt_s: float | None = None
    initial_jerk_mps3: float | None = None
    bias_mps2_per_sqrt_s: float | None = None
    initial_bias_mps2: float | None = None


def replaced(cls: type, noise: Mapping[str, Any]) -> dict[str, float]:
    """Return the fields of `Noise` that are set and that the filter class has; nothing else of a filter is noise."""
    own = {f.name for f in dataclasses.fields(cls)} & {f.name for f in dataclasses.fields(Noise)}
    return {name: value for name, value in noise.items() if value is not None and name in own}


# The protocol of a cell: its seeds, the burn-in, the limit of divergence.

MAX_RUNS = 100_000
"""Runs of one cell: their rows stay in memory until it is stored."""
LAST_SEED = 2**63
"""Before this one: rows hold seeds as signed integers of 64 bits."""


@dataclasses.dataclass(frozen=True)
class Protocol:
    """The protocol of a cell: how it is run and scored.

    Attributes:
        seeds: number of runs of a cell that has anything random.
        first_seed: the first of them.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a divergence [m]; infinite: none is. The rule and the
            limit where nothing is said: `jerkbench.evaluation.evaluated_run`.
    """

    seeds: int = 5
    first_seed: int = 0
    burn_in_s: float = 5.0
    divergence_limit_m: float = LIMIT_M

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.seeds < 1:
            raise PluginError(f"seeds is {self.seeds}; at least one run is needed.")
        if self.first_seed < 0:
            raise PluginError(f"first_seed is {self.first_seed}; it must not be negative.")
        if self.seeds > MAX_RUNS:
            raise PluginError(f"seeds is {self.seeds}; a cell has at most {MAX_RUNS} runs.")
        if self.first_seed + self.seeds > LAST_SEED:
            raise PluginError(f"first_seed is {self.first_seed}; a seed must be less than 2**63.")
        if not (math.isfinite(self.burn_in_s) and self.burn_in_s >= 0):
            raise PluginError(f"burn_in_s is {self.burn_in_s:g}; it must be a number of seconds, 0 or more.")
        if math.isnan(self.divergence_limit_m) or self.divergence_limit_m <= 0:
            raise PluginError(f"divergence_limit_m is {self.divergence_limit_m:g}; it must be more than 0.")


Config = Mapping[str, Any]


@dataclasses.dataclass(frozen=True, eq=False)
class Scenario:
    """What is driven, and what goes wrong.

    Attributes:
        dataset: source of the recordings.
        disturbances: applied in this order.
        attitude: attitude filter.
        plain: the same as plain data: kind -> {"name": ..., parameters}, of the disturbances a list.
    """

    dataset: Dataset
    disturbances: tuple[Disturbance, ...]
    attitude: AttitudeFilter
    plain: Config

    @cached_property
    def data(self) -> str:
        """The identity of its data, when it was first asked for."""
        return data_fingerprint(self.dataset, self.disturbances)

    @property
    def seeded(self) -> bool:
        """Whether anything in it is random."""
        return self.dataset.seeded or any(d.seeded for d in self.disturbances)

    def draws(self, protocol: Protocol) -> range:
        """Return the seeds to run; where nothing is random, the phases of its decimation."""
        if self.seeded:
            return range(protocol.first_seed, protocol.first_seed + protocol.seeds)
        return range(max((d.replicates() for d in self.disturbances), default=1))


@dataclasses.dataclass(frozen=True, eq=False)
class Method:
    """What navigates.

    Attributes:
        filter: kinematic filter, or estimator.
        adaptation: rule that adapts R.
        engine: what runs a kinematic filter.
        r_scale: what the filter is told of the reported R.
        plain: the same as plain data, by the names of these.
    """

    filter: Filter | Estimator
    adaptation: Adaptation
    engine: Engine
    r_scale: RScale
    plain: Config


@dataclasses.dataclass(frozen=True, eq=False)
class Evaluation:
    """The metrics that are asked of each run, and from when its errors count.

    Attributes:
        metrics: what is computed from each run.
        names: of the metrics.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a divergence [m].
    """

    metrics: tuple[Metric, ...]
    names: tuple[str, ...]
    burn_in_s: float
    divergence_limit_m: float

    @property
    def limits(self) -> dict[str, float]:
        """The numbers, by their names."""
        return {"burn_in_s": self.burn_in_s, "divergence_limit_m": self.divergence_limit_m}


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """A combination, ready to run.

    Attributes:
        labels: what tables call its parts.
        scenario: what is driven.
        method: what navigates.
        evaluation: how runs are judged.
        draws: its seeds, or phases, in order.
    """

    labels: Labels
    scenario: Scenario
    method: Method
    evaluation: Evaluation
    draws: Sequence[int]

    @property
    def spec(self) -> dict[str, Any]:
        """Its parts as plain data; `build` makes the same job from it."""
        return {**self.scenario.plain, **self.method.plain, "metrics": list(self.evaluation.names)}

    @cached_property
    def key(self) -> str:
        """A hash of all that its rows depend on but their seeds."""
        model = self.method.filter
        data = [self.scenario.data, model.fingerprint() if has_methods(model, ReadingFile) else ""]
        what = {"labels": self.labels, "spec": self.spec, "protocol": self.evaluation.limits, "data": data}
        return key_of(what, (type(plugin) for _, _, plugin in self.parts()))

    def part(self, kind: str) -> Any:  # noqa: ANN401 - the kind decides the contract
        """Return the only plugin of a kind."""
        return getattr(self.scenario if kind in self.scenario.plain else self.method, kind)

    def at(self, values: Mapping[str, Config]) -> "Job":
        """Return the job with other values of some parameters: filter, adaptation, r_scale, attitude -> values.

        Raises:
            PluginError: the plugin does not take values that are each in their range.
        """
        owners: dict[str, Any] = {"scenario": self.scenario, "method": self.method}
        for kind, own in values.items():
            name = "scenario" if kind in self.scenario.plain else "method"
            owner = owners[name]
            plain = {**owner.plain, kind: {**owner.plain[kind], **own}}
            plugin = dataclasses.replace(getattr(owner, kind), **own)
            owners[name] = dataclasses.replace(owner, plain=plain, **{kind: plugin}) if own else owner
        return dataclasses.replace(self, **owners)

    def parts(self) -> Iterator[tuple[str, str, Any]]:
        """Yield kind and name of each plugin, and itself."""
        spec = self.spec
        for kind in GROUPS:
            yield kind, spec[kind]["name"], self.part(kind)
        for own, disturbance in zip(spec["disturbance"], self.scenario.disturbances, strict=True):
            yield "disturbance", own["name"], disturbance
        for name, metric in zip(self.evaluation.names, self.evaluation.metrics, strict=True):
            yield "metric", name, metric


def build(spec: Config, protocol: Protocol, labels: Labels | None = None) -> Job:
    """Make a job from plain data.

    Args:
        spec: dataset, attitude, filter, adaptation, engine: {"name": ..., parameters}; disturbance: a list of such;
            noise (optional): parameters that replace the filter's own; r_scale (optional): factors on the reported R;
            metrics (optional): names, or "all".
        protocol: its seeds, and how runs are judged.
        labels: what tables call its parts; default: the plugins' names.

    Raises:
        PluginError: something is unknown or does not fit together.
    """
    noise = replaced(plugins.get("filter", spec["filter"]["name"]), spec.get("noise", {}))
    plugin, plain = {}, {}
    for kind in GROUPS:
        plugin[kind], plain[kind] = _part(kind, {**spec[kind], **(noise if kind == "filter" else {})})
    several, r_scale = [_part("disturbance", part) for part in spec["disturbance"]], scale_of(spec.get("r_scale"))
    driven = {"dataset": plain["dataset"], "disturbance": [d.plain for d in several], "attitude": plain["attitude"]}
    scenario = Scenario(plugin["dataset"], tuple(d.plugin for d in several), plugin["attitude"], driven)
    own = ("filter", "adaptation", "engine")
    navigates = {**{kind: plain[kind] for kind in own}, "r_scale": dataclasses.asdict(r_scale)}
    method = Method(plugin["filter"], plugin["adaptation"], plugin["engine"], r_scale, navigates)
    names = metric_names(spec.get("metrics") or (), seeded=scenario.seeded)
    metrics = tuple(_part("metric", {"name": name}).plugin for name in names)
    evaluation = Evaluation(metrics, names, protocol.burn_in_s, protocol.divergence_limit_m)
    labels = labels or default_labels({**driven, **navigates})
    if label := getattr(method.filter, "table_label", ""):
        labels = labels._replace(filter=label)
    return Job(Labels(*map(plain_text, labels)), scenario, method, evaluation, scenario.draws(protocol))


class _Part(NamedTuple):
    """A plugin, and the same as plain data: its name with all its parameters."""

    plugin: Any
    plain: dict[str, Any]


def _part(kind: str, config: Mapping[str, Any]) -> _Part:
    """Make a plugin, or take the one that was made of the same values: a sweep asks for the same ones again and again.

    They never change, so cells may share them.
    """
    cls = plugins.get(kind, str(config.get("name")))
    try:
        text = json.dumps(config)
    except TypeError:  # from Python a parameter may be anything
        return _new_part(kind, config)
    return _made(kind, cls, text)


@lru_cache(maxsize=4096)
def _made(kind: str, cls: type, config: str) -> _Part:
    del cls  # the name may stand for another one by now
    return _new_part(kind, json.loads(config))


def _new_part(kind: str, config: Mapping[str, Any]) -> _Part:
    """Make a plugin; one from elsewhere that lacks a method is refused: it would show late and in nobody's words."""
    plugin = plugins.create(kind, config)
    if not plugins.is_own(type(plugin)) and (message := missing_member(kind, plugin)):
        raise PluginError(message)
    return _Part(plugin, {"name": config["name"], **dataclasses.asdict(plugin)})
