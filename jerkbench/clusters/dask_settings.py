"""The settings under which the CPU of Dask's workers goes to the runs: what watches them all the time is off, or rare.

A run holds the interpreter. Whatever wakes another thread of its process takes that away and gives it back, which costs
far more than what the thread does.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

from jerkbench.clusters.extras import required

SPARING: Mapping[str, bool | str] = MappingProxyType(
    {
        "distributed.worker.profile.enabled": False,  # it looks at what runs every 10 ms
        "distributed.admin.tick.interval": "1s",  # each loop asks itself every 20 ms whether it is late
        "distributed.admin.system-monitor.interval": "10s",  # for the dashboard, which we do not start
    }
)
"""Dask's name of each setting, and its value."""


@contextmanager
def sparing() -> Iterator[None]:
    """Set them for what is started here meanwhile: scheduler, client, and workers, which inherit them."""
    dask = required("dask", "dask")
    with dask.config.set(dict(SPARING)):
        yield


def exports() -> list[str]:
    """Return the lines of a shell script that set them for the workers that it starts."""
    return [f"export {variable(name)}={value}" for name, value in SPARING.items()]


def variable(name: str) -> str:
    """Return the environment variable that Dask reads a setting from."""
    return "DASK_" + name.upper().replace("-", "_").replace(".", "__")
