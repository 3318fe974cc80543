"""The average of each combination over its seeds, with an interval: means, and medians or geometric means of errors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.intervals import (
    EQUAL_WITHIN,
    OUTLIER_FACTOR,
    bca_ends,
    few_intervals,
    quantiles_of_rows,
    student_intervals,
)


@dataclass(frozen=True, eq=False)
class Samples:
    """Many samples of different sizes in one array.

    Attributes:
        values: (n,) the values of the samples, one sample after the other.
        sizes: (k,) number of values of each sample.
    """

    values: FloatArray
    sizes: IntArray

    @classmethod
    def of(cls, samples: Sequence[npt.ArrayLike]) -> "Samples":
        """Join samples of (n_1,), (n_2,), ... values."""
        arrays = [np.asarray(values, dtype=np.float64) for values in samples]
        sizes = np.array([len(array) for array in arrays], dtype=np.int64)
        return cls(np.concatenate([np.empty(0), *arrays]), sizes)

    @cached_property
    def owner(self) -> IntArray:
        """(n,) index of the sample of each value."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    def count(self, which: BoolArray) -> IntArray:
        """Return (k,) the number of values of each sample for which ``which`` (n,) is true."""
        return np.bincount(self.owner[which], minlength=len(self.sizes))

    def only(self, which: BoolArray) -> "Samples":
        """Return the samples with the values for which ``which`` (n,) is true; some samples may be empty."""
        return Samples(self.values[which], self.count(which))

    def without_nan(self) -> "Samples":
        """Return the samples without NaN."""
        return self.only(~np.isnan(self.values))

    def by_size(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield for each size the indices (j,) of the samples of this size, and their values (j, size)."""
        starts = np.cumsum(self.sizes) - self.sizes
        for size in np.unique(self.sizes).tolist():
            places = np.flatnonzero(self.sizes == size)
            yield places, self.values[starts[places][:, None] + np.arange(size)]


_RESAMPLES = 4999
"""Bootstrap resamples; the ends of the interval vary by about 2 % of its width from one seed of the resampling to
another."""

_BATCH = 128
"""Number of samples in one step of the bootstrap; larger batches need more memory and are not faster."""

MIN_BOOTSTRAP = 5
"""For fewer values, the interval is Student's, because the bootstrap interval would be too short."""

MAX_BOOTSTRAP = 1999
"""For more values, the mean is normal enough for Student's interval."""

_SEED = 20
"""Fixed: the same rows give the same table."""


class Interval(NamedTuple):
    """A mean with its interval; the ends are NaN if there is none."""

    mean: float
    low: float
    high: float


def mean_interval(values: npt.ArrayLike, confidence: float = 0.95) -> Interval:
    """Return the mean of (n,) independent values with its interval; see `mean_intervals`."""
    return Interval(*(float(of[0]) for of in mean_intervals(Samples.of([values]), confidence)))


def mean_intervals(samples: Samples, confidence: float = 0.95) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the means (k,) of the samples with the lower and upper ends (k,) of their BCa bootstrap intervals.

    NaN values (the metric does not apply) are left out. The ends are NaN for a single value and for infinite means; for
    equal values they are the mean. The result depends (except for rounding) only on the values of the sample, not on
    their order or on the other samples.

    A bootstrap of n values is too narrow by sqrt((n - 1)/n), and ignores the tails of Student's distribution. A higher
    level compensates for both: Phi(z) with z = t_{n-1} sqrt(n/(n - 1)). In simulations, the interval of 5, 10 and 20
    normal values contains the mean in 93, 95 and 95 % of cases (85, 91 and 93 % without this compensation).

    Source: Efron, "Better Bootstrap Confidence Intervals", JASA 82 (1987), see `bca_ends`; for the level
    Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69 (2015), 4.
    """
    mean, low, high = (np.full(len(samples.sizes), np.nan) for _ in range(3))
    for places, values in samples.without_nan().by_size():
        if values.shape[1]:
            mean[places], low[places], high[places] = _of_one_size(np.sort(values, axis=1), confidence)
    return mean, low, high


def _of_one_size(values: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return means and ends (k,) for (k, n) values in ascending order, n > 0."""
    n = values.shape[1]
    with np.errstate(invalid="ignore", over="ignore"):
        mean, spread = values.mean(axis=1), values[:, -1] - values[:, 0]
        equal = np.isfinite(mean) & (spread <= EQUAL_WITHIN * np.abs(mean)) & (n > 1)
    low, high = np.where(equal, mean, np.nan), np.where(equal, mean, np.nan)
    varying = np.flatnonzero(np.isfinite(mean) & np.isfinite(spread) & ~equal & (n > 1))
    for start in range(0, len(varying), _BATCH):
        rows = varying[start : start + _BATCH]
        # Values of magnitude 1 avoid overflow and underflow of their squares.
        scaled = (values[rows] - mean[rows, None]) / spread[rows, None]
        if MIN_BOOTSTRAP <= n <= MAX_BOOTSTRAP:
            ends = bca_ends(scaled, expanded(confidence, n), _RESAMPLES, _SEED)
            limits = values[rows, 0], values[rows, -1]  # rounding must not give an error of -1e-17
        else:
            ends, limits = student_intervals(scaled, confidence), (-np.inf, np.inf)
        with np.errstate(over="ignore"):
            low[rows], high[rows] = (np.clip(mean[rows] + spread[rows] * end, *limits) for end in ends)
    finite = np.isfinite(low) & np.isfinite(high)
    return mean, np.where(finite, low, np.nan), np.where(finite, high, np.nan)


def expanded(confidence: float, n: float) -> float:
    """Return the level at which the bootstrap interval of n > 1 values is as wide as Student's interval."""
    from scipy.special import ndtr, stdtrit  # scipy.stats takes half a second to import, in the first table too

    z = stdtrit(n - 1, (1 + confidence) / 2) * np.sqrt(n / (n - 1))
    return min(float(2 * ndtr(z) - 1), 1 - 2 / _RESAMPLES)


MIN_SEEDS = 6
"""Fewer seeds decide nothing: no exact test reaches 5 %, and there are too few different resamples."""

GEOMETRIC, MEDIAN, MEAN = "geometric mean", "median", "mean"


CENTRE_NUMBERS = ("value", "low", "high", "lower_quartile", "upper_quartile", "geometric")
CENTRE = np.dtype([("kind", object), *((name, np.float64) for name in CENTRE_NUMBERS), ("outlying", np.int64)])
"""The average of the errors of a combination.

- kind: `MEDIAN` of all runs from `MIN_SEEDS` on; for fewer runs `GEOMETRIC`, the geometric mean of the runs that did
  not fail, which does not depend on whether a rare failure was drawn
- value: infinite if half of the runs or more failed
- low: lower end of the 95 % interval; NaN if there is none
- high: upper end; infinite if it reaches the failed runs
- lower_quartile, upper_quartile: of all runs; a failed run is larger than any number
- geometric: geometric mean of the runs that did not fail
- outlying: number of runs with more than `OUTLIER_FACTOR` times the average
"""

Centre = np.record
Centres = np.recarray[Any, Any]
"""One centre, and (k,) centres, with the fields of `CENTRE`."""


def no_centres(count: int, kind: str) -> Centres:
    """Return the centres of ``count`` combinations without a value."""
    made = np.rec.array(np.zeros(count, CENTRE))
    made.kind = kind
    for name in CENTRE_NUMBERS:
        made[name] = np.nan
    return made


def centres(samples: Samples, confidence: float = 0.95, least: float | FloatArray = MIN_SEEDS) -> Centres:
    """Return the centres of samples of errors; a failed run is infinite, and NaN (does not apply) is left out.

    The interval of the median is that of order statistics, which rare outliers hardly change. The interval of the
    geometric mean is Student's interval of the logarithms, wider for few runs (`few_intervals`): the distribution of an
    RMSE is closer to a lognormal than to a normal distribution. The median is used from ``least`` values on, which may
    be different for each sample.
    """
    made = no_centres(len(samples.sizes), MEDIAN)
    for places, errors in samples.without_nan().by_size():
        if errors.shape[1]:
            for name, values in zip(CENTRE_NUMBERS[:5], quantiles_of_rows(errors, confidence), strict=True):
                made[name][places] = values
            outlying = np.isfinite(errors) & (errors > OUTLIER_FACTOR * made.value[places, None])
            made.outlying[places] = outlying.sum(axis=1)
    few = samples.sizes < least
    made.kind[few] = GEOMETRIC
    for places, errors in samples.only(np.isfinite(samples.values)).by_size():
        if errors.shape[1]:
            ends = _geometric(errors, confidence)
            made.geometric[places] = ends[0]
            for name, values in zip(CENTRE_NUMBERS[:3], ends, strict=True):
                made[name][places[few[places]]] = values[few[places]]
    return made


def _geometric(errors: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return geometric means and ends (k,) of (k, n) errors; if errors differ only by rounding, the first error."""
    with np.errstate(all="ignore"):
        logs = np.log(errors)
        mean, low, high = (np.exp(end) for end in (logs.mean(axis=1), *few_intervals(logs, confidence)))
    equal = np.ptp(errors, axis=1) <= EQUAL_WITHIN * errors.max(axis=1)
    same = errors[:, 0] if errors.shape[1] > 1 else np.full(len(errors), np.nan)
    return np.where(equal, errors[:, 0], mean), np.where(equal, same, low), np.where(equal, same, high)


def costs_of(samples: Samples, least: float | FloatArray = MIN_SEEDS) -> FloatArray:
    """Return (k,) the cost by which each sample is ranked: its centre, or infinity if a run failed."""
    failed = samples.count(np.isposinf(samples.values)) > 0
    return np.where(failed, np.inf, centres(samples, least=least).value)
