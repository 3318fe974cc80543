"""One combination from plain names, as rows."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench.errors import PluginError
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import Part, job_of_parts, refusal

if TYPE_CHECKING:
    import pandas as pd


def run(
    *,
    dataset: Part | None = None,
    disturbance: Part | Sequence[Part] = (),
    attitude: Part | None = None,
    filter: Part | None = None,  # noqa: A002 - the group's name
    adaptation: Part | None = None,
    noise: Part | None = None,
    engine: Part | None = None,
    seeds: int = Protocol.seeds,
    first_seed: int = Protocol.first_seed,
    burn_in_s: float = Protocol.burn_in_s,
    metrics: Sequence[str] = (),
    r_scale: Mapping[str, float] | None = None,
) -> "pd.DataFrame":
    """Run one combination; returns one row for each seed: factors, seed, status, reason, metrics.

    The same names with the same parameters give the same rows as on the command line; so do those that are left out
    (conf/config.yaml has them).

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
        metrics: names of those to compute, or ["all"]; empty: those that are cheap.
        r_scale: factors on the reported R that the filter is told: {"position": 2.0, "velocity": 0.5}; None: none.

    Raises:
        JerkbenchError: something is unknown or does not fit; a run that fails is a row.
    """
    import pandas as pd

    from jerkbench.jobs.rows import job_rows

    single = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": engine}
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    job = job_of_parts(single, listed(disturbance), noise, protocol, metrics, r_scale)
    if reason := refusal(job):
        raise PluginError(f"This combination makes no sense: {reason}.")
    rows, _ = job_rows(job)
    return pd.DataFrame(rows)


def listed(parts: Part | Sequence[Part] | None) -> list[Part]:
    """Return one part, or several, as a list."""
    return list(parts) if isinstance(parts, list | tuple) else [parts]
