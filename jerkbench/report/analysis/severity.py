"""Errors over the size of a fault: where methods cross, and from which size on a fault is noticed."""

import re
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd

PARAMETER = re.compile(r"([A-Za-z_0-9]+)=(-?[0-9.]+(?:[eE][+-]?[0-9]+)?)(?=[,)])")
LEAST_SIZES = 3
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
    labels = rows["disturbance"].astype(str)
    places = {label: list(PARAMETER.finditer(label)) for label in labels.unique()}
    sizes: dict[tuple[str, str], set[float]] = {}
    for label, matches in places.items():
        for match in matches:
            sizes.setdefault((_without(label, match), match[1]), set()).add(float(match[2]))
    chosen = {label: _most(label, matches, sizes) for label, matches in places.items()}
    kept = labels.map(lambda label: chosen[label] is not None).to_numpy(dtype=bool)
    swept = rows[kept].copy()
    parameters = [chosen[label] for label in labels[kept]]
    swept[SIZE] = [float(match[2]) for match in parameters if match is not None]
    swept[NAME] = [match[1] for match in parameters if match is not None]
    rests = [_without(label, match) for label, match in zip(labels[kept], parameters, strict=True) if match is not None]
    swept[SCENARIO] = swept["dataset"].astype(str) + ": " + np.array(rests, dtype=object)
    return swept


def _without(label: str, match: re.Match[str]) -> str:
    return f"{label[: match.start(2)]}...{label[match.end(2) :]}"


def _most(
    label: str, matches: Sequence[re.Match[str]], sizes: Mapping[tuple[str, str], set[float]]
) -> re.Match[str] | None:
    """Return the parameter of a label that has the most values; None where none has enough."""
    best = max(matches, key=lambda match: len(sizes[_without(label, match), match[1]]), default=None)
    return best if best is not None and len(sizes[_without(label, best), best[1]]) >= LEAST_SIZES else None


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
