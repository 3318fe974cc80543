"""The schema of the configuration, its registration in Hydra, and the conversion of a configuration to a job."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, make_dataclass
from functools import cache, cached_property
from pathlib import Path
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
from jerkbench.jobs.executors import Cluster, Dask, JobQueue, Local
from jerkbench.jobs.job import Job, Noise, Protocol, build
from jerkbench.parameters import RScale
from jerkbench.presets import config_folder, environment_variable, preset, require_harmless
from jerkbench.renamed import RENAMED, new_name
from jerkbench.report import Choice, figures_choice
from jerkbench.report.labels import GROUPS, labels_of

RScaleFields = make_dataclass("RScaleFields", [(f.name, float, f.default) for f in fields(RScale)])
"""A mutable copy of `RScale`. OmegaConf would make the configuration of a frozen dataclass read-only."""


@dataclass
class Schema:
    """The options of a configuration: all fields that are not parameters of a plugin.

    Attributes:
        study: Name of the study. The results of the study are in the folder ``results``/``study``.
        results: Folder of all results.
        seeds: Number of seeds (runs) of each combination with random parts.
        max_seeds: Maximum number of seeds of a combination. While a comparison is undecided, seeds are added in blocks
            up to this number. If ``max_seeds`` is 0, no seeds are added.
        first_seed: The first seed of a combination with random parts.
        burn_in_s: Time after the start before which errors are not counted [s].
        divergence_limit_m: Position error above which a run counts as diverged [m].
        metrics: Names of the metrics to compute. An empty list selects the default metrics. The list [all] selects all
            metrics.
        workers: Number of processes of a sweep. If ``workers`` is 0, one process is used for each processor.
        cluster: The cluster that runs a sweep.
        figures: Selection of the figures: none, few or all. With few or all, a single run draws its trajectory and its
            errors. The report of a sweep draws the scenarios and methods with a finding (few) or every scenario (all).
        figures_pdf: Whether to write each figure also as a PDF.
        report: Whether to write a report at the end of a sweep. ``jerkbench report`` can write the report later.
        r_scale: Factors on the reported R that the filter receives (``position``, ``velocity``). The factors do not
            change the measurements.
        notes: Notes below the tables, for example about the tuning of the methods.
        dry: Whether to print only the planned runs, the combinations that are left out and the estimated time
            (``--dry``).
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
    r_scale: Any = field(default_factory=RScaleFields)


OPTIONS = {owner: [f.name for f in fields(schema)] for owner, schema in (("", Schema), ("noise.", Noise))}
"""The names of the options without a prefix, and of the options with the prefix ``noise.``."""

SWEEPER: dict[str, Any] = {"_target_": "hydra_plugins.jerkbench.JerkbenchSweeper", "max_batch_size": None, "params": {}}


def register_schemas() -> None:
    """Register the schema, every plugin and the sweeper in the ConfigStore of Hydra."""
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
    store.store(group="hydra/sweeper", name="jerkbench", node=SWEEPER)


Options = Mapping[Any, Any]
"""A configuration of Hydra, or an equivalent mapping with plain data."""


def study_folder(options: Options) -> Path:
    """Return the folder of the study that is configured in ``options``."""
    return Path(str(options["results"])) / str(options["study"])


