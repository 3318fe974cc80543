"""A cell: one combination of data set, disturbances, attitude, filter, adaptation and noise, with all its seeds."""

import dataclasses
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cache, lru_cache
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
    Labelled,
    Metric,
)
from jerkbench.errors import PluginError
from jerkbench.evaluation.evaluated_run import LIMIT_M
from jerkbench.notices import notify
from jerkbench.optional import on_request
from jerkbench.plain import plain
from jerkbench.renamed import new_name
from jerkbench.timeline import AS_REPORTED, RScale, scale_of

# Labels of a combination: names of its choices, with the parameters that were set.


class Labels(NamedTuple):
    """The names of the parts of a cell in the tables."""

    dataset: str
    disturbance: str
    attitude: str
    filter: str
    adaptation: str
    noise: str


def default_labels(spec: Mapping[str, Any]) -> Labels:
    """The plugins' own names."""
    names = {kind: spec[kind]["name"] for kind in ("dataset", "attitude", "filter", "adaptation")}
    noise = _with_told("default", spec)
    return Labels(disturbance=joined(d["name"] for d in spec["disturbance"]), noise=noise, **names)


def joined(names: Iterable[str]) -> str:
    """One name for a list of disturbances; `none` only when it is the only one."""
    several = list(names)
    return "+".join(name for name in several if name != "none") or "none"


GROUPS = ("dataset", "attitude", "filter", "adaptation", "engine")
"""Groups of which a configuration holds one plugin; `disturbance` holds several."""


