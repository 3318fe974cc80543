"""The packages of an extra, imported only where its cluster is chosen."""

import importlib
from types import ModuleType

from jerkbench.clusters.cluster import ClusterError


def required(module: str, extra: str) -> ModuleType:
    """Return a module of an extra.

    Raises:
        ClusterError: it is not installed; says how it would be.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ClusterError(
            f"cluster={extra} needs the package {error.name}, which is not installed: "
            f"pip install 'jerkbench[{extra_of(extra)}]'."
        ) from error


def extra_of(cluster: str) -> str:
    """Return the extra that a cluster's packages are in."""
    return "dask" if cluster in ("dask", "slurm", "pbs", "lsf") else cluster