def configured_job(plain: Mapping[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Job:
    """Create the job from a composed configuration.

    Args:
        plain: The resolved configuration without its ``hydra`` part, as plain data.
        choices: The name of the selected plugin or preset by group, from which the labels of the job are created.
        overrides: The overrides of the job, from which the labels of the job are created.

    Raises:
        PluginError: A plugin rejects its parameters, or an option or a choice is missing.
    """
    _require_complete(plain, choices)
    spec = {group: plain[group] for group in GROUPS}
    spec["disturbance"] = list(plain["disturbance"].values())
    spec.update({name: plain[name] for name in ("noise", "r_scale", "metrics")})
    protocol = Protocol(**{f.name: plain[f.name] for f in fields(Protocol)})
    current = {group: new_name(group, str(choice)) for group, choice in choices.items()}
    return build(spec, protocol, labels_of(spec, current, overrides))


def _require_complete(plain: Mapping[str, Any], choices: Mapping[str, Any]) -> None:
    """Raise an exception for unknown options (``+KEY=...``), options without a value, and groups without a plugin."""
    for owner, values in (("", plain), ("noise.", plain.get("noise", {}))):
        for key in sorted(values.keys() - OPTIONS[owner]):
            require_known("option", f"{owner}{key}", [f"{owner}{name}" for name in OPTIONS[owner]])
    for name in OPTIONS[""]:
        if plain.get(name, MISSING) == MISSING:
            raise PluginError(f"{name} has no value; give {name}=...")
    figures_choice(plain["figures"])
    for kind in GROUPS:
        if kind not in choices or not _is_named(plain[kind]):
            raise PluginError(f"Exactly one {kind} must be chosen; give {kind}=NAME (`jerkbench list {kind}`).")
    disturbances = plain["disturbance"]
    if not (isinstance(disturbances, Mapping) and disturbances and all(map(_is_named, disturbances.values()))):
        raise PluginError(
            "No disturbance is chosen, or a disturbance has no name. Give disturbance=none for no disturbance. A preset"
            " with disturbances must begin with the line '# @package disturbance' and list the plugins in its defaults."
        )


def _is_named(part: object) -> bool:
    return isinstance(part, Mapping) and bool(part.get("name"))


class PluginNode(ConfigNode):
    """The schema of a plugin, which is created only when Hydra reads it, because creating all schemas takes 0.25 s.

    The package (position in the configuration) of a disturbance ends with the name of the disturbance, so that several
    disturbances can be selected. The schema of a data set that prefers an attitude filter also selects this filter.
    """

    def __init__(self, kind: str, name: str) -> None:
        self.kind, self.plugin = kind, name
        self.attitude = preferred_attitude(plugins.get(kind, name)) if kind == "dataset" else None
        self.name, self.group, self.provider = f"{name}.yaml", kind, None
        self.package = f"disturbance.{name}" if kind == "disturbance" else "_global_" if self.attitude else None

    @cached_property
    def node(self) -> DictConfig:  # type: ignore[override]  # an attribute of ConfigNode
        """The schema of the plugin. ConfigStore reads this attribute from a copy of the object."""
        return _schema(self.kind, self.plugin, self.attitude)


@cache
def _schema(kind: str, plugin: str, attitude: str | None) -> DictConfig:
    schema = OmegaConf.structured(plugins.schema(kind, plugin))
    if attitude:
        schema = OmegaConf.create({"defaults": ["_self_", {"override /attitude": attitude}], kind: schema})
    return cast("DictConfig", schema)


def _check_files() -> None:
    """Wrap the file reader of Hydra, so that it rejects files that are too large or that set options of Hydra."""
    Plugins.instance()
    source = SourcesRegistry.instance().resolve("file")
    load = source.load_config

    def checked(self: Any, config_path: str) -> ConfigResult:  # noqa: ANN401 - a class that Hydra loads
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
        setattr(source, "load_config", checked)  # noqa: B010 - mypy forbids the assignment to a method


def check_options(options: Options) -> None:
    """Check the study, the number of workers, the seeds and the notes before anything is written.

    Raises:
        PluginError: The study is not the name of a folder, or another option is invalid.
        MissingMandatoryValue: The study, the number of workers, the seeds or the notes have no value.
    """
    study, seeds, max_seeds, workers = (options[name] for name in ("study", "seeds", "max_seeds", "workers"))
    if not re.fullmatch(r"[^/\\\x00-\x1f\x7f]+", str(study)) or str(study) in (".", ".."):
        parent = f"The folder is created in results={options['results']}"
        raise PluginError(f"study is '{study}'; give the name of a single folder. {parent}.")
    if max_seeds and max_seeds < seeds:
        raise PluginError(f"max_seeds is {max_seeds}, but seeds is {seeds}; increase max_seeds, or give max_seeds=0.")
    if workers < 0:
        raise PluginError(f"workers is {workers}; give 0 (one for each processor) or more.")
    for note in options["notes"]:
        if not isinstance(note, str):
            raise PluginError(f"notes contains {note}; give only texts, for example notes=['tuned on seeds 0 to 9'].")


CLUSTERS: Mapping[str, type[Cluster]] = {f"{cls.__module__}.{cls.__name__}": cls for cls in (Local, Dask, JobQueue)}
"""The classes that a preset of the group `cluster` may use, by their full names."""


def cluster_of(options: Options) -> Cluster:
    """Create the cluster of a sweep from its configuration.

    Raises:
        PluginError: No cluster is selected, its class is not in `CLUSTERS`, or an option of the cluster is unknown.
    """
    cluster = options["cluster"]
    if not (isinstance(cluster, Mapping) and cluster.get("_target_")):
        raise PluginError("No cluster is chosen; give cluster=NAME, for example cluster=local.")
    plain: Any = OmegaConf.to_container(cluster, resolve=True) if isinstance(cluster, DictConfig) else cluster
    parameters: Any = dict(plain)
    name = parameters.pop("_target_")
    require_known("class of the cluster", str(name), CLUSTERS)
    for key in parameters:
        require_known("option", f"cluster.{key}", [f"cluster.{f.name}" for f in fields(CLUSTERS[name])])
    try:
        return CLUSTERS[name](**parameters)
    except TypeError as error:
        raise PluginError(f"The cluster {name} cannot be created: {error}.") from error


def cluster_named(name: str) -> Cluster:
    """Create the cluster of the preset conf/cluster/``name``.yaml.

    Raises:
        PluginError: The preset does not exist, or the cluster cannot be created.
    """
    return cluster_of({"cluster": preset("cluster", name)})
