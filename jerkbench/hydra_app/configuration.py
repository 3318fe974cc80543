"""The way between Hydra and a cell: our parts of Hydra, the schema of the configuration, the cell of a composed one."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, make_dataclass
from functools import cache, cached_property
from inspect import signature
from pathlib import Path
from pydoc import locate
from typing import Any, cast

from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.config_store import ConfigNode, ConfigStore
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult
from omegaconf import MISSING, DictConfig, OmegaConf
from yaml import YAMLError

from jerkbench import plugins
from jerkbench.contracts import preferred_attitude
from jerkbench.errors import PluginError, require_known
from jerkbench.files import require_small
from jerkbench.jobs.executors import Cluster
from jerkbench.jobs.job import Job, Noise, Protocol, build
from jerkbench.presets import config_folder, environment_variable, preset, require_harmless
from jerkbench.r_scale import RScale
from jerkbench.renamed import RENAMED, new_name, refuse_removed
from jerkbench.report import Choice, figures_choice
from jerkbench.report.labels import GROUPS, labels_of

ToldR = make_dataclass("ToldR", [(f.name, float, f.default) for f in fields(RScale)])
"""The fields of `RScale`; OmegaConf makes the configuration of a frozen dataclass read-only."""


@dataclass
class Schema:
    """The fields of a configuration that belong to no group.

    Attributes:
        study: name of the study; its results are in ``results``/``study``.
        results: folder of all results.
        seeds: number of runs of a cell that has anything random.
        max_seeds: seeds are added in blocks up to so many, until every two methods are decided; 0: none are.
        first_seed: the first of them.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a divergence [m].
        metrics: names of the metrics to compute; empty: those that are cheap; [all]: every one.
        workers: number of processes of a sweep; 0: one for each processor.
        cluster: where a sweep runs.
        figures: a single run draws its trajectory and its errors, unless this is none; a sweep with a report those of
            the scenarios and methods that carry a finding (few), of every scenario (all), or none.
        figures_pdf: whether each figure is a PDF, too.
        report: whether a sweep ends with its figures and its report (``jerkbench report`` makes it at any time).
        r_scale: factors on the reported R that the filter is told (``position``, ``velocity``); the data stay.
        notes: sentences to print under the tables (what was tuned, on what, with which budget).
        dry: say what would run, what is left out and about how long it takes; run nothing (``--dry``).
    """

    study: str = "adhoc"
    results: str = "results"
    seeds: int = Protocol.seeds
    max_seeds: int = 0
    first_seed: int = Protocol.first_seed
    burn_in_s: float = Protocol.burn_in_s
    divergence_limit_m: float = Protocol.divergence_limit_m
    metrics: list[str] = field(default_factory=list)
    workers: int = 0
    figures: str = Choice.FEW.value
    figures_pdf: bool = False
    report: bool = False
    notes: list[str] = field(default_factory=list)
    dry: bool = False
    dataset: Any = None
    disturbance: Any = None
    attitude: Any = None
    filter: Any = None
    adaptation: Any = None
    engine: Any = None
    cluster: Any = None
    noise: Noise = field(default_factory=Noise)
    r_scale: Any = field(default_factory=ToldR)


LAUNCHER = "hydra_plugins.jerkbench.JerkbenchLauncher"
SWEEPER = "hydra_plugins.jerkbench.JerkbenchSweeper"


def register_schemas() -> None:
    """Put the schema, every plugin, and our launcher, sweeper and callback into Hydra's ConfigStore."""
    _check_files()
    OmegaConf.register_new_resolver("oc.env", environment_variable, replace=True)
    store = ConfigStore.instance()
    store.store(name="schema", node=Schema)
    store.store(group="noise", name="schema", node=Noise)
    for kind in (*GROUPS, "disturbance"):
        group = store.repo.setdefault(kind, {})
        group.update({f"{name}.yaml": PluginNode(kind, name) for name in plugins.names(kind)})
    for kind, names in RENAMED.items():
        for old, new in names.items():
            store.store(group=kind, name=old, node={"defaults": [new]})
    parts: dict[str, dict[str, Any]] = {
        "launcher": {"_target_": LAUNCHER},
        "sweeper": {"_target_": SWEEPER, "max_batch_size": None, "params": {}},
        "callbacks": {"conclude": {"_target_": "jerkbench.hydra_app.app.Conclude"}},
    }
    for group, node in parts.items():
        store.store(group=f"hydra/{group}", name="jerkbench", node=node)


