"""Methods ranked over many scenarios: how far ranks would move, which of them differ, and whether metrics agree."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

RESAMPLES = 1999
SEED = 14


@dataclass(frozen=True, eq=False)
class RankRange:
    """Places of k methods, 1 the best.

    Attributes:
        place: (k,) by mean log cost over scenarios.
        low: (k,) best place within the range.
        high: (k,) worst place.
    """

    place: IntArray
    low: IntArray
    high: IntArray


def rank_range(log_costs: FloatArray, confidence: float = 0.95) -> RankRange:
    """Return the places of k methods over (S, n, k) logarithms of errors, with their range by a bootstrap.

    Scenarios are drawn with replacement, and in each resample seeds as well: places that hold for other scenarios of
    this kind, and other seeds. A lost run is infinite: its method is the last.
    """
    s, n, k = log_costs.shape
    rng = np.random.default_rng(SEED)
    places = np.empty((RESAMPLES, k), dtype=np.int64)
    for row in range(RESAMPLES):
        drawn = log_costs[rng.integers(0, s, s)][:, rng.integers(0, n, n)]
        places[row] = _places(drawn.mean(axis=(0, 1)))
    ends = np.quantile(places, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0, method="closest_observation")
    return RankRange(_places(log_costs.mean(axis=(0, 1))), *ends.astype(np.int64))


def _places(costs: FloatArray) -> IntArray:
    """Return the place (k,) of each; equal costs share the better one."""
    return np.asarray(np.sum(costs[None, :] < costs[:, None], axis=1) + 1, dtype=np.int64)


def critical_difference(methods: int, scenarios: int, level: float = 0.05) -> float:
    """Return how far the mean ranks of two of k methods over N scenarios differ, before they differ at ``level``.

    ::

        CD = q sqrt(k (k + 1)/(6 N)),  q the quantile of the studentised range of k, over sqrt(2)

    Source: Nemenyi, "Distribution-free multiple comparisons", Princeton (1963); Demšar, "Statistical comparisons of
    classifiers over multiple data sets", JMLR 7 (2006).
    """
    from scipy.stats import studentized_range

    q = float(studentized_range.ppf(1 - level, methods, np.inf)) / np.sqrt(2)
    return float(q * np.sqrt(methods * (methods + 1) / (6 * scenarios)))


def rank_cliques(mean_ranks: FloatArray, difference: float) -> list[IntArray]:
    """Return the largest groups of methods whose (k,) mean ranks lie within ``difference``, the best first.

    A critical-difference diagram joins them by a line; a method alone is no group.
    """
    order = np.argsort(mean_ranks, kind="stable")
    ranked = mean_ranks[order]
    ends = np.searchsorted(ranked, ranked + difference, side="right")
    return [
        order[first:end] for first, end in enumerate(ends) if end - first > 1 and (first == 0 or end > ends[first - 1])
    ]


def kendall_tau(first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """Return Kendall's tau-b of two metrics' (k,) values of the same methods, and its p; NaN of fewer than three.

    1: both rank the methods alike; -1: the other way round.

    Source: Kendall, "The treatment of ties in ranking problems", Biometrika 33 (1945).
    """
    from scipy.stats import kendalltau

    known = ~(np.isnan(first) | np.isnan(second))
    if known.sum() < 3:
        return np.nan, np.nan
    tau = kendalltau(first[known], second[known])
    return float(tau.statistic), float(tau.pvalue)
