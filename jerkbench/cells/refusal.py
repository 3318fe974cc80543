"""The refusal of a combination: a filter that does not take the data set, or the adaptation."""

from collections.abc import Callable, Sequence

from jerkbench import plugins
from jerkbench.cells.cell import Cell
from jerkbench.contracts import Estimator, PerSeed
from jerkbench.optional import is_attitude_only, lacks_imu, uses_imu


def refusal(cell: Cell) -> str:
    """Return why the filter does not take the data set or the adaptation, or an empty string."""
    if is_attitude_only(cell.dataset) and not is_attitude_only(cell.filter):
        return _lacking(cell, "position to navigate by", _filters(is_attitude_only))
    if lacks_imu(cell.dataset) and uses_imu(cell.filter):
        return _lacking(cell, "IMU", _filters(lambda cls: not uses_imu(cls)))
    if isinstance(cell.filter, PerSeed) and not cell.filter.for_each_seed and len(cell.draws) > 1:
        return (
            f"the filter {cell.labels.filter} has one file for {len(cell.draws)} runs; write {{seed}} in the place"
            " of the seed in its name, or give seeds=1"
        )
    name = cell.spec["adaptation"]["name"]
    if not isinstance(cell.filter, Estimator) or name in cell.filter.adaptations:
        return ""
    accepted = ", ".join(cell.filter.adaptations)
    return f"the filter {cell.spec['filter']['name']} takes no adaptation '{name}', only: {accepted}"


def _lacking(cell: Cell, stream: str, filters: Sequence[str]) -> str:
    dataset, model = (cell.spec[kind]["name"] for kind in ("dataset", "filter"))
    return (
        f"the data set {dataset} has no {stream}, so the filter {model} cannot run over it, only: {', '.join(filters)}"
    )


def _filters(fits: Callable[[type], bool]) -> list[str]:
    """The filters whose class fits."""
    return [name for name in plugins.names("filter") if fits(plugins.get("filter", name))]
