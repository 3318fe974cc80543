"""Confidence intervals of a mean, a median and a share, and the tests from which they come."""

from functools import lru_cache
from math import ceil, inf, log, log1p

import numpy as np

from jerkbench.arrays import FloatArray


def student_interval(d: FloatArray, confidence: float) -> tuple[float, float]:
    """Return the ends of Student's interval for the mean of ``d``; NaN of fewer than two."""
    low, high = student_intervals(np.asarray(d)[None], confidence)
    return float(low[0]), float(high[0])


def student_intervals(d: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of Student's intervals for the means of (k, n) values; NaN of fewer than two."""
    from scipy.special import stdtrit

    n = d.shape[1]
    if n < 2:
        return np.full(len(d), np.nan), np.full(len(d), np.nan)
    mean = d.mean(axis=1)
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * np.std(d, axis=1, ddof=1) / np.sqrt(n)
    return mean - half, mean + half


# The interval of a mean of few values that may be skewed.

ENOUGH = 20
"""Of so many values Student's interval holds a skewed mean nearly as often as it says; of fewer it is widened."""

SHRUNK = 0.6
"""So much of the skewness of few values is taken: all of it would be too cautious where tails are heavy."""

STRAIGHT = 1e-7
"""A cubic that bends less than this is its straight line, but for rounding."""


def few_intervals(d: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of the intervals for the means of (k, n) values; NaN of fewer than two.

    Student's; of 3 to `ENOUGH` - 1 values the shortest that holds it and Hall's, whose cubic removes skewness::

        g(t) = t + c t^2/(3 sqrt(n)) + c^2 t^3/(27 n) + c/(6 sqrt(n)),   c = .6 n/((n - 1)(n - 2)) sum ((d - mean)/s)^3
        mean - g^-1(+-q) s/sqrt(n),   q of Student's t

    Student's alone misses a skewed mean on the side of the tail that was not seen. Hall's alone is too short on the
    other side of few values, and of many with heavy tails (`docs/statistics.md` has the coverage of both, and joined).

    Source: Hall, "On the removal of skewness by transformation", J. R. Stat. Soc. B 54 (1992), 221 to 228,
    doi:10.1111/j.2517-6161.1992.tb01876.x; to shrink c, to take Student's q and to join the two is ours.
    """
    low, high = student_intervals(d, confidence)
    if not 2 < d.shape[1] < ENOUGH:
        return low, high
    below, above = hall_intervals(d, confidence, SHRUNK)
    return np.fmin(low, below), np.fmax(high, above)


def hall_intervals(d: FloatArray, confidence: float, share: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return Hall's ends (k,), (k,) with a ``share`` of the skewness, n > 2; NaN of values that do not scatter."""
    from scipy.special import stdtrit

    n, mean, s = d.shape[1], d.mean(axis=1), np.std(d, axis=1, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness = n / ((n - 1) * (n - 2)) * np.sum(((d - mean[:, None]) / s[:, None]) ** 3, axis=1)
    q, bend = float(stdtrit(n - 1, (1 + confidence) / 2)), share * skewness / np.sqrt(n)
    low, high = (mean - untransformed(end, bend) * s / np.sqrt(n) for end in (q, -q))
    return low, high


def untransformed(y: FloatArray | float, bend: FloatArray) -> FloatArray:
    """Return t (k,) where g(t) = y; ``bend`` (k,) is c/sqrt(n)."""
    straight = y - bend / 6
    curved = np.abs(bend) > STRAIGHT
    return np.asarray(np.divide(3 * (np.cbrt(1 + bend * straight) - 1), bend, out=straight, where=curved))


# The bias-corrected and accelerated bootstrap of a mean, for many samples of one size at once.

TIE = 1e-12
"""Of values that lie within 1 of each other: a resample's mean this near to the mean is the mean, but for rounding."""


def bca_ends(values: FloatArray, level: float, resamples: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of the intervals of the means of (k, n) values, each row within 1 of its mean.

    With m_1 <= ... <= m_B the means of B resamples of a row x, and d_i = x_i - mean(x)::

        z0    = Phi^-1(share of m_b < mean(x), of those that are equal a half)
        a     = sum_i d_i^3/(6 (sum_i d_i^2)^(3/2))
        end_c = quantile of m at Phi(z0 + (z0 + z_c)/(1 - a (z0 + z_c))),   z_c = -+Phi^-1((1 + level)/2)

    Every row meets the same resamples, whatever stands beside it. Their means are one matrix product with how often
    each value was drawn, which is much faster than to gather the values.

    Args:
        values: (k, n), n > 1, no row all equal.
        level: between 0 and 1.
        resamples: B.
        seed: of the draws.

    Source: Efron, "Better Bootstrap Confidence Intervals", JASA 82 (1987); d is n - 1 times what the jackknife gives.
    """
    from scipy.special import ndtr, ndtri

    mean = values.mean(axis=1, keepdims=True)
    means = np.sort(values @ _shares(values.shape[1], resamples, seed), axis=1)
    below = np.count_nonzero(means < mean - TIE, axis=1) + np.count_nonzero(means <= mean + TIE, axis=1)
    z0 = ndtri(below / (2 * resamples))
    deviation = values - mean
    a = np.sum(deviation**3, axis=1) / (6 * np.sum(deviation**2, axis=1) ** 1.5)
    z = ndtri((1 + level) / 2)
    low, high = (_between(means, ndtr(z0 + (z0 + end) / (1 - a * (z0 + end)))) for end in (-z, z))
    return low, high


@lru_cache(maxsize=2)
def _shares(n: int, resamples: int, seed: int) -> FloatArray:
    """Return the share (n, B) of each of n values in each resample."""
    drawn = np.random.default_rng(seed).integers(0, n, (resamples, n))
    places = drawn + n * np.arange(resamples)[:, None]
    times = np.bincount(places.ravel(), minlength=n * resamples)
    return np.asarray(times.reshape(resamples, n).T / n, dtype=np.float64)


# The median with its interval, and the quartiles: whatever the distribution is, lost runs included.

NEARLY = 0.93
"""A median's interval that covers at least this is given; of 5 values the whole range covers 93.75 %."""


def quantiles_of_rows(values: FloatArray, confidence: float = 0.95) -> tuple[FloatArray, ...]:
    """Return median, both ends of its interval, lower and upper quartile, (k,) each, of (k, n) values without NaN."""
    if values.shape[1] == 0:
        return (np.full(len(values), np.nan),) * 5
    ordered = np.sort(values, axis=1)
    lower, middle, upper = (_between(ordered, share) for share in (0.25, 0.5, 0.75))
    return middle, *median_intervals(ordered, confidence), lower, upper


def median_intervals(ordered: FloatArray, confidence: float, *, exact: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of the intervals of the medians of (k, n) values in ascending order, some infinite.

    Between the k-th and the (k+1)-th value from both ends, of which one covers more than asked and the other less, by
    interpolation; where either is infinite, or an ``exact`` one is asked for, the outer one, which inverts the sign
    test. NaN where even the whole range covers less than ``NEARLY``, or of higher levels and exactly, less than asked.

    Source: Hettmansperger and Sheather, "Confidence intervals based on interpolated order statistics", Statistics and
    Probability Letters 4 (1986).
    """
    from scipy.special import bdtr

    n = ordered.shape[1]
    if n < 2 or 1 - 2 * 0.5**n < (confidence if exact or confidence > 0.95 else min(confidence, NEARLY)):
        return np.full(len(ordered), np.nan), np.full(len(ordered), np.nan)
    below = bdtr(np.arange(n), n, 0.5)  # P(at most k of n lie below the median)
    k = max(1, int(np.searchsorted(below, (1 - confidence) / 2)))  # the largest k that covers enough
    wide, narrow = 1 - 2 * float(below[k - 1]), 1 - 2 * float(below[k])
    part = min(1.0, max(0.0, (wide - confidence) / (wide - narrow))) if k < n - k and not exact else 0.0
    weight = (n - k) * part / (k + (n - 2 * k) * part) if part else 0.0
    lower, upper = ordered.T, ordered.T[::-1]
    return _mixed(lower[k - 1], lower[k], weight), _mixed(upper[k - 1], upper[k], weight)


def _between(ordered: FloatArray, share: FloatArray | float) -> FloatArray:
    """Return the quantile of each row of values in ascending order, between two of them their mixture."""
    place = np.broadcast_to(share, len(ordered)) * (ordered.shape[1] - 1)
    left, rows = np.minimum(place.astype(np.int64), ordered.shape[1] - 2), np.arange(len(ordered))
    first, second = ordered[rows, left], ordered[rows, left + 1]
    infinite = np.isinf(second) & (place > left)
    return np.where(infinite, second, _mixed(first, second, place - left))


def _mixed(outer: FloatArray, inner: FloatArray, weight: FloatArray | float) -> FloatArray:
    """Return outer + weight (inner - outer); where either is infinite, the outer one."""
    kept = (outer == inner) | np.isinf(outer) | np.isinf(inner) | (weight == 0)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.where(kept, outer, outer + weight * (inner - outer))


LOCKED_OUT = 10.0
"""A run that is more than 10 times as wrong as the median run, or as the same run of another method, is locked out."""

# The interval of a share: of runs that were lost, of seeds that one method won; and what losses were not seen.

ONE_SIDED = 0.95
"""The share of lost runs is surely below its bound: not in 5 % of cases, whatever it is."""


@lru_cache(maxsize=10_000)
def share_interval(count: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return Clopper and Pearson's interval of a share: it covers at least ``confidence``, whatever the share is.

    Source: Clopper and Pearson, "The use of confidence or fiducial limits", Biometrika 26 (1934).
    """
    from scipy.special import betaincinv

    tail = (1 - confidence) / 2
    low = float(betaincinv(count, n - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, n - count, 1 - tail)) if count < n else 1.0
    return low, high


def loss_bound(count: int, n: int) -> float:
    """Return Clopper and Pearson's one-sided 95 % bound of the share of lost runs; of none in n it is 1 - .05^(1/n)."""
    return share_interval(count, n, 2 * ONE_SIDED - 1)[1]


def seeds_without_loss(margin: float) -> float:
    """Return how many seeds without a loss bound its share by ``margin``: 99 for 3 %."""
    return ceil(log(1 - ONE_SIDED) / log1p(-margin)) if 0 < margin < 1 else 1 if margin else inf


def failures_text(lost: int, locked: int, n: int, *, bound: bool = True) -> str:
    """Say how many runs were lost, how many locked out, and how many may be.

    >>> failures_text(0, 0, 20), failures_text(1, 2, 20)
    ('0 of 20 lost (up to 14 %)', '1 of 20 lost and 2 of 20 more than 10 times as wrong (up to 34 %)')
    """
    counts = [f"{lost} of {n} lost"] * bool(lost or not locked)
    counts += [f"{locked} of {n} more than {LOCKED_OUT:g} times as wrong"] * bool(locked)
    return f"{' and '.join(counts)}{f' ({up_to(lost + locked, n)})' if bound else ''}"


def up_to(count: int, n: int) -> str:
    """Return the bound of the share of lost runs in words."""
    percent = 100 * loss_bound(count, n)
    return f"up to {percent:.{0 if percent >= 10 else 1}f} %"
