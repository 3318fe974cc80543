"""Confidence intervals of means, medians and fractions."""

from functools import lru_cache

import numpy as np

from jerkbench.arrays import FloatArray

EQUAL_WITHIN = 1e-14
"""Values are equal if their relative difference is at most this value, because such a difference is due to rounding."""

OUTLIER_FACTOR = 10.0
"""A run is an outlier if its error exceeds this factor times the median error, or the error of the other method."""


def student_intervals(d: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends (k,) of Student's intervals of the means of (k, n) values, NaN for n < 2."""
    from scipy.special import stdtrit

    n = d.shape[1]
    if n < 2:
        return np.full(len(d), np.nan), np.full(len(d), np.nan)
    mean = d.mean(axis=1)
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * np.std(d, axis=1, ddof=1) / np.sqrt(n)
    return mean - half, mean + half


ENOUGH = 20
"""From this number of values on, the coverage of Student's interval is nearly correct for skewed values."""

SHRUNK = 0.6
"""Fraction of the estimated skewness that is used. With the full skewness, intervals are too long for heavy tails."""

STRAIGHT = 1e-7
"""A cubic with a smaller ``bend`` is replaced by a straight line, because they differ only by rounding."""


def few_intervals(d: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends (k,) of intervals of the means of (k, n) values that may be skewed.

    For n < 2, the ends are NaN. For n = 2 and for n of at least `ENOUGH`, the function returns Student's interval. For
    3 to `ENOUGH` - 1 values, Student's interval is extended to contain Hall's interval, which removes the skewness by a
    cubic transformation::

        g(t) = t + c t^2/(3 sqrt(n)) + c^2 t^3/(27 n) + c/(6 sqrt(n)),   c = .6 n/((n - 1)(n - 2)) sum ((d - mean)/s)^3
        mean - g^-1(+-q) s/sqrt(n),   q of Student's t

    For skewed values, Student's interval is too short on the side of the tail that was not observed. Hall's interval is
    too short on the side of the observed tail if there are few values, or many values with heavy tails.
    `docs/statistics.md` lists the coverage of Student's interval, of Hall's interval, and of their union.

    Source: Hall, "On the removal of skewness by transformation", J. R. Stat. Soc. B 54 (1992), 221 to 228,
    doi:10.1111/j.2517-6161.1992.tb01876.x. Hall's article contains neither the factor .6 nor Student's q nor the union
    with Student's interval.
    """
    low, high = student_intervals(d, confidence)
    if not 2 < d.shape[1] < ENOUGH:
        return low, high
    below, above = hall_intervals(d, confidence, SHRUNK)
    return np.fmin(low, below), np.fmax(high, above)


def hall_intervals(d: FloatArray, confidence: float, fraction: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends (k,) of Hall's intervals of the means of (k, n) values, n > 2.

    ``fraction`` is the fraction of the estimated skewness that is removed. The ends are NaN if all values are equal.
    """
    from scipy.special import stdtrit

    n, mean, s = d.shape[1], d.mean(axis=1), np.std(d, axis=1, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness = n / ((n - 1) * (n - 2)) * np.sum(((d - mean[:, None]) / s[:, None]) ** 3, axis=1)
    q, bend = float(stdtrit(n - 1, (1 + confidence) / 2)), fraction * skewness / np.sqrt(n)
    low, high = (mean - untransformed(end, bend) * s / np.sqrt(n) for end in (q, -q))
    return low, high


def untransformed(y: FloatArray | float, bend: FloatArray) -> FloatArray:
    """Return the solution t (k,) of g(t) = y, with the function g of `few_intervals`. ``bend`` (k,) is c/sqrt(n)."""
    straight = y - bend / 6
    curved = np.abs(bend) > STRAIGHT
    return np.asarray(np.divide(3 * (np.cbrt(1 + bend * straight) - 1), bend, out=straight, where=curved))


TIE = 1e-12
"""The mean of a resample equals the mean of the values if their difference is at most this value (rounding)."""


def bca_ends(values: FloatArray, level: float, resamples: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends (k,) of the BCa bootstrap intervals of the means of (k, n) values.

    Let m_1 <= ... <= m_B be the means of B resamples of a row x, and let d_i = x_i - mean(x)::

        z0    = Phi^-1(fraction of m_b < mean(x), plus half of the fraction of m_b = mean(x))
        a     = sum_i d_i^3/(6 (sum_i d_i^2)^(3/2))
        end_c = quantile of m at Phi(z0 + (z0 + z_c)/(1 - a (z0 + z_c))),   z_c = -+Phi^-1((1 + level)/2)

    All rows use the same resamples. The means of the resamples are the product of the values and of a matrix with the
    frequencies of the values in the resamples. The matrix product is much faster than `scipy.stats.bootstrap`.

    Args:
        values: (k, n) values, n > 1. The values of a row differ from their mean by at most 1, and are not all equal.
        level: level of the intervals, between 0 and 1.
        resamples: number B of resamples.
        seed: seed of the random generator.

    Source: Efron, "Better Bootstrap Confidence Intervals", JASA 82 (1987); d is n - 1 times the jackknife difference.
    """
    from scipy.special import ndtr, ndtri

    mean = values.mean(axis=1, keepdims=True)
    means = np.sort(values @ _fractions(values.shape[1], resamples, seed), axis=1)
    below = np.count_nonzero(means < mean - TIE, axis=1) + np.count_nonzero(means <= mean + TIE, axis=1)
    z0 = ndtri(below / (2 * resamples))
    deviation = values - mean
    a = np.sum(deviation**3, axis=1) / (6 * np.sum(deviation**2, axis=1) ** 1.5)
    z = ndtri((1 + level) / 2)
    low, high = (quantiles(means, ndtr(z0 + (z0 + end) / (1 - a * (z0 + end)))) for end in (-z, z))
    return low, high


@lru_cache(maxsize=2)
def _fractions(n: int, resamples: int, seed: int) -> FloatArray:
    """Return the relative frequency (n, B) of each of n values in each of B resamples."""
    drawn = np.random.default_rng(seed).integers(0, n, (resamples, n))
    places = drawn + n * np.arange(resamples)[:, None]
    times = np.bincount(places.ravel(), minlength=n * resamples)
    return np.asarray(times.reshape(resamples, n).T / n, dtype=np.float64)


NEARLY = 0.93
"""Minimum coverage of a 95 % interval of the median. The range of 5 values covers 93.75 %, so it is accepted."""


def quantiles_of_rows(values: FloatArray, confidence: float = 0.95) -> tuple[FloatArray, ...]:
    """Return the median, the ends of its interval, and the quartiles, each (k,), of (k, n) values without NaN."""
    if values.shape[1] == 0:
        return (np.full(len(values), np.nan),) * 5
    ordered = np.sort(values, axis=1)
    lower, middle, upper = (quantiles(ordered, fraction) for fraction in (0.25, 0.5, 0.75))
    return middle, *median_intervals(ordered, confidence), lower, upper


def median_intervals(ordered: FloatArray, confidence: float, *, exact: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends (k,) of intervals of the medians of (k, n) values in ascending order.

    Values may be infinite. Let j be the largest number for which the interval from the j-th smallest to the j-th
    largest value has a coverage of at least ``confidence``. The ends are interpolated between this interval and the
    shorter interval for j + 1. If ``exact`` is true, or if one of the two ends is infinite, the end of the longer
    interval is returned. The exact interval is the inverse of the sign test.

    The ends are NaN if the range of all values covers less than ``confidence``. If the interval is not exact and
    ``confidence`` is at most 95 %, a coverage of `NEARLY` is sufficient.

    Source: Hettmansperger and Sheather, "Confidence intervals based on interpolated order statistics", Statistics and
    Probability Letters 4 (1986).
    """
    from scipy.special import bdtr

    n = ordered.shape[1]
    if n < 2 or 1 - 2 * 0.5**n < (confidence if exact or confidence > 0.95 else min(confidence, NEARLY)):
        return np.full(len(ordered), np.nan), np.full(len(ordered), np.nan)
    below = bdtr(np.arange(n), n, 0.5)  # probability that at most k of n values are below the median
    k = max(1, int(np.searchsorted(below, (1 - confidence) / 2)))  # the largest k with sufficient coverage
    wide, narrow = 1 - 2 * float(below[k - 1]), 1 - 2 * float(below[k])
    part = min(1.0, max(0.0, (wide - confidence) / (wide - narrow))) if k < n - k and not exact else 0.0
    weight = (n - k) * part / (k + (n - 2 * k) * part) if part else 0.0
    lower, upper = ordered.T, ordered.T[::-1]
    return _mixed(lower[k - 1], lower[k], weight), _mixed(upper[k - 1], upper[k], weight)


def quantiles(ordered: FloatArray, fraction: FloatArray | float) -> FloatArray:
    """Return the interpolated quantile (k,) of each row of (k, n) values in ascending order. Values may be infinite."""
    position = np.broadcast_to(fraction, len(ordered)) * (ordered.shape[1] - 1)
    left, rows = np.minimum(position.astype(np.int64), ordered.shape[1] - 2), np.arange(len(ordered))
    first, second = ordered[rows, left], ordered[rows, left + 1]
    infinite = np.isinf(second) & np.isfinite(first) & (position > left)
    return np.where(infinite, second, _mixed(first, second, position - left))


def _mixed(outer: FloatArray, inner: FloatArray, weight: FloatArray | float) -> FloatArray:
    """Return outer + weight (inner - outer), or the outer value if either value is infinite."""
    use_outer = (outer == inner) | np.isinf(outer) | np.isinf(inner) | (weight == 0)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.where(use_outer, outer, outer + weight * (inner - outer))


@lru_cache(maxsize=10_000)
def share_interval(count: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a binomial fraction, without the slow import of `scipy.stats`.

    Source: Clopper and Pearson, "The use of confidence or fiducial limits", Biometrika 26 (1934).
    """
    from scipy.special import betaincinv

    tail = (1 - confidence) / 2
    low = float(betaincinv(count, n - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, n - count, 1 - tail)) if count < n else 1.0
    return low, high


def failure_bound(count: int, n: int) -> float:
    """Return the one-sided 95 % upper bound of the failure rate for ``count`` failures in n runs.

    Without a failure, the bound is 1 - .05^(1/n).
    """
    return share_interval(count, n, 0.9)[1]


def failures_text(failed: int, outlying: int, n: int, *, bound: bool = True) -> str:
    """Return text with the numbers of failed runs and of outliers, and the upper bound of their joint rate.

    >>> failures_text(0, 0, 20), failures_text(1, 2, 20)
    ('0 of 20 failed (up to 14 %)', '1 of 20 failed and 2 of 20 with over 10 times the error (up to 34 %)')
    """
    counts = [f"{failed} of {n} failed"] * bool(failed or not outlying)
    counts += [f"{outlying} of {n} with over {OUTLIER_FACTOR:g} times the error"] * bool(outlying)
    return f"{' and '.join(counts)}{f' ({up_to(failed + outlying, n)})' if bound else ''}"


def up_to(count: int, n: int) -> str:
    """Return the text of the upper bound of the failure rate for ``count`` failures in n runs."""
    percent = 100 * failure_bound(count, n)
    return f"up to {percent:.{0 if percent >= 10 else 1}f} %"
