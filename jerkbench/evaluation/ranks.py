"""Methods ranked over many scenarios: how far ranks would move, which of them differ, and whether metrics agree."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

_RESAMPLES = 1999
_SEED = 14


class RankRange(NamedTuple):
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
    rng = np.random.default_rng(_SEED)
    places = np.empty((_RESAMPLES, k), dtype=np.int64)
    for row in range(_RESAMPLES):
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


# Many scenarios at once: mean ranks and performance profiles, neither of which needs a common scale.


def mean_ranks(costs: FloatArray) -> FloatArray:
    """Return (s,) the mean rank of s solvers over the scenarios of (p, s) costs; 1 is the best.

    Equal costs share their ranks; a cost that is not finite (it diverged) is the last of its scenario.
    """
    from scipy.stats import rankdata

    filled = np.where(np.isfinite(costs), costs, np.inf)
    return np.asarray(np.mean([rankdata(row) for row in filled], axis=0))


def performance_profile(costs: FloatArray, factors: FloatArray) -> FloatArray:
    """Return (s, f) the share of scenarios in which a solver costs at most ``factors`` (f,) times the best of it.

    ::

        rho_s(tau) = |{p: c_ps <= tau min_s' c_ps'}|/P

    A cost that is not finite never is; a scenario in which none is finite counts against all.

    Source: Dolan and Moré, "Benchmarking optimization software with performance profiles", Math. Prog. 91 (2002).
    """
    filled = np.where(np.isfinite(costs), costs, np.inf)
    best = filled.min(axis=1, keepdims=True)
    near = np.isfinite(filled)[:, :, None] & (
        filled[:, :, None] <= factors * np.where(np.isfinite(best), best, 0.0)[:, :, None]
    )
    return np.asarray(near.mean(axis=0))


# Two methods over many scenarios: a mixed model of their log ratios, the worst scenario, ranks and their range.


class OverScenarios(NamedTuple):
    """How a compares with b over S scenarios with the same n seeds in each.

    Attributes:
        ratio: geometric mean of a/b over scenarios and seeds.
        low: lower end of its interval over scenarios and seeds that were not drawn; NaN of fewer than two scenarios.
        high: upper end.
        dof: degrees of freedom of the interval (Satterthwaite).
        scenario_sigma: standard deviation of the log ratio from scenario to scenario.
        seed_sigma: from seed to seed, common to the scenarios.
        sigma: of what is left.
        worst: index of the scenario where a compares worst.
        worst_ratio: geometric mean of a/b there.
        scenarios: S.
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
    scenarios: int


def over_scenarios(d: FloatArray, confidence: float = 0.95) -> OverScenarios:
    """Return the mixed model of (S, n) log ratios log(a/b), all finite.

    ::

        d_si = mu + u_s + v_i + e_si        u_s ~ N(0, sigma_u^2), v_i ~ N(0, sigma_v^2), e_si ~ N(0, sigma_e^2)

    which is log error ~ method + (method | scenario) + (method | seed) for two methods: what scenarios and seeds do to
    both alike cancels in d. With the mean squares of scenarios, seeds and rest::

        sigma_e^2 = MSE,  sigma_u^2 = (MSS - MSE)/n,  sigma_v^2 = (MSI - MSE)/S,  var(mu) = (MSS + MSI - MSE)/(S n)

    A variance that would be negative is 0, and its mean square joins the rest: for these balanced data that is what
    restricted maximum likelihood gives.

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
        if freedom > 0 and square * freedom <= rest * own:  # what is no larger than the rest joins it
            rest, freedom = rest + square, freedom + own
            del sums[name]
    each = rest / max(1.0, freedom)
    squares = {name: square / max(1.0, own) for name, (square, own) in sums.items()}
    kept = [(squares[name], own) for name, (_, own) in sums.items() if own > 0]
    # of MSS + MSI - MSE what is the rest itself cancels
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
        scenarios=s,
    )
