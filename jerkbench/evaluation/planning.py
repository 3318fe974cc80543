"""Seeds to come: how many seeds decide a comparison, and the levels of the interim analyses of `seeds=auto`."""

import itertools

import numpy as np

from jerkbench.arrays import FloatArray

POWER = 0.8
"""The named number of seeds decides with at least this probability."""

CAUTION = 0.8
"""The standard deviation for planning exceeds the true one with this probability."""

MAX_SEEDS = 10_000
"""Larger numbers of seeds are not named."""

FIRST = 20
"""Seeds of the first interim analysis; fewer decide little, because the bootstrap of many comparisons is wide."""


def seeds_needed(d: FloatArray, comparisons: int = 1, level: float = 0.05, critical: float = np.nan) -> int | None:
    """Return how many seeds show that a and b differ; None if they may be equal, and for more than `MAX_SEEDS`.

    The mean of N seeds is mu + s Z/sqrt(N), and decides if it is more than c standard errors away from 0. The result
    is the smallest N of the grid 6 * 1.05^k that decides with a probability of at least `POWER` for every mu in the
    95 % interval of the observed mean; if this interval contains 0, there is none. s is the upper `CAUTION` bound of
    the standard deviation. c is the value of `critical_t`, scaled by the ratio of ``critical`` to `critical_t` at the
    n seeds: it is smaller for correlated comparisons and larger for heavy tails.

    Args:
        d: (n,) log ratios; at least two, all finite.
        comparisons: number of comparisons in the study.
        level: of the whole study.
        critical: |t| that the n seeds had to reach; if NaN or infinite, the value of `critical_t`.
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
    """Return the approximate critical |t| of `max_t` for (k,) numbers of seeds and normal log ratios.

    It is Bonferroni's Student quantile times 1 + (8 + 7 log m)/n^2, fitted to the bootstrap with 6 to 50 seeds and 1 to
    180 comparisons. It is used for planning only.
    """
    from scipy.special import stdtrit

    wider = 1 + (8 + 7 * np.log(comparisons)) / n**2
    return np.asarray(stdtrit(n - 1, 1 - level / (2 * comparisons)) * wider, dtype=np.float64)


def interim_sizes(most: int, first: int = FIRST) -> list[int]:
    """Return the numbers of seeds of the interim analyses: ``first``, twice as many each time, at last ``most``.

    >>> interim_sizes(400)
    [20, 40, 80, 160, 320, 400]
    """
    doubled = (first << k for k in itertools.count())
    return [*itertools.takewhile(lambda size: size < most, doubled), most]


def interim_levels(sizes: list[int], level: float = 0.05) -> FloatArray:
    """Return the level (k,) of each interim analysis at ``sizes`` seeds; the levels add up to ``level``.

    The analyses up to the fraction t of the seeds spend alpha(t) = level log(1 + (e - 1) t). The sum of the levels is
    bounded, not the joint distribution of the analyses. This is valid for the largest of many comparisons as well,
    which may be a different comparison in each analysis.

    Source: Lan and DeMets, "Discrete sequential boundaries for clinical trials", Biometrika 70 (1983), Pocock's type.
    """
    t = np.asarray(sizes, dtype=np.float64) / sizes[-1]
    return np.diff(level * np.log1p((np.e - 1) * t), prepend=0.0)