Options = Mapping[Any, Any]
"""A configuration of Hydra, or the same as plain data."""


def study_folder(options: Options) -> Path:
    """Return the folder of the configuration's study."""
    refuse_removed([f"results={options['results']}"])
    return Path(str(options["results"])) / str(options["study"])


def configured_job(plain: Mapping[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Job:
    """Make the job that a composed configuration describes.

    Args:
        plain: the configuration without its ``hydra`` part, resolved, as plain data.
        choices: Hydra's choice for each group, for the labels.
        overrides: the overrides of the job, for the labels.

    Raises:
        PluginError: a plugin does not take its parameters, or something is not chosen.
    """
    _require_complete(plain, choices)
    spec = {group: plain[group] for group in GROUPS}
    spec["disturbance"] = list(plain["disturbance"].values())
    spec.update({name: plain[name] for name in ("noise", "r_scale", "metrics")})
    protocol = Protocol(**{f.name: plain[f.name] for f in fields(Protocol)})
    today = {group: new_name(group, str(choice)) for group, choice in choices.items()}
    return build(spec, protocol, labels_of(spec, today, overrides))


def _require_complete(plain: Mapping[str, Any], choices: Mapping[str, Any]) -> None:
    """Refuse unknown options (``+KEY=...``), options without a value, and groups without a plugin."""
    for owner, values, schema in (("", plain, Schema), ("noise.", plain.get("noise", {}), Noise)):
        for key in values:
            require_known("option", f"{owner}{key}", [f"{owner}{f.name}" for f in fields(schema)])
    for f in fields(Schema):
        if plain.get(f.name, MISSING) == MISSING:
            raise PluginError(f"{f.name} has no value; give {f.name}=...")
    figures_choice(plain["figures"])
    for kind in GROUPS:
        if kind not in choices or not _is_named(plain[kind]):
            raise PluginError(f"No {kind} is chosen, or several; give {kind}=NAME (`jerkbench list {kind}`).")
    chosen = plain["disturbance"]
    if not (isinstance(chosen, Mapping) and chosen and all(map(_is_named, chosen.values()))):
        raise PluginError(
            "No disturbance is chosen, or one has no name. Give disturbance=none for no disturbance. A preset of"
            " disturbances begins with the line '# @package disturbance' and names them in its defaults."
        )


def _is_named(part: object) -> bool:
    return isinstance(part, Mapping) and bool(part.get("name"))


class PluginNode(ConfigNode):
    """The schema of one plugin, made when Hydra reads it: to make all of them takes a quarter of a second.

    Each disturbance stands under its own name, so that several can be chosen. A data set that prefers an attitude
    filter brings that choice along.
    """

    def __init__(self, kind: str, name: str) -> None:
        """Stand for the plugin ``name`` of ``kind``."""
        self.kind, self.plugin = kind, name
        self.attitude = preferred_attitude(plugins.get(kind, name)) if kind == "dataset" else None
        self.name, self.group, self.provider = f"{name}.yaml", kind, None
        self.package = f"disturbance.{name}" if kind == "disturbance" else "_global_" if self.attitude else None

    @cached_property
    def node(self) -> DictConfig:  # type: ignore[override]  # an attribute, but for when it is made
        """The schema; ConfigStore reads it from a copy of this."""
        return _schema(self.kind, self.plugin, self.attitude)


@cache
def _schema(kind: str, plugin: str, attitude: str | None) -> DictConfig:
    schema = OmegaConf.structured(plugins.schema(kind, plugin))
    if attitude:
        schema = OmegaConf.create({"defaults": ["_self_", {"override /attitude": attitude}], kind: schema})
    return cast("DictConfig", schema)


def _check_files() -> None:
    """Let Hydra read a file only if it is small and harmless; the class of files comes from Hydra's plugins."""
    Plugins.instance()
    source = SourcesRegistry.instance().resolve("file")
    load = source.load_config

    def checked(self: Any, config_path: str) -> ConfigResult:  # noqa: ANN401 - the class that Hydra has loaded
        path = Path(self.path) / self._normalize_file_name(config_path)
        try:
            if path.is_file():
                require_small(path.read_text(encoding="utf-8"), path)
            result: ConfigResult = load(self, config_path)
        except (OSError, UnicodeDecodeError, YAMLError) as error:
            raise PluginError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error
        if not Path(os.path.normpath(path)).is_relative_to(config_folder()):
            require_harmless(path, OmegaConf.to_container(result.config), config_path, result.header["package"])
        return result

    if load.__name__ != checked.__name__:
        setattr(source, "load_config", checked)  # noqa: B010 - mypy lets no method be replaced


def check_options(options: Options) -> None:
    """Check where the results go, the number of processes and the seeds, before anything is written.

    Raises:
        PluginError: the study is not the name of a folder, or a number of workers or seeds is invalid.
        MissingMandatoryValue: one of them has no value.
    """
    study, seeds, max_seeds, workers = (options[name] for name in ("study", "seeds", "max_seeds", "workers"))
    if not re.fullmatch(r"[^/\\\x00-\x1f\x7f]+", str(study)) or str(study) in (".", ".."):
        raise PluginError(
            f"study is '{study}'; it must be the name of one folder, which is made in results={options['results']}."
        )
    if max_seeds and max_seeds < seeds:
        raise PluginError(f"max_seeds is {max_seeds}; give as many as seeds={seeds}, or 0 for no more.")
    if workers < 0:
        raise PluginError(f"workers is {workers}; give 0 (one for each processor) or more.")
    for note in options["notes"]:
        if not isinstance(note, str):
            raise PluginError(f"notes has the entry {note}; each note must be text: notes=['tuned on seeds 0 to 9'].")


CLUSTERS = tuple(f"jerkbench.jobs.executors.{name}" for name in ("Local", "Dask", "JobQueue"))
"""The classes that a preset of the group `cluster` may name."""


def cluster_of(options: Options) -> Cluster:
    """Create the cluster of a sweep.

    Raises:
        PluginError: no cluster is chosen, its class is not one of `CLUSTERS`, or the class does not have the options.
    """
    chosen = options["cluster"]
    if not (isinstance(chosen, Mapping) and chosen.get("_target_")):
        raise PluginError("No cluster is chosen; give cluster=NAME, for example cluster=local.")
    own: Any = OmegaConf.to_container(chosen, resolve=True) if isinstance(chosen, DictConfig) else dict(chosen)
    name = own.pop("_target_")
    require_known("class of the cluster", str(name), CLUSTERS)
    cls = cast("Callable[..., Cluster]", locate(name))
    for key in own:
        require_known("option", f"cluster.{key}", [f"cluster.{name}" for name in signature(cls).parameters])
    try:
        return cls(**own)
    except TypeError as error:
        raise PluginError(f"The cluster {name} cannot be created: {error}.") from error


def cluster_named(name: str) -> Cluster:
    """Create the cluster of the preset conf/cluster/``name``.yaml.

    Raises:
        PluginError: there is none, or it cannot be created.
    """
    refuse_removed([f"cluster={name}"])
    return cluster_of({"cluster": preset("cluster", name)})
