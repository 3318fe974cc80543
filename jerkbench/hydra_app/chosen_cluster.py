"""The cluster that a configuration chooses."""

from collections.abc import Mapping
from inspect import signature
from pydoc import locate
from typing import cast

from hydra.errors import InstantiationException
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from jerkbench.clusters.cluster import Cluster
from jerkbench.errors import PluginError, unknown
from jerkbench.presets import preset
from jerkbench.removed import refuse_removed


def cluster_of(config: DictConfig) -> Cluster:
    """Make the cluster of a sweep.

    Raises:
        PluginError: the group has no class of a cluster, or the class does not have the options.
    """
    chosen = config.cluster
    if not (isinstance(chosen, Mapping) and chosen.get("_target_")):
        raise PluginError("No cluster is chosen; give cluster=NAME, for example cluster=local.")
    if cls := locate(str(chosen["_target_"])):
        options = [f"cluster.{name}" for name in signature(cast("type", cls)).parameters]
        for key in chosen:
            if not key.startswith("_") and f"cluster.{key}" not in options:
                raise PluginError(unknown("option", f"cluster.{key}", options))
    try:
        cluster = instantiate(chosen, _convert_="all")
    except InstantiationException as error:
        reason = " ".join(str(error).splitlines()[0].split()).rstrip(".")
        raise PluginError(f"The cluster {chosen['_target_']} cannot be made: {reason}.") from error
    if not callable(getattr(cluster, "run", None)):
        raise PluginError(f"{chosen['_target_']} is no cluster: it has no run(order, workers).")
    return cast("Cluster", cluster)


def cluster_named(name: str) -> Cluster:
    """Make the cluster of the preset conf/cluster/``name``.yaml.

    Raises:
        PluginError: there is none, or it cannot be made.
    """
    refuse_removed([f"cluster={name}"])
    return cluster_of(OmegaConf.create({"cluster": preset("cluster", name)}))
