"""Ranks of methods over several scenarios, and a mixed model for the comparison of two methods."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

_RESAMPLES = 1999
_SEED = 14


class RankRange(NamedTuple):
    """The ranks of k methods with their ranges. The best method has rank 1.

    Attributes:
        rank: (k,) rank by the mean log error over scenarios and seeds.
        low: (k,) best rank in the bootstrap range.
        high: (k,) worst rank in the bootstrap range.
    """

    rank: IntArray
    low: IntArray
    high: IntArray


def rank_range(log_costs: FloatArray) -> RankRange:
    """Return the ranks of k methods with a 95 % bootstrap range.

    Scenarios and seeds are drawn with replacement. The ranges of the ranks are therefore valid for other scenarios of
    this kind and for other seeds. The log error of a failed run is infinite, so a method with a failed run is ranked
    behind all methods without failed runs.

    Args:
        log_costs: (S, n, k) log errors in S scenarios, on n seeds, of k methods.
    """
    s, n, k = log_costs.shape
    rng = np.random.default_rng(_SEED)
    places = np.empty((_RESAMPLES, k), dtype=np.int64)
    for row in range(_RESAMPLES):
        drawn = log_costs[rng.integers(0, s, s)][:, rng.integers(0, n, n)]
        places[row] = _places(drawn.mean(axis=(0, 1)))
    ends = np.quantile(places, [0.025, 0.975], axis=0, method="closest_observation")
    return RankRange(_places(log_costs.mean(axis=(0, 1))), *ends.astype(np.int64))


def _places(costs: FloatArray) -> IntArray:
    """Return the rank (k,) of each method. Methods with equal costs share the better rank."""
    return np.asarray(np.sum(costs[None, :] < costs[:, None], axis=1) + 1, dtype=np.int64)


class OverScenarios(NamedTuple):
    """The comparison of the errors a and b of two methods over S scenarios, with the same n seeds in each scenario.

    Attributes:
        ratio: geometric mean of a/b over scenarios and seeds.
        low: lower end of the interval, which is valid for other scenarios and seeds. ``low`` is NaN for a single
            scenario.
        high: upper end of the interval, NaN for a single scenario.
        dof: degrees of freedom of the interval (Satterthwaite).
        worst: index of the scenario with the largest ratio.
        worst_ratio: geometric mean of a/b over the seeds of the scenario ``worst``.
    """

    ratio: float
    low: float
    high: float
    dof: float
    worst: int
    worst_ratio: float


def over_scenarios(d: FloatArray, confidence: float = 0.95) -> OverScenarios:
    """Return the comparison of two methods by a mixed model of their log ratios log(a/b) (S, n), all finite.

    ::

        d_si = mu + u_s + v_i + e_si        u_s ~ N(0, sigma_u^2), v_i ~ N(0, sigma_v^2), e_si ~ N(0, sigma_e^2)

    The equation is the model log error ~ method + (method | scenario) + (method | seed) for two methods. Effects of a
    scenario or a seed that are common to both methods cancel in d. The estimates use the mean squares MSS of scenarios,
    MSI of seeds, and MSE of residuals::

        sigma_e^2 = MSE,  sigma_u^2 = (MSS - MSE)/n,  sigma_v^2 = (MSI - MSE)/S,  var(mu) = (MSS + MSI - MSE)/(S n)

    A negative variance is replaced by 0, and its mean square is pooled with the residuals. Because the data are
    balanced, the result is the restricted maximum likelihood estimate.

    Source: Searle, Casella and McCulloch, "Variance Components", Wiley (1992), 4.5; Satterthwaite, "An approximate
    distribution of estimates of variance components", Biometrics Bulletin 2 (1946).
    """
    from scipy.special import stdtrit

    (s, n), means, total = d.shape, d.mean(axis=1), d.mean()
    worst, mu = int(np.argmax(means)), float(means.mean())
    scenario, seed = n * float(np.sum((means - total) ** 2)), s * float(np.sum((d.mean(axis=0) - total) ** 2))
    rest, freedom = max(0.0, float(np.sum((d - total) ** 2)) - scenario - seed), (s - 1.0) * (n - 1.0)
    factors = [(scenario, s - 1.0), (seed, n - 1.0)]  # sum of squares and degrees of freedom
    for factor in sorted(factors, key=lambda factor: factor[0] / max(1.0, factor[1])):
        square, freedom_of_factor = factor
        if freedom > 0 and square * freedom <= rest * freedom_of_factor:  # the variance of this factor is not positive
            rest, freedom = rest + square, freedom + freedom_of_factor
            factors.remove(factor)
    each = rest / max(1.0, freedom)
    retained = [(square / of_factor, of_factor) for square, of_factor in factors if of_factor > 0]
    # A pooled mean square equals MSE, so it cancels in MSS + MSI - MSE.
    terms = [*retained, (-each, freedom)] if len(retained) == 2 else retained or [(each, freedom)]
    variance = sum(square for square, _ in terms)
    spread = sum(square**2 / freedom_of_factor for square, freedom_of_factor in terms if freedom_of_factor > 0)
    error, dof = float(np.sqrt(variance / (s * n))), variance**2 / spread if spread > 0 else np.inf
    half = float(stdtrit(dof, (1 + confidence) / 2)) * error if s > 1 else np.nan
    ratio, low, high, worst_ratio = np.exp([mu, mu - half, mu + half, means[worst]]).tolist()
    return OverScenarios(ratio, low, high, dof, worst, worst_ratio)
