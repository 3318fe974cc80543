"""Rows -> a matrix of scenarios by methods."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.references import competes
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd

METHOD = ("filter", "adaptation", "noise")
"""Factors that make a method; the others make a scenario."""


def costs(rows: "pd.DataFrame", metric: str) -> tuple[FloatArray, list[str], list[str]]:
    """Return (p, s) means of ``metric``, the names of the p scenarios and of the s methods, as they appear.

    Infinite where a run was lost or has no value, NaN where the combination was not run. Names say what varies. Means
    are over the seeds that all methods of a scenario have.
    """
    named = _named(checked(rows, metric), metric)
    methods = named.groupby(["scenario", "seed"])["method"].transform("nunique")
    shared = named[methods == named.groupby("scenario")["method"].transform("nunique")]
    wide = shared.pivot_table(index="scenario", columns="method", values="cost", aggfunc="mean", sort=False)
    scenarios, names = (list(dict.fromkeys(named[key].astype(str))) for key in ("scenario", "method"))
    return wide.reindex(index=scenarios, columns=names).to_numpy(dtype=float), scenarios, names


def competing(rows: "pd.DataFrame", metric: str) -> list[bool]:
    """Return which methods of `costs` can be the best; references cannot."""
    named = _named(checked(rows, metric), metric).drop_duplicates("method")
    return [competes({"filter": f, "adaptation": a}) for f, a in zip(named["filter"], named["adaptation"], strict=True)]


def lost_shares(rows: "pd.DataFrame", metric: str) -> list[list[str]]:
    """Return (p, s) how many runs of each cell of `costs` are lost, or have no value: "1/5"."""
    named = _named(checked(rows, metric), metric)
    scenarios, names = (list(dict.fromkeys(named[key].astype(str))) for key in ("scenario", "method"))
    runs = named.groupby(["scenario", "method"])["cost"]
    shares = {key: f"{int(np.isinf(group).sum())}/{len(group)}" for key, group in runs}
    return [[shares.get((scenario, name), "") for name in names] for scenario in scenarios]


def method_labels(rows: "pd.DataFrame", metric: str) -> list[tuple[str, str]]:
    """Return filter and adaptation of the s methods of `costs`."""
    named = _named(checked(rows, metric), metric).drop_duplicates("method")
    return [(str(f), str(a)) for f, a in zip(named["filter"], named["adaptation"], strict=True)]


def _named(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return the rows with their cost, and the names of their scenario and method."""
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    of_method = [key for key in METHOD if key in varying] or ["filter"]
    of_scenario = [key for key in FACTORS if key in varying and key not in METHOD] or ["dataset"]
    value = rows[metric].where(rows["status"] == "ok", np.inf).fillna(np.inf)
    scenario, method = (rows[keys].agg(sep.join, axis=1) for keys, sep in ((of_scenario, ", "), (of_method, " + ")))
    return rows.assign(cost=value, scenario=scenario, method=method)


def of_all_methods(values: FloatArray) -> tuple[FloatArray, str]:
    """Return the scenarios of (p, s) costs in which every method was run, and, where others are left out, words for it.

    A method that was not run in a scenario has not lost it: no rank can be given there.
    """
    complete = ~np.isnan(values).any(axis=1)
    words = "" if complete.all() else f" in which every method was run (of {len(values)})"
    return values[complete], words
