"""Planning of seeds.

This module computes the number of seeds that is needed to decide a comparison, and the significance levels of the
interim analyses of ``seeds=auto``.
"""

import itertools

import numpy as np

from jerkbench.arrays import FloatArray

POWER = 0.8
"""Minimum probability with which the result of `seeds_needed` decides the comparison."""

CAUTION = 0.8
"""Probability that the standard deviation used for planning exceeds the true standard deviation."""

MAX_SEEDS = 10_000
"""Maximum result of `seeds_needed`."""

FIRST = 20
"""Number of seeds in the first interim analysis. With fewer seeds, few comparisons are decided."""


def seeds_needed(d: FloatArray, comparisons: int = 1, level: float = 0.05, critical: float = np.nan) -> int | None:
    """Return the number of seeds that decides whether two methods differ, planned from the results of n seeds.

    The model of the mean of N seeds is mu + s Z/sqrt(N) with a standard normal Z. The comparison is decided if this
    mean is more than c standard errors away from 0. The result is the smallest N of the grid 6 * 1.05^k for which the
    probability of a decision is at least `POWER`, for every mu in the 95 % interval of the observed mean. The value s
    is the upper confidence bound of the standard deviation at the level `CAUTION`. The value c is the product of
    `critical_t` for N seeds and a ratio. The ratio is ``critical`` divided by `critical_t` for n seeds. This ratio is
    small if the comparisons are correlated, and large if the log ratios have heavy tails.

    Args:
        d: (n,) log ratios of the two methods, all finite, n > 1.
        comparisons: number of comparisons in the study.
        level: maximum probability of a false verdict in the study.
        critical: critical |t| of the n observed seeds. If ``critical`` is NaN or infinite, `critical_t` is used.

    Returns:
        The number of seeds, or None if it is more than `MAX_SEEDS`, or if the 95 % interval of the mean contains 0.
    """
    from scipy.special import chdtri, ndtri, stdtrit

    n, s, mean = len(d), float(np.std(d, ddof=1)), abs(float(d.mean()))
    nearest = mean - float(stdtrit(n - 1, 0.975)) * s / np.sqrt(n)
    if nearest <= 0:
        return None
    if np.ptp(d) == 0:
        return n
    sizes = np.unique(np.ceil(6 * 1.05 ** np.arange(np.ceil(np.log(MAX_SEEDS / 6) / np.log(1.05)))))
    sizes = sizes[sizes > n]
    planned = critical_t(np.append(n, sizes), comparisons, level)
    c = planned[1:] * (critical / planned[0] if np.isfinite(critical) else 1.0)
    error = s * np.sqrt((n - 1) / chdtri(n - 1, CAUTION)) / np.sqrt(sizes)
    enough = np.flatnonzero(nearest / error - c >= ndtri(POWER))
    return int(sizes[enough[0]]) if len(enough) else None


def critical_t(n: FloatArray, comparisons: int, level: float) -> FloatArray:
    """Return the approximate critical |t| (k,) of `max_t` for the numbers of seeds n (k,) and normal log ratios.

    The value is Student's quantile with Bonferroni's correction for m comparisons, times 1 + (8 + 7 log m)/n^2. The
    factor 1 + (8 + 7 log m)/n^2 was fitted to the bootstrap with 6 to 50 seeds and 1 to 180 comparisons. The result is
    used only for planning.
    """
    from scipy.special import stdtrit

    wider = 1 + (8 + 7 * np.log(comparisons)) / n**2
    return np.asarray(stdtrit(n - 1, 1 - level / (2 * comparisons)) * wider, dtype=np.float64)


def interim_sizes(most: int, first: int = FIRST) -> list[int]:
    """Return the numbers of seeds of the interim analyses: ``first``, doubled each time, and ``most`` as the last one.

    >>> interim_sizes(400)
    [20, 40, 80, 160, 320, 400]
    """
    doubled = (first << k for k in itertools.count())
    return [*itertools.takewhile(lambda size: size < most, doubled), most]


def interim_levels(sizes: list[int]) -> FloatArray:
    """Return the level (k,) of each interim analysis. ``sizes`` are the numbers of seeds of the analyses.

    The levels of all analyses with up to the fraction t of the seeds add up to alpha(t) = .05 log(1 + (e - 1) t), so
    the sum of all levels is 5 %. Bonferroni's inequality is used instead of the joint distribution of the analyses.
    Bonferroni's inequality is also valid for the largest of many statistics, which may belong to a different comparison
    in each analysis.

    Source: Lan and DeMets, "Discrete sequential boundaries for clinical trials", Biometrika 70 (1983), Pocock's type.
    """
    t = np.asarray(sizes, dtype=np.float64) / sizes[-1]
    return np.diff(0.05 * np.log1p((np.e - 1) * t), prepend=0.0)
