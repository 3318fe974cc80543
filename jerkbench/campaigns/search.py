"""From the runs of settings to the best of them: losses against the plain filter, means over scenarios, the lowest."""

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from jerkbench.campaigns.protocol import BOTH, FaultScenario, domain_of
from jerkbench.tuning.objectives import LOST

ERROR_COLUMN = "position_rmse_m"
"""What a navigation filter is tuned for."""


def losses(
    rows: pd.DataFrame, levels: Mapping[int, float], error: str = ERROR_COLUMN, by: str = "scenario"
) -> pd.Series:
    """Return the loss of each run: log(RMSE / level of its scenario), at most log 100, which a lost run counts.

    Args:
        rows: scenario, seed, status, and the column ``error``.
        levels: of each scenario, in the unit of the error.
        error: the column that counts.
        by: "scenario", or "seed" where each seed is a drive with a level of its own.
    """
    level = rows[by].map(dict(levels)).to_numpy()
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(rows[error].to_numpy() / level)
    lost = (rows["status"] != "ok").to_numpy() | ~np.isfinite(log)
    return pd.Series(np.minimum(np.where(lost, LOST, log), LOST), index=rows.index)


def seen(tuned_on: str, scenarios: Iterable[FaultScenario]) -> list[int]:
    """Return the numbers of the scenarios that a search of ``tuned_on`` looks at."""
    return [k for k, s in enumerate(scenarios) if s.half in (tuned_on, domain_of(tuned_on) + BOTH)]


def mean_losses(rows: pd.DataFrame, numbers: Iterable[int]) -> pd.Series:
    """Return the mean over scenarios of the mean over seeds of ``loss``, by trial."""
    of_scenarios = rows[rows["scenario"].isin(list(numbers))].groupby(["trial", "scenario"])["loss"].mean()
    return of_scenarios.groupby("trial").mean()


def best_trials(means: pd.Series, count: int) -> list[int]:
    """Return the ``count`` trials with the lowest mean, the best first; of equals the earlier."""
    return [int(trial) for trial in means.sort_values(kind="stable").index[:count]]
