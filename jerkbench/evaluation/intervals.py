"""Confidence intervals of means, medians and fractions, and averages over the seeds of each combination."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray

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


def quantiles_of_rows(values: FloatArray) -> tuple[FloatArray, ...]:
    """Return the median, the ends of its 95 % interval, and the quartiles, each (k,), of (k, n) values without NaN."""
    if values.shape[1] == 0:
        return (np.full(len(values), np.nan),) * 5
    ordered = np.sort(values, axis=1)
    lower, middle, upper = (quantiles(ordered, fraction) for fraction in (0.25, 0.5, 0.75))
    return middle, *median_intervals(ordered, 0.95), lower, upper


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


# Averages over the seeds of each combination, with their intervals.


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of different sizes, stored in one array.

    Attributes:
        values: (n,) values of all samples, one sample after the other.
        sizes: (k,) number of values of each sample.
    """

    values: FloatArray
    sizes: IntArray

    @classmethod
    def of(cls, samples: Sequence[npt.ArrayLike]) -> "Samples":
        """Return samples from a sequence of arrays. Each array contains the values of one sample."""
        arrays = [np.asarray(values, dtype=np.float64) for values in samples]
        sizes = np.array([len(array) for array in arrays], dtype=np.int64)
        return cls(np.concatenate([np.empty(0), *arrays]), sizes)

    @cached_property
    def owner(self) -> IntArray:
        """The index (n,) of the sample that contains each value."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    def count(self, which: BoolArray) -> IntArray:
        """Return the number (k,) of values in each sample that the mask ``which`` (n,) selects."""
        return np.bincount(self.owner[which], minlength=len(self.sizes))

    def only(self, which: BoolArray) -> "Samples":
        """Return the samples reduced to the values for which ``which`` (n,) is true. Samples may then be empty."""
        return Samples(self.values[which], self.count(which))

    def without_nan(self) -> "Samples":
        """Return the samples without their NaN values."""
        return self.only(~np.isnan(self.values))

    def by_size(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield for each sample size the indices (j,) of the samples with this size, and their values (j, size)."""
        starts = np.cumsum(self.sizes) - self.sizes
        for size in np.unique(self.sizes).tolist():
            places = np.flatnonzero(self.sizes == size)
            yield places, self.values[starts[places][:, None] + np.arange(size)]


_RESAMPLES = 4999
"""Number of bootstrap resamples. The ends of an interval vary with the seed by about 2 % of the interval's width."""

_BATCH = 128
"""Number of samples that are resampled in one step. Larger batches need more memory and are not faster."""

MIN_BOOTSTRAP = 5
"""For fewer values, Student's interval is used instead of the bootstrap interval, which would be too short."""

MAX_BOOTSTRAP = 1999
"""For more values, Student's interval is used, because the mean is almost normally distributed."""

_SEED = 20
"""Seed of the bootstrap. It is fixed, so that equal rows give equal tables."""


def mean_intervals(samples: Samples, confidence: float = 0.95) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the means (k,) of the samples with the lower and upper ends (k,) of their BCa bootstrap intervals.

    NaN values (the metric does not apply) are left out. The ends are NaN for a single value and for infinite means. If
    all values of a sample are equal, the two ends of its interval are equal to the mean. The result for a sample does
    not depend on the order of its values or on the other samples, except for rounding.

    A bootstrap distribution of n values is too narrow by the factor sqrt((n - 1)/n), and its tails are lighter than the
    tails of Student's distribution. The higher level Phi(z) with z = t_{n-1} sqrt(n/(n - 1)) compensates for the narrow
    distribution and the light tails. In simulations, the 95 % interval of 5, 10 and 20 normal values contains the mean
    in 93, 95 and 95 % of cases. Without this compensation, the coverage is 85, 91 and 93 %.

    Source: Efron, "Better Bootstrap Confidence Intervals", JASA 82 (1987), see `bca_ends`; for the level
    Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69 (2015), 4.
    """
    mean, low, high = (np.full(len(samples.sizes), np.nan) for _ in range(3))
    for places, values in samples.without_nan().by_size():
        if values.shape[1]:
            mean[places], low[places], high[places] = _of_one_size(np.sort(values, axis=1), confidence)
    return mean, low, high


def _of_one_size(values: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the means and the interval ends, each (k,), of (k, n) values in ascending order, n > 0."""
    n = values.shape[1]
    with np.errstate(invalid="ignore", over="ignore"):
        mean, spread = values.mean(axis=1), values[:, -1] - values[:, 0]
        equal = np.isfinite(mean) & (spread <= EQUAL_WITHIN * np.abs(mean)) & (n > 1)
    low, high = np.where(equal, mean, np.nan), np.where(equal, mean, np.nan)
    varying = np.flatnonzero(np.isfinite(mean) & np.isfinite(spread) & ~equal & (n > 1))
    for start in range(0, len(varying), _BATCH):
        rows = varying[start : start + _BATCH]
        # Scaled values avoid overflow and underflow of their squares.
        scaled = (values[rows] - mean[rows, None]) / spread[rows, None]
        if MIN_BOOTSTRAP <= n <= MAX_BOOTSTRAP:
            ends = bca_ends(scaled, expanded(confidence, n), _RESAMPLES, _SEED)
            limits = values[rows, 0], values[rows, -1]  # rounding must not give a negative error
        else:
            ends, limits = student_intervals(scaled, confidence), (-np.inf, np.inf)
        with np.errstate(over="ignore"):
            low[rows], high[rows] = (np.clip(mean[rows] + spread[rows] * end, *limits) for end in ends)
    finite = np.isfinite(low) & np.isfinite(high)
    return mean, np.where(finite, low, np.nan), np.where(finite, high, np.nan)


