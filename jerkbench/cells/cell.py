"""A cell: one combination of data set, disturbances, attitude, filter, adaptation and noise, with all its seeds."""

import dataclasses
import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from jerkbench import plugins
from jerkbench.cells.labels import Labels, default_labels
from jerkbench.cells.metric_names import metric_names
from jerkbench.cells.noise import replaced
from jerkbench.cells.protocol import Protocol
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
from jerkbench.plain import plain
from jerkbench.timeline.reported_noise import AS_REPORTED, RScale, scale_of

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
