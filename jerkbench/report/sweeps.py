"""Rows over noise, scenarios and the size of a fault: the best noise, a matrix of costs, crossings."""

import re
from collections.abc import Mapping
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.over_seeds import MIN_SEEDS, Samples, costs_of
from jerkbench.report.columns import FACTORS, METHOD, checked, competes, quantity

if TYPE_CHECKING:
    import pandas as pd


ALL_BUT_NOISE = FACTORS[:-1]
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
    kept = [_chosen(group, metric) for _, group in rows.groupby([*ALL_BUT_NOISE], sort=False)]
    return rows.loc[np.concatenate(kept)].assign(noise=BEST)


def _chosen(group: "pd.DataFrame", metric: str) -> IntArray:
    """Return the index of the row of each seed at the noise that the other seeds choose."""
    places = group.assign(row=group.index).pivot_table(index="noise", columns="seed", values="row", sort=False)
    full = places[places.notna().sum(axis=1) == places.notna().sum(axis=1).max()].dropna(axis=1)
    index = full.to_numpy(dtype=np.int64)
    value = group[metric].where(group["status"] == "ok", np.inf).fillna(np.inf)
    picked = chosen_on_other_seeds(value.loc[index.ravel()].to_numpy(dtype=float).reshape(index.shape))
    return np.asarray(index[picked, np.arange(index.shape[1])])


def chosen_on_other_seeds(errors: FloatArray) -> IntArray:
    """Return (n,) the setting that the other seeds choose for each seed, from the errors (k, n) of k settings.

    The best setting has the fewest failed (infinite) runs, and among these the lowest mean log error. A single seed
    chooses for itself.

    Source: Stone, "Cross-validatory choice and assessment of statistical predictions", JRSS B 36 (1974).
    """
    failed = np.isinf(errors)
    logs = np.log(np.where(failed, 1.0, np.maximum(errors, np.finfo(float).tiny)))
    failures, total = failed.sum(axis=1, keepdims=True), logs.sum(axis=1, keepdims=True)
    if errors.shape[1] > 1:
        failures, total = failures - failed, total - logs
    count = max(errors.shape[1] - 1, 1) - failures
    fewest = failures == failures.min(axis=0)
    return np.asarray(np.argmin(np.where(fewest, total / np.maximum(1, count), np.inf), axis=0))


# Rows -> a matrix of scenarios by methods.


class Costs(NamedTuple):
    """The means of a metric by scenario and method, in the order in which both appear.

    Attributes:
        means: (p, s) means over the seeds that all methods of a scenario have; NaN where a method was not run.
        scenarios: names of the p scenarios.
        methods: names of the s methods.
        labels: filter and adaptation of each method.
    """

    means: FloatArray
    scenarios: list[str]
    methods: list[str]
    labels: list[tuple[str, str]]

    @property
    def rivals(self) -> list[bool]:
        """Which methods can be the best; references cannot."""
        return [competes({"filter": f, "adaptation": a}) for f, a in self.labels]


def costs(rows: "pd.DataFrame", metric: str) -> Costs:
    """Return the means of ``metric`` by scenario and method.

    A mean is infinite where a run was lost or has no value. The names say what varies. The means are those of the
    tables: the median of errors, the geometric mean of few seeds and of phases.

    Args:
        rows: one row a cell and seed.
        metric: the column.
    """
    every = _named(checked(rows, metric), metric)
    scenarios, names = (list(dict.fromkeys(every[key].astype(str))) for key in ("scenario", "method"))
    methods = every.groupby(["scenario", "seed"])["method"].transform("nunique")
    named = every[methods == every.groupby("scenario")["method"].transform("nunique")]
    groups = named.groupby(["scenario", "method"])
    means = groups["cost"].mean()
    if quantity(metric).lowest_is_best and not (named["cost"] < 0).any():
        samples = Samples.of([values.to_numpy(dtype=float) for _, values in groups["cost"]])
        means[:] = costs_of(samples, least=np.where(groups["replicate"].first() == "phase", np.inf, MIN_SEEDS))
    table = means.unstack()  # noqa: PD010 - a series has no pivot_table
    of_method = every.drop_duplicates("method")
    labels = [(str(f), str(a)) for f, a in zip(of_method["filter"], of_method["adaptation"], strict=True)]
    return Costs(table.reindex(index=scenarios, columns=names).to_numpy(), scenarios, names, labels)


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