def labels_of(spec: dict[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Labels:
    """Names of the choices, with the parameters that the overrides set in parentheses."""
    changed = _parameters(overrides)
    names = {kind: _named(str(choices[kind]), changed.get(kind, [])) for kind in GROUPS if kind != "engine"}
    disturbance = _disturbance_label(spec, choices, overrides, changed)
    noise = _with_told(_noise_label(spec, choices, changed), spec)
    return Labels(disturbance=disturbance, noise=noise, **names)


def contradiction(labels: Mapping[str, str], spec: Mapping[str, Any]) -> str:
    """Return how the label of a stored cell names another plugin than the one that ran; empty where none does.

    A label that is no plugin's name is a preset's, maybe of another machine: it is believed. A program has the name
    that it gives itself.
    """
    disturbances = spec["disturbance"] or [{"name": "none"}]
    ran = {kind: {new_name(kind, spec[kind]["name"])} for kind in ("dataset", "attitude", "filter", "adaptation")}
    ran["disturbance"] = {new_name("disturbance", disturbance["name"]) for disturbance in disturbances}
    for kind, names in ran.items():
        if labels[kind].endswith("(program)"):
            continue
        heads = re.sub(r"\([^()]*\)", "", labels[kind]).split("+")
        wrong = [head for head in heads if head not in names and head in plugins.names(kind)]
        if wrong:
            return f"{kind}={wrong[0]} is {', '.join(sorted(map(str, names)))}"
    return ""


def _disturbance_label(
    spec: dict[str, Any], choices: Mapping[str, Any], overrides: list[str], changed: dict[str, list[str]]
) -> str:
    """The chosen names, presets too, in their order; parameters stand with the plugin that they belong to."""
    listed = [word.partition("=")[2].strip("[]") for word in overrides if word.startswith("disturbance=")]
    chosen = listed[-1] if listed else str(choices.get("disturbance") or "")
    names = [name.strip() for name in chosen.split(",") if name.strip()] or [d["name"] for d in spec["disturbance"]]
    also = [d["name"] for d in spec["disturbance"] if d["name"] not in names and f"disturbance.{d['name']}" in changed]
    return joined(_named(name, changed.get(f"disturbance.{name}", [])) for name in [*names, *also])


def _noise_label(spec: dict[str, Any], choices: Mapping[str, Any], changed: dict[str, list[str]]) -> str:
    """The preset or the swept values; "default" for a filter that has none of the fields."""
    own = {f.name for f in fields(plugins.get("filter", spec["filter"]["name"]))}
    if not own & {key for key, value in spec["noise"].items() if value is not None}:
        return "default"
    preset = str(choices["noise"])
    parameters = [p for p in changed.get("noise", []) if p.split("=")[0] in own]
    return ", ".join(parameters) if preset == "default" else _named(preset, parameters)


def _with_told(noise: str, spec: Mapping[str, Any]) -> str:
    """The noise with the factors on the reported R that are not 1: both are what the filter is told of noise."""
    told = [f"r_scale.{name}={value:g}" for name, value in scale_of(spec.get("r_scale")).changed.items()]
    return ", ".join([*([noise] if noise != "default" or not told else []), *told])


def _parameters(overrides: list[str]) -> dict[str, list[str]]:
    """Parameters set by overrides, "key=value", for each plugin; places of files are no label."""
    parameters: dict[str, dict[str, str]] = {}
    for override in overrides:
        key, _, value = override.lstrip("+~").partition("=")
        owner, _, name = key.rpartition(".")
        if owner and not key.startswith("hydra") and "/" not in value and name not in ("folder", "file"):
            parameters.setdefault(owner, {})[name] = value.lower() if value in ("True", "False") else value
    return {owner: [f"{name}={value}" for name, value in values.items()] for owner, values in parameters.items()}


def _named(name: str, parameters: list[str]) -> str:
    return f"{name}({', '.join(parameters)})" if parameters else name


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

MOST_SEEDS = 100_000
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
        if self.seeds > MOST_SEEDS:
            raise PluginError(f"seeds is {self.seeds}; a cell has at most {MOST_SEEDS} runs.")
        if self.first_seed + self.seeds > LAST_SEED:
            raise PluginError(f"first_seed is {self.first_seed}; a seed must be less than 2**63.")
        if not (math.isfinite(self.burn_in_s) and self.burn_in_s >= 0):
            raise PluginError(f"burn_in_s is {self.burn_in_s:g}; it must be a number of seconds, 0 or more.")
        if math.isnan(self.divergence_limit_m) or self.divergence_limit_m <= 0:
            raise PluginError(f"divergence_limit_m is {self.divergence_limit_m:g}; it must be more than 0.")


Config = Mapping[str, Any]


@dataclasses.dataclass(frozen=True, eq=False)
class Cell:
    """A cell, ready to run.

    Attributes:
        labels: what tables call its parts.
        spec: its parts as plain data: kind -> {"name": ..., parameters}; `build` makes the same cell from it.
        protocol: how it is run and scored.
        dataset: source of the recordings.
        disturbances: applied in this order.
        attitude: attitude filter.
        filter: kinematic filter, or estimator.
        adaptation: rule that adapts R.
        engine: what runs a kinematic filter.
        metrics: what is computed from each run.
        r_scale: what the filter is told of the reported R.
    """

    labels: Labels
    spec: Config
    protocol: Protocol
    dataset: Dataset
    disturbances: tuple[Disturbance, ...]
    attitude: AttitudeFilter
    filter: Filter | Estimator
    adaptation: Adaptation
    engine: Engine
    metrics: tuple[Metric, ...]
    r_scale: RScale = AS_REPORTED

    @property
    def seeded(self) -> bool:
        """Whether anything in it is random."""
        return self.dataset.seeded or any(d.seeded for d in self.disturbances)

    @property
    def draws(self) -> range:
        """The seeds to run; of a deterministic cell, the phases of its decimation."""
        if self.seeded:
            return range(self.protocol.first_seed, self.protocol.first_seed + self.protocol.seeds)
        return range(max((d.replicates() for d in self.disturbances), default=1))


def build(spec: Config, protocol: Protocol, labels: Labels | None = None) -> Cell:
    """Make a cell from plain data.

    Args:
        spec: dataset, attitude, filter, adaptation, engine: {"name": ..., parameters}; disturbance: a list of such;
            noise (optional): parameters that replace the filter's own; r_scale (optional): factors on the reported R;
            metrics (optional): names, or "all".
        protocol: how it is run and scored.
        labels: what tables call its parts; default: the plugins' names.

    Raises:
        PluginError: something is unknown or does not fit together.
    """
    noise = replaced(plugins.get("filter", spec["filter"]["name"]), spec.get("noise", {}))
    single = {kind: _part(kind, spec[kind]) for kind in ("dataset", "attitude", "adaptation", "engine")}
    single["filter"] = _part("filter", {**spec["filter"], **noise})
    disturbances = [_part("disturbance", part) for part in spec["disturbance"]]
    seeded = any(part.plugin.seeded for part in (single["dataset"], *disturbances))
    metrics, r_scale = metric_names(spec.get("metrics") or (), seeded=seeded), scale_of(spec.get("r_scale"))
    effective: dict[str, Any] = {kind: part.plain for kind, part in single.items()}
    effective["r_scale"] = dataclasses.asdict(r_scale)
    effective["disturbance"] = [part.plain for part in disturbances]
    return Cell(
        labels=_labels(labels or default_labels(effective), single["filter"].plugin),
        spec={**effective, "metrics": list(metrics)},
        protocol=protocol,
        r_scale=r_scale,
        disturbances=tuple(part.plugin for part in disturbances),
        metrics=tuple(_part("metric", {"name": name}).plugin for name in metrics),
        **{kind: part.plugin for kind, part in single.items()},
    )


def _labels(labels: Labels, model: Filter | Estimator) -> Labels:
    """The labels as plain text, with the name that the filter gives itself."""
    own = labels._replace(filter=model.table_label) if isinstance(model, Labelled) else labels
    return Labels(*map(plain, own))


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
    plugin = _whole(kind, plugins.create(kind, config))
    return _Part(plugin, {"name": config["name"], **dataclasses.asdict(plugin)})


def _whole(kind: str, plugin: Any) -> Any:  # noqa: ANN401 - as above
    """Refuse a plugin from elsewhere that lacks a method, which would show late and in nobody's words."""
    if not plugins.is_own(type(plugin)):
        from jerkbench.conformance.requirements import require_methods

        try:
            require_methods(kind, plugin)
        except AssertionError as error:
            raise PluginError(str(error)) from error
    return plugin
