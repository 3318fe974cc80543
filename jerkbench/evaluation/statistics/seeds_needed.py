"""Seeds that would decide a comparison, from the scatter that was seen."""

from functools import lru_cache

import numpy as np

from jerkbench.arrays import FloatArray

POWER = 0.8
"""So likely is it, at least, that so many seeds decide."""

CAUTION = 0.8
"""The scatter that is planned with is larger than the true one in so many cases."""

MOST = 10_000
"""More seeds than these nobody runs: none are named."""

PLACES = 101
"""Possible true ratios that are looked at."""


def seeds_needed(
    d: FloatArray, margin: float, comparisons: int = 1, level: float = 0.05, critical: float = np.nan
) -> int | None:
    """Return how many seeds decide whether a is better, worse or equal; None over `MOST`.

    Of N seeds the mean falls at mu + s Z/sqrt(N), and decides where it is more than c standard errors from 0, or more
    than c inside the margin::

        P(N, mu) = P[|mean| > c s/sqrt(N)  or  |mean| + c s/sqrt(N) < log(1 + margin)]

    The answer is the smallest N, of the grid 1.05^k, with P(N, mu) of at least `POWER` for every mu in the 95 %
    interval of the mean that was seen: wherever the true ratio is. s is the upper `CAUTION` bound of the standard
    deviation, c that of `critical_t`, as many times as large as ``critical`` is of theirs: a study whose comparisons
    go together asks for less, a heavy tail for more. Where equal and different are both near, it takes the most: mu =
    log(1 + margin)/2.

    Args:
        d: (n,) log ratios of the seeds that went well; at least two.
        margin: of equality, as a ratio less 1.
        comparisons: of the whole study.
        level: of the whole study.
        critical: |t| that the n seeds had to reach; without it, or where none is enough, that of `critical_t`.
    """
    if np.ptp(d) == 0:
        return len(d)
    sizes = _sizes()
    sizes = sizes[sizes > len(d)]
    planned = critical_t(np.append(len(d), sizes), comparisons, level)
    c = planned[1:] * (critical / planned[0] if np.isfinite(critical) else 1.0)
    enough = _power(sizes, d, float(np.log1p(margin)), c) >= POWER
    if not enough[-1]:
        return None
    short = np.flatnonzero(~enough)
    return int(sizes[short[-1] + 1 if len(short) else 0])


def critical_t(n: FloatArray, comparisons: int, level: float) -> FloatArray:
    """Return about how large the critical |t| of `max_t` is for (k,) numbers of seeds and normal log ratios.

    Bonferroni's Student quantile, wider by 1 + (8 + 7 log m)/n^2: fitted to the bootstrap's of 6 to 50 seeds and
    1 to 180 comparisons, to plan with; no verdict uses it.
    """
    from scipy.special import stdtrit

    wider = 1 + (8 + 7 * np.log(comparisons)) / n**2
    return np.asarray(stdtrit(n - 1, 1 - level / (2 * comparisons)) * wider, dtype=np.float64)


@lru_cache(maxsize=1)
def _sizes() -> FloatArray:
    return np.unique(np.ceil(6 * 1.05 ** np.arange(np.ceil(np.log(MOST / 6) / np.log(1.05)))))


def _power(sizes: FloatArray, d: FloatArray, margin: float, critical: FloatArray) -> FloatArray:
    """Return (k,) the least probability, of all true means, that each size decides at its critical |t|."""
    from scipy.special import chdtri, ndtr, stdtrit

    n, s = len(d), float(np.std(d, ddof=1))
    half = float(stdtrit(n - 1, 0.975)) * s / np.sqrt(n)
    mu = np.abs(np.linspace(d.mean() - half, d.mean() + half, PLACES))
    error = (s * np.sqrt((n - 1) / chdtri(n - 1, CAUTION)) / np.sqrt(sizes))[:, None]
    c = critical[:, None]
    differ = ndtr(mu / error - c) + ndtr(-mu / error - c)
    inside = np.maximum(0.0, np.minimum(margin / error - c, c))  # a mean further out than c differs already
    equal = ndtr(inside - mu / error) - ndtr(-inside - mu / error)
    return np.asarray((differ + equal).min(axis=1), dtype=np.float64)
