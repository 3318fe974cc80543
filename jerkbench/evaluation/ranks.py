"""Ranks of methods over many scenarios, their critical difference, and a mixed model of two methods."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

_RESAMPLES = 1999
_SEED = 14


class RankRange(NamedTuple):
    """Ranks of k methods, 1 for the best.

    Attributes:
        place: (k,) rank by the mean log cost over scenarios.
        low: (k,) best rank of the range.
        high: (k,) worst rank of the range.
    """

    place: IntArray
    low: IntArray
    high: IntArray


def rank_range(log_costs: FloatArray, confidence: float = 0.95) -> RankRange:
    """Return the ranks of k methods by the (S, n, k) logarithms of their errors, with a bootstrap range.

    Scenarios and seeds are drawn with replacement, so that the range is valid for other scenarios of this kind and
    other seeds. A failed run is infinite: its method gets the last rank.
    """
    s, n, k = log_costs.shape
    rng = np.random.default_rng(_SEED)
    places = np.empty((_RESAMPLES, k), dtype=np.int64)
    for row in range(_RESAMPLES):
        drawn = log_costs[rng.integers(0, s, s)][:, rng.integers(0, n, n)]
        places[row] = _places(drawn.mean(axis=(0, 1)))
    ends = np.quantile(places, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0, method="closest_observation")
    return RankRange(_places(log_costs.mean(axis=(0, 1))), *ends.astype(np.int64))


def _places(costs: FloatArray) -> IntArray:
    """Return the rank (k,) of each method; equal costs share the better rank."""
    return np.asarray(np.sum(costs[None, :] < costs[:, None], axis=1) + 1, dtype=np.int64)


def critical_difference(methods: int, scenarios: int, level: float = 0.05) -> float:
    """Return the critical difference of the mean ranks of k methods over N scenarios at ``level``.

    ::

        CD = q sqrt(k (k + 1)/(6 N)),  q the quantile of the studentised range of k, over sqrt(2)

    Source: Nemenyi, "Distribution-free multiple comparisons", Princeton (1963); Demšar, "Statistical comparisons of
    classifiers over multiple data sets", JMLR 7 (2006).
    """
    from scipy.stats import studentized_range

    q = float(studentized_range.ppf(1 - level, methods, np.inf)) / np.sqrt(2)
    return float(q * np.sqrt(methods * (methods + 1) / (6 * scenarios)))


def rank_cliques(mean_ranks: FloatArray, difference: float) -> list[IntArray]:
    """Return the largest groups of two or more methods with mean ranks (k,) within ``difference``, the best first.

    A critical-difference diagram joins the methods of a group by a line.
    """
    order = np.argsort(mean_ranks, kind="stable")
    ranked = mean_ranks[order]
    ends = np.searchsorted(ranked, ranked + difference, side="right")
    return [
        order[first:end] for first, end in enumerate(ends) if end - first > 1 and (first == 0 or end > ends[first - 1])
    ]


def kendall_tau(first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """Return Kendall's tau-b of the values (k,) of two metrics for the same methods, and its p; NaN for k < 3.

    It is 1 if both metrics rank the methods in the same order, and -1 for the reverse order.

    Source: Kendall, "The treatment of ties in ranking problems", Biometrika 33 (1945).
    """
    from scipy.stats import kendalltau

    known = ~(np.isnan(first) | np.isnan(second))
    if known.sum() < 3:
        return np.nan, np.nan
    tau = kendalltau(first[known], second[known])
    return float(tau.statistic), float(tau.pvalue)


def mean_ranks(costs: FloatArray) -> FloatArray:
    """Return (s,) the mean rank of s methods over the scenarios of (p, s) costs; 1 is the best.

    Equal costs share their mean rank; a cost that is not finite (a failed run) gets the last rank of its scenario.
    """
    from scipy.stats import rankdata

    filled = np.where(np.isfinite(costs), costs, np.inf)
    return np.asarray(rankdata(filled, axis=1).mean(axis=0))


def performance_profile(costs: FloatArray, factors: FloatArray) -> FloatArray:
    """Return (s, f) the fraction of scenarios with a cost of at most ``factors`` (f,) times the lowest cost.

    ::

        rho_s(tau) = |{p: c_ps <= tau min_s' c_ps'}|/P

    A cost that is not finite never counts, and a scenario without a finite cost counts against all methods.

    Source: Dolan and Moré, "Benchmarking optimization software with performance profiles", Math. Prog. 91 (2002).
    """
    filled = np.where(np.isfinite(costs), costs, np.inf)
    best = filled.min(axis=1, keepdims=True)
    near = np.isfinite(filled)[:, :, None] & (
        filled[:, :, None] <= factors * np.where(np.isfinite(best), best, 0.0)[:, :, None]
    )
    return np.asarray(near.mean(axis=0))


class OverScenarios(NamedTuple):
    """The comparison of a with b over S scenarios with the same n seeds in each.

    Attributes:
        ratio: geometric mean of a/b over scenarios and seeds.
        low: lower end of the interval, which is valid for other scenarios and seeds; NaN for a single scenario.
        high: upper end.
        dof: degrees of freedom of the interval (Satterthwaite).
        scenario_sigma: standard deviation of the log ratio between scenarios.
        seed_sigma: standard deviation between seeds, common to the scenarios.
        sigma: standard deviation of the residuals.
        worst: index of the scenario with the largest ratio.
        worst_ratio: geometric mean of a/b there.
    """

    ratio: float
    low: float
    high: float
    dof: float
    scenario_sigma: float
    seed_sigma: float
    sigma: float
    worst: int
    worst_ratio: float


def over_scenarios(d: FloatArray, confidence: float = 0.95) -> OverScenarios:
    """Return the mixed model of (S, n) log ratios log(a/b), all finite.

    ::

        d_si = mu + u_s + v_i + e_si        u_s ~ N(0, sigma_u^2), v_i ~ N(0, sigma_v^2), e_si ~ N(0, sigma_e^2)

    which is log error ~ method + (method | scenario) + (method | seed) for two methods: effects of a scenario or a seed
    that are common to both methods cancel in d. With the mean squares of scenarios, seeds and residuals::

        sigma_e^2 = MSE,  sigma_u^2 = (MSS - MSE)/n,  sigma_v^2 = (MSI - MSE)/S,  var(mu) = (MSS + MSI - MSE)/(S n)

    A negative variance is replaced by 0, and its mean square is pooled with the residuals. For these balanced data,
    this is the restricted maximum likelihood estimate.

    Source: Searle, Casella and McCulloch, "Variance Components", Wiley (1992), 4.5; Satterthwaite, "An approximate
    distribution of estimates of variance components", Biometrics Bulletin 2 (1946).
    """
    from scipy.special import stdtrit

    (s, n), means, total = d.shape, d.mean(axis=1), d.mean()
    worst, mu = int(np.argmax(means)), float(means.mean())
    scenario, seed = n * float(np.sum((means - total) ** 2)), s * float(np.sum((d.mean(axis=0) - total) ** 2))
    rest, freedom = max(0.0, float(np.sum((d - total) ** 2)) - scenario - seed), (s - 1.0) * (n - 1.0)
    sums = {"scenario": (scenario, s - 1.0), "seed": (seed, n - 1.0)}
    for name in sorted(sums, key=lambda name: sums[name][0] / max(1.0, sums[name][1])):
        square, own = sums[name]
        if freedom > 0 and square * freedom <= rest * own:  # pool
            rest, freedom = rest + square, freedom + own
            del sums[name]
    each = rest / max(1.0, freedom)
    squares = {name: square / max(1.0, own) for name, (square, own) in sums.items()}
    kept = [(squares[name], own) for name, (_, own) in sums.items() if own > 0]
    # pooled mean squares cancel in MSS + MSI - MSE
    terms = [*kept, (-each, freedom)] if len(kept) == 2 else kept or [(each, freedom)]
    variance = sum(square for square, _ in terms)
    spread = sum(square**2 / own for square, own in terms if own > 0)
    error, dof = float(np.sqrt(variance / (s * n))), variance**2 / spread if spread > 0 else np.inf
    half = float(stdtrit(dof, (1 + confidence) / 2)) * error if s > 1 else np.nan
    return OverScenarios(
        ratio=float(np.exp(mu)),
        low=float(np.exp(mu - half)),
        high=float(np.exp(mu + half)),
        dof=dof,
        scenario_sigma=float(np.sqrt((squares.get("scenario", each) - each) / n)),
        seed_sigma=float(np.sqrt((squares.get("seed", each) - each) / s)),
        sigma=float(np.sqrt(each)),
        worst=worst,
        worst_ratio=float(np.exp(means[worst])),
    )
