"""Of every method the noise that suits it best: a picture has no room for all that were swept."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd

METHOD = FACTORS[:-1]
"""The factors without the noise, the last of them."""
BEST = "best"
"""Stands for the noise of those rows."""


def at_best_noise(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return the rows of each combination at its best noise: most runs that went well, then the lowest mean.

    The choice is made on the very rows that are shown. Where only one noise is there, the rows are as they were.

    Raises:
        JerkbenchError: no such metric.
    """
    rows = checked(rows, metric)
    if rows["noise"].nunique() < 2:
        return rows
    value = rows[metric].where(rows["status"] == "ok", np.nan)
    grouped = rows.assign(value=value).groupby([*METHOD, "noise"], sort=False)["value"]
    means = grouped.agg(["mean", "count"]).reset_index().sort_values(["count", "mean"], ascending=[False, True])
    chosen = means.drop_duplicates(list(METHOD))[[*METHOD, "noise"]]
    kept = rows.reset_index(drop=True).merge(chosen, on=[*METHOD, "noise"], how="inner")
    return kept.assign(noise=BEST)
