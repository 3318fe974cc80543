"""The names of the metrics of a cell: those that are asked for, or those by default."""

from collections.abc import Sequence
from functools import cache

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.notices import notify
from jerkbench.optional import on_request

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
