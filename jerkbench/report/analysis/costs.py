"""Rows -> a matrix of scenarios by methods."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.errors_over_seeds import centres_of
from jerkbench.evaluation.statistics.families import LEAST_SEEDS
from jerkbench.evaluation.statistics.over_seeds import Samples
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.references import competes
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd

METHOD = ("filter", "adaptation", "noise")
"""Factors that make a method; the others make a scenario."""


def costs(rows: "pd.DataFrame", metric: str) -> tuple[FloatArray, list[str], list[str]]:
    """Return (p, s) means of ``metric``, the names of the p scenarios and of the s methods, as they appear.

    Infinite where a run was lost or has no value, NaN where the combination was not run. Names say what varies. Means
    are those of the tables: of errors the median, of few seeds and of phases the geometric mean. Only the seeds count
    that all methods of a scenario have.

    Args:
        rows: one row a cell and seed.
        metric: the column.
    """
    named = _named(checked(rows, metric), metric)
    scenarios, names = (list(dict.fromkeys(named[key].astype(str))) for key in ("scenario", "method"))
    methods = named.groupby(["scenario", "seed"])["method"].transform("nunique")
    named = named[methods == named.groupby("scenario")["method"].transform("nunique")]
    groups = {key: group.to_numpy(dtype=float) for key, group in named.groupby(["scenario", "method"])["cost"]}
    if quantity(metric).lowest_is_best and not (named["cost"] < 0).any():
        phases = named.groupby(["scenario", "method"])["replicate"].first() == "phase"
        means = centres_of(
            Samples.of(list(groups.values())), least=np.where(phases, np.inf, LEAST_SEEDS)
        ).value.tolist()
    else:
        means = [float(values.mean()) for values in groups.values()]
    known = {
        key: np.inf if np.isinf(values).any() else mean
        for (key, values), mean in zip(groups.items(), means, strict=True)
    }
    cells = [[known.get((scenario, name), np.nan) for name in names] for scenario in scenarios]
    return np.array(cells, dtype=float), scenarios, names


def competing(rows: "pd.DataFrame", metric: str) -> list[bool]:
    """Return which methods of `costs` can be the best; references cannot."""
    named = _named(checked(rows, metric), metric).drop_duplicates("method")
    return [competes({"filter": f, "adaptation": a}) for f, a in zip(named["filter"], named["adaptation"], strict=True)]


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
