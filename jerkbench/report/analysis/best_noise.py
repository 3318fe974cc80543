"""Of every method the noise that suits it best: a picture has no room for all that were swept."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.evaluation.statistics.seeds import chosen_on_other_seeds
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd

METHOD = FACTORS[:-1]
"""The factors without the noise, the last of them."""
BEST = "best"
"""Stands for the noise of those rows."""


def at_best_noise(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return the rows of each combination at its best noise: fewest lost runs, then the lowest mean of the logarithms.

    Each seed has the noise that the other seeds choose: on the very runs that chose it the best of several flatters
    itself. Where only one noise is there, the rows are as they were; noises with seeds of their own are left out.

    Raises:
        JerkbenchError: no such metric.
    """
    rows = checked(rows, metric)
    if rows["noise"].nunique() < 2:
        return rows
    rows = rows.reset_index(drop=True)
    kept = [_chosen(group, metric) for _, group in rows.groupby([*METHOD], sort=False)]
    return rows.loc[np.concatenate(kept)].assign(noise=BEST)


def _chosen(group: "pd.DataFrame", metric: str) -> IntArray:
    """Return the index of the row of each seed at the noise that the other seeds choose."""
    places = group.assign(row=group.index).pivot_table(index="noise", columns="seed", values="row", sort=False)
    full = places[places.notna().sum(axis=1) == places.notna().sum(axis=1).max()].dropna(axis=1)
    index = full.to_numpy(dtype=np.int64)
    value = group[metric].where(group["status"] == "ok", np.inf).fillna(np.inf)
    picked = chosen_on_other_seeds(value.loc[index.ravel()].to_numpy(dtype=float).reshape(index.shape)).picked
    rows: IntArray = index[picked, np.arange(index.shape[1])]
    return rows
