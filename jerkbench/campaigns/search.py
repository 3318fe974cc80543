"""From the runs of settings to the best of them: losses against the plain filter, means over scenarios, the lowest."""

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from jerkbench.campaigns.protocol import BOTH, FaultScenario, domain_of
from jerkbench.errors import JerkbenchError
from jerkbench.tuning.objectives import LOST

ERROR_COLUMN = "position_rmse_m"
"""What a navigation filter is tuned for."""


def losses(rows: pd.DataFrame, levels: Mapping[int, float], error: str = ERROR_COLUMN) -> pd.Series:
    """Return the loss of each run: log(RMSE / level of its scenario), at most log 100, which a lost run counts.

    Args:
        rows: scenario, status, and the column ``error``.
        levels: of each scenario, in the unit of the error.
        error: the column that counts.
    """
    level = rows["scenario"].map(dict(levels)).to_numpy()
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(rows[error].to_numpy() / level)
    lost = (rows["status"] != "ok").to_numpy() | ~np.isfinite(log)
    return pd.Series(np.minimum(np.where(lost, LOST, log), LOST), index=rows.index)


def levels_of(rows: pd.DataFrame, plain: str, error: str = ERROR_COLUMN) -> dict[int, float]:
    """Return what the best plain filter has at its defaults (trial 0) in each scenario: geometric mean of its runs.

    Estimators that stand apart, and GNSS alone, are plain filters too: a lost run counts a hundredfold of the best.

    Raises:
        JerkbenchError: every plain filter was lost in some scenario, so that it has no level.
    """
    own = rows[(rows["adaptation"] == plain) & (rows["trial"] == 0) & (rows["status"] == "ok")]
    means = np.log(own[error]).groupby([own["scenario"], own["filter"]]).mean()
    lowest = np.exp(means.groupby("scenario").min())
    if missing := sorted(set(rows["scenario"]) - set(lowest.index)):
        raise JerkbenchError(
            f"In scenario {missing[0]} every run of every plain filter was lost; make its fault milder."
        )
    return {int(scenario): float(level) for scenario, level in lowest.items()}


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
