"""The Python API: one combination from plain names, as rows."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

Part = str | Mapping[str, Any]
"""A plugin or a preset by its name, or {"name": ..., parameter: value, ...}."""


def run(
    *,
    dataset: Part = "field",
    disturbance: Part | Sequence[Part] = (),
    attitude: Part | None = None,
    filter: Part = "baseline",  # noqa: A002 - the group's name
    adaptation: Part = "none",
    noise: Part | None = None,
    engine: Part = "compiled",
    seeds: int = 5,
    first_seed: int = 0,
    burn_in_s: float = 5.0,
) -> "pd.DataFrame":
    """Run one combination; returns one row for each seed: factors, seed, status, reason, metrics.

    The same names with the same parameters give the same rows as on the command line.

    Args:
        dataset: where the recordings come from.
        disturbance: one, or several in order.
        attitude: attitude filter; None: what the data set prefers (`rtklib`: the preset `real`), else `field`.
        filter: kinematic filter, or estimator.
        adaptation: rule that adapts R.
        noise: process noise that replaces the filter's own: a preset, or {"accel_mps2": ...}; None: the filter's own.
        engine: what runs a kinematic filter.
        seeds: number of runs, where anything is random.
        first_seed: the first of them.
        burn_in_s: errors count from this time on [s].

    Raises:
        JerkbenchError: something is unknown or does not fit; a run that fails is a row.
    """
    import pandas as pd

    from jerkbench.cells.cell import Protocol, refusal
    from jerkbench.cells.data import data_fingerprint
    from jerkbench.cells.from_names import cell_of_parts
    from jerkbench.errors import PluginError
    from jerkbench.execution.cell_run import CellRun

    single = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": engine}
    several = [disturbance] if isinstance(disturbance, str | Mapping) else list(disturbance)
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    cell = cell_of_parts(single, several, noise, protocol)
    if reason := refusal(cell):
        raise PluginError(f"This combination makes no sense: {reason}.")
    rows, _ = CellRun(cell, data_fingerprint(cell.dataset, cell.disturbances)).rows()
    return pd.DataFrame(rows)