def expanded(confidence: float, n: float) -> float:
    """Return the level at which the bootstrap interval of n > 1 normal values is as wide as Student's interval."""
    from scipy.special import ndtr, stdtrit  # importing scipy.stats takes half a second

    z = stdtrit(n - 1, (1 + confidence) / 2) * np.sqrt(n / (n - 1))
    return min(float(2 * ndtr(z) - 1), 1 - 2 / _RESAMPLES)


MIN_SEEDS = 6
"""Minimum number of seeds for a verdict. With fewer seeds, no exact test reaches a level of 5 %.

With fewer seeds, the number of different bootstrap resamples is also too small.
"""

GEOMETRIC, MEDIAN, MEAN = "geometric mean", "median", "mean"


CENTRE_NUMBERS = ("value", "low", "high", "lower_quartile", "upper_quartile", "geometric")
CENTRE = np.dtype([("kind", object), *((name, np.float64) for name in CENTRE_NUMBERS), ("outlying", np.int64)])

Centre = np.record
Centres = np.recarray[Any, Any]
"""The centre of one sample, and the centres (k,) of k samples. Both have the fields of `CENTRE`."""


def no_centres(count: int, kind: str) -> Centres:
    """Return ``count`` centres whose average, interval and quartiles are NaN."""
    made = np.rec.array(np.zeros(count, CENTRE))
    made.kind = kind
    for name in CENTRE_NUMBERS:
        made[name] = np.nan
    return made


def centres(samples: Samples, least: float | FloatArray = MIN_SEEDS) -> Centres:
    """Return the centres of samples of errors: their averages with intervals.

    The error of a failed run is infinite. NaN values (the metric does not apply) are left out. For a sample of at least
    ``least`` values, the average is the median. ``least`` may be a different number for each sample. The interval of
    the median uses order statistics, so rare outliers hardly change it. For a smaller sample, the average is the
    geometric mean of the runs that did not fail, so that a rare failure does not decide the average. The interval of
    the geometric mean is Student's interval of the logarithms, and is wider for few runs (`few_intervals`). Logarithms
    are used because the distribution of an RMSE is closer to a lognormal than to a normal distribution.

    The field ``kind`` of a centre is `MEDIAN` or `GEOMETRIC`, and ``value`` is the average. A median is infinite if at
    least half of the runs failed. The fields ``low`` and ``high`` are the ends of the 95 % interval. ``low`` is NaN if
    the interval is unknown, and ``high`` is infinite if the interval extends to failed runs. The fields
    ``lower_quartile`` and ``upper_quartile`` are the quartiles of all runs, in which failed runs are infinite. The
    field ``geometric`` is the geometric mean of the runs that did not fail. The field ``outlying`` is the number of
    runs whose error is finite and more than `OUTLIER_FACTOR` times the median.
    """
    made = no_centres(len(samples.sizes), MEDIAN)
    for places, errors in samples.without_nan().by_size():
        if errors.shape[1]:
            for name, values in zip(CENTRE_NUMBERS[:5], quantiles_of_rows(errors), strict=True):
                made[name][places] = values
            outlying = np.isfinite(errors) & (errors > OUTLIER_FACTOR * made.value[places, None])
            made.outlying[places] = outlying.sum(axis=1)
    few = samples.sizes < least
    made.kind[few] = GEOMETRIC
    for places, errors in samples.only(np.isfinite(samples.values)).by_size():
        if errors.shape[1]:
            ends = _geometric(errors)
            made.geometric[places] = ends[0]
            for name, values in zip(CENTRE_NUMBERS[:3], ends, strict=True):
                made[name][places[few[places]]] = values[few[places]]
    return made


def _geometric(errors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the geometric means and the interval ends, each (k,), of (k, n) errors.

    If the errors of a sample differ only by rounding, the mean and the ends are equal to the first error. The ends are
    NaN for n = 1.
    """
    with np.errstate(all="ignore"):
        logs = np.log(errors)
        mean, low, high = (np.exp(end) for end in (logs.mean(axis=1), *few_intervals(logs, 0.95)))
    equal = np.ptp(errors, axis=1) <= EQUAL_WITHIN * errors.max(axis=1)
    same = errors[:, 0] if errors.shape[1] > 1 else np.full(len(errors), np.nan)
    return np.where(equal, errors[:, 0], mean), np.where(equal, same, low), np.where(equal, same, high)


def chi2_band(dof: float, samples: float) -> tuple[float, float]:
    """Return the interval that contains the average of independent chi-square values with probability 95 %.

    ``samples`` is the number of values, and ``dof`` the degrees of freedom of each value.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """
    from scipy.special import chdtri  # importing scipy.stats takes half a second

    low, high = chdtri(dof * samples, [0.975, 0.025]) / samples
    return float(low), float(high)
