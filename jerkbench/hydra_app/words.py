"""What the words of `jerkbench run` describe where another verb takes them: the cell, the options, the cluster."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from pydoc import locate
from typing import Any, cast

from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench.errors import JerkbenchError, PluginError, require_known
from jerkbench.hydra_app.configuration import check_options, configured_job, register_hydra_parts, register_schemas
from jerkbench.hydra_app.typed_words import arranged_words, hydra_sentence
from jerkbench.jobs.executors import Cluster
from jerkbench.jobs.job import Job
from jerkbench.presets import config_folder, folder_words, preset
from jerkbench.renamed import refuse_removed


@dataclass(frozen=True, eq=False)
class Words:
    """What words of the form KEY=VALUE describe.

    Attributes:
        config: the configuration, composed as `jerkbench run` does.
        choices: the name that was chosen for each group.
        overrides: the words.
    """

    config: DictConfig
    choices: dict[str, Any]
    overrides: list[str]

    def job(self, dataset: Mapping[str, object] | None = None, **filter_parameters: object) -> Job:
        """Return the job.

        Args:
            dataset: parameters of the data set beside the words.
            filter_parameters: what is set beside the words, without Hydra's rules for quotation marks.

        Raises:
            PluginError: something is unknown or does not fit together.
        """
        plain: Any = OmegaConf.to_container(self.config, resolve=True)
        plain["filter"] = {**plain["filter"], **filter_parameters}
        plain["dataset"] = {**plain["dataset"], **(dataset or {})}
        return configured_job(plain, self.choices, self.overrides)


def composed(words: Sequence[str]) -> Words:
    """Compose the configuration that ``words`` ask for.

    Raises:
        JerkbenchError: one of them is unknown or has a wrong type, or an option makes no sense.
    """
    overrides = arranged_words(words)
    register_schemas()
    register_hydra_parts()
    try:
        with initialize_config_dir(str(config_folder()), version_base="1.3"):
            whole = compose("config", [*folder_words(), *overrides], return_hydra_config=True)
        choices: Any = OmegaConf.to_container(whole.hydra.runtime.choices)
        config = OmegaConf.masked_copy(whole, [str(key) for key in whole if key != "hydra"])
        check_options(config)
    except (HydraException, OmegaConfBaseException) as error:
        raise JerkbenchError(hydra_sentence(error, list(words))) from error
    return Words(config, choices, overrides)


CLUSTERS = tuple(f"jerkbench.jobs.executors.{name}" for name in ("Local", "Dask", "JobQueue"))
"""The classes that a preset of the group `cluster` may name."""


def cluster_of(config: DictConfig) -> Cluster:
    """Create the cluster of a sweep.

    Raises:
        PluginError: no cluster is chosen, its class is not one of `CLUSTERS`, or the class does not have the options.
    """
    if not (isinstance(config.cluster, Mapping) and config.cluster.get("_target_")):
        raise PluginError("No cluster is chosen; give cluster=NAME, for example cluster=local.")
    chosen = cast("dict[str, Any]", OmegaConf.to_container(config.cluster, resolve=True))
    name = chosen.pop("_target_")
    require_known("class of the cluster", str(name), CLUSTERS)
    cls = cast("Callable[..., Cluster]", locate(name))
    for key in chosen:
        require_known("option", f"cluster.{key}", [f"cluster.{name}" for name in signature(cls).parameters])
    try:
        return cls(**chosen)
    except TypeError as error:
        raise PluginError(f"The cluster {name} cannot be created: {error}.") from error


def cluster_named(name: str) -> Cluster:
    """Make the cluster of the preset conf/cluster/``name``.yaml.

    Raises:
        PluginError: there is none, or it cannot be made.
    """
    refuse_removed([f"cluster={name}"])
    return cluster_of(OmegaConf.create({"cluster": preset("cluster", name)}))