# Errors over the size of a fault: where methods cross, and from which size on a fault is noticed.

PARAMETER = re.compile(r"([A-Za-z_0-9]+)=(-?[0-9.]+(?:[eE][+-]?[0-9]+)?)(?=[,)])")
MIN_SIZES = 3
"""Fewer sizes of a fault are no curve."""

NOTICED = ("rejected_percent", "inflated_percent")
"""Metrics that tell whether an adaptation acted."""

SCENARIO, SIZE, NAME = "severity_of", "severity", "severity_name"


class Crossing(NamedTuple):
    """Where two methods are equally good.

    Attributes:
        size: of the fault.
        cost: of both.
        better_below: the method that is better at smaller faults.
        better_above: the other one.
    """

    size: float
    cost: float
    better_below: str
    better_above: str


def with_severity(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return the rows whose disturbance differs from others in the value of one parameter alone.

    Columns are added: ``severity`` (that value), ``severity_name`` (the parameter), and ``severity_of`` (data set and
    disturbance without the value). A parameter with fewer than three values is none of them.
    """
    import pandas as pd

    rows = rows.assign(disturbance=rows["disturbance"].astype(str))
    found = [
        (label, f"{label[: match.start(2)]}...{label[match.end(2) :]}", match[1], float(match[2]))
        for label in rows["disturbance"].unique()
        for match in PARAMETER.finditer(label)
    ]
    places = pd.DataFrame(found, columns=["disturbance", SCENARIO, NAME, SIZE])
    places["values"] = places.groupby([SCENARIO, NAME])[SIZE].transform("nunique")
    most = places.loc[places.groupby("disturbance")["values"].idxmax()]  # the parameter of a label that has the most
    swept = rows.merge(most[most["values"] >= MIN_SIZES].drop(columns="values"), on="disturbance")
    swept[SCENARIO] = swept["dataset"].astype(str) + ": " + swept[SCENARIO]
    return swept


def crossings(sizes: FloatArray, costs: Mapping[str, FloatArray]) -> list[Crossing]:
    """Return where each two methods cross, with costs (k,) over sizes (k,), straight lines between.

    Straight as the figure draws them: over the log of the size, where all are positive, and in the log of the cost. A
    cost that is not finite, or not positive, makes no line.
    """
    crossed = []
    logarithmic = bool(sizes.min() > 0)
    places = np.log(sizes) if logarithmic else sizes
    for first, second in combinations(costs, 2):
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.log(costs[first]) - np.log(costs[second])
        for k in np.flatnonzero(np.isfinite(apart[:-1] * apart[1:]) & (apart[:-1] * apart[1:] < 0)):
            share = apart[k] / (apart[k] - apart[k + 1])
            place = float(places[k] + share * (places[k + 1] - places[k]))
            size = float(np.exp(place)) if logarithmic else place
            logs = np.log(costs[first][[k, k + 1]])
            below, above = (first, second) if apart[k] < 0 else (second, first)
            crossed.append(Crossing(size, float(np.exp(logs[0] + share * (logs[1] - logs[0]))), below, above))
    return sorted(crossed)


def smallest_noticed(runs: "pd.DataFrame") -> float:
    """Return the smallest size from which on the adaptation of one method acts on the fault, NaN where it never does.

    It acts where it rejects or inflates more updates, in the median run, than in any run at the smallest size.
    """
    columns = [name for name in NOTICED if name in runs.columns]
    if not columns:
        return float("nan")
    share = runs[columns].fillna(0.0).sum(axis=1)
    sizes = np.sort(runs[SIZE].unique())
    usual = share[runs[SIZE] == sizes[0]].max()
    acts = [bool(share[runs[SIZE] == size].median() > usual) for size in sizes[1:]]
    first = next((k for k in range(len(acts)) if all(acts[k:])), None)
    return float("nan") if first is None else float(sizes[1 + first])
