"""Many cells over their seeds: means, medians and log ratios with intervals."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.intervals import LOCKED_OUT, bca_ends, few_intervals, quantiles_of_rows


@dataclass(frozen=True, eq=False)
class Samples:
    """Many samples, one after the other.

    Attributes:
        values: (n,) of all samples.
        sizes: (k,) how many of them each sample has.
    """

    values: FloatArray
    sizes: IntArray

    @classmethod
    def of(cls, samples: Sequence[npt.ArrayLike]) -> "Samples":
        """Take (n_1,), (n_2,), ... values."""
        arrays = [np.asarray(values, dtype=np.float64) for values in samples]
        sizes = np.array([len(array) for array in arrays], dtype=np.int64)
        return cls(np.concatenate([np.empty(0), *arrays]), sizes)

    @cached_property
    def owner(self) -> IntArray:
        """(n,) the sample of each value."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    def count(self, which: BoolArray) -> IntArray:
        """Return (k,) for how many values of each sample ``which`` (n,) holds."""
        return np.bincount(self.owner[which], minlength=len(self.sizes))

    def only(self, which: BoolArray) -> "Samples":
        """Return the samples with those values for which ``which`` (n,) holds; some may be empty."""
        return Samples(self.values[which], self.count(which))

    def without_nan(self) -> "Samples":
        """Return the samples without what is no number."""
        return self.only(~np.isnan(self.values))

    def by_size(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield for each size the places (j,) of the samples that have it, and their values (j, size)."""
        starts = np.cumsum(self.sizes) - self.sizes
        for size in np.unique(self.sizes).tolist():
            places = np.flatnonzero(self.sizes == size)
            yield places, self.values[starts[places][:, None] + np.arange(size)]


# The arithmetic mean over seeds with its interval: of signed metrics, and those with an expected value.

_RESAMPLES = 4999
"""Bootstrap resamples: the ends of the interval move by some 2 % of its width from one draw to another."""

_HIGHEST = 1 - 2 / _RESAMPLES
"""So many resamples know no higher level."""

_ROWS_AT_ONCE = 128
"""Samples that go through the bootstrap together; more costs memory and saves no time."""

FEW = 5
"""Of fewer values the interval is Student's: the bootstrap's would be too short."""

MANY = 2000
"""From so many values on the mean is normal enough for Student's interval."""

SAME_WITHIN = 1e-14
"""Values that differ by less, relative to their mean, are equal: the bootstrap would divide rounding by rounding."""

_SEED = 20
"""Fixed: the same rows give the same table."""


class Interval(NamedTuple):
    """A mean with its bootstrap interval.

    Attributes:
        mean: arithmetic mean; NaN of no values.
        low: lower end; NaN where there is none (see `mean_interval`).
        high: upper end.
        n: how many values it is the mean of.
    """

    mean: float
    low: float
    high: float
    n: int


def mean_interval(values: npt.ArrayLike, confidence: float = 0.95) -> Interval:
    """Return the mean of (n,) independent values with its BCa bootstrap interval.

    NaN values (the metric did not apply) are left out, ``n`` says how many stay. One value has no interval (NaN); of
    equal values it is the mean itself; an infinite mean has none. The result depends (but for rounding) on the values
    alone: neither on their order nor on what else is computed.

    A bootstrap of n values is too narrow by sqrt((n - 1)/n), and knows nothing of Student's tails; both are made up for
    by a higher level, Phi(z) with z = t_{n-1} sqrt(n/(n - 1)). Simulated: of 5, 10 and 20 values it holds the mean
    of a Gaussian in 93, 95 and 95 % of cases (without: 85, 91 and 93 %). Of fewer than 5 values it is Student's.

    Source: Efron, "Better Bootstrap Confidence Intervals", JASA 82 (1987), see `bca_ends`; for the level
    Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69 (2015), 4.
    """
    return mean_intervals([values], confidence)[0]


def mean_intervals(samples: Sequence[npt.ArrayLike], confidence: float = 0.95) -> list[Interval]:
    """Return what `mean_interval` gives for each sample; faster for many of one size."""
    together = Samples.of(samples)
    columns = (column.tolist() for column in (*mean_intervals_of(together, confidence), together.without_nan().sizes))
    return list(map(Interval, *columns))


def mean_intervals_of(samples: Samples, confidence: float = 0.95) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean, lower and upper end, (k,) each, as `mean_interval` gives them for each sample."""
    mean, low, high = (np.full(len(samples.sizes), np.nan) for _ in range(3))
    for places, values in samples.without_nan().by_size():
        if values.shape[1]:
            mean[places], low[places], high[places] = _of_one_size(np.sort(values, axis=1), confidence)
    return mean, low, high


def _of_one_size(values: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean and ends of (k, n) values in ascending order, n > 0."""
    n = values.shape[1]
    with np.errstate(invalid="ignore", over="ignore"):
        mean, spread = values.mean(axis=1), values[:, -1] - values[:, 0]
        equal = np.isfinite(mean) & (spread <= SAME_WITHIN * np.abs(mean)) & (n > 1)
    low, high = np.where(equal, mean, np.nan), np.where(equal, mean, np.nan)
    varying = np.flatnonzero(np.isfinite(mean) & np.isfinite(spread) & ~equal)
    if 1 < n < FEW or n >= MANY:
        low[varying], high[varying] = _student(values[varying], confidence)
    elif n > 1 and len(varying):
        for rows in np.array_split(varying, -(-len(varying) // _ROWS_AT_ONCE)):
            low[rows], high[rows] = _bca(values[rows], confidence)
    return mean, low, high


def _student(values: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return Student's interval: of few values the bootstrap's is too short, of many it is the same."""
    from scipy.special import stdtrit

    mean, spread, n = values.mean(axis=1), values[:, -1] - values[:, 0], values.shape[1]
    with np.errstate(over="ignore"):  # of a few huge values the interval may be beyond all numbers
        scatter = spread * np.std((values - mean[:, None]) / spread[:, None], axis=1, ddof=1)
        half = scatter * stdtrit(n - 1, (1 + confidence) / 2) / np.sqrt(n)
        half[~np.isfinite(half)] = np.nan
    return mean - half, mean + half


def _bca(values: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) for (k, n) values."""
    # The interval moves and stretches with the values: brought to one scale, no square under- or overflows.
    mean, spread = values.mean(axis=1), values[:, -1] - values[:, 0]
    scaled = (values - mean[:, None]) / spread[:, None]
    ends = bca_ends(scaled, expanded(confidence, values.shape[1]), _RESAMPLES, _SEED)
    low, high = (np.clip(mean + spread * end, values[:, 0], values[:, -1]) for end in ends)  # no RMSE of -1e-17
    return low, high


def expanded(confidence: float, n: float) -> float:
    """Return the level at which the bootstrap of n values (more than 1) is as wide as Student's interval."""
    from scipy.special import ndtr, stdtrit  # scipy.stats takes half a second to import, in the first table too

    z = stdtrit(n - 1, (1 + confidence) / 2) * np.sqrt(n / (n - 1))
    return min(float(2 * ndtr(z) - 1), _HIGHEST)


# Two methods on common seeds: their log ratios, with the runs that failed.


@dataclass(frozen=True, eq=False)
class LogRatios:
    """d_i = log(a_i/b_i) over the seeds that both have; a lost run is larger than every number.

    Attributes:
        d: (n,) infinite where a alone lost the run, minus infinite where b alone did, 0 where both did.
        lost: (n, 2) whether a, and whether b, lost the run.
        locked: (n, 2) whether the run of a is more than `LOCKED_OUT` times as wrong as that of b, and the reverse. All
            are False where every ratio is within `LOCKED_OUT` times the median ratio: then no run is an exception.
        plain: whether no run was lost or locked out, so that the mean of d describes them.
    """

    d: FloatArray
    lost: BoolArray
    locked: BoolArray
    plain: bool

    @property
    def n(self) -> int:
        """Seeds that both have."""
        return len(self.d)

    @property
    def turned(self) -> "LogRatios":
        """Those of b to a."""
        return LogRatios(-self.d, self.lost[:, ::-1], self.locked[:, ::-1], self.plain)


def log_ratios(a: npt.ArrayLike, b: npt.ArrayLike) -> LogRatios:
    """Return the log ratios of (n,) errors of a to those of b, of which the i-th belong to the same seed.

    An infinite error is a lost run; of a seed where either is NaN (the metric did not apply), or negative, nothing is
    said. What differs by rounding is equal. An error of 0 beside another that is not is smaller by any factor.
    """
    return log_ratios_of([(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))])[0]


def log_ratios_of(errors: Iterable[tuple[FloatArray, FloatArray]]) -> list[LogRatios]:
    """Return what `log_ratios` gives for each pair of errors; those of one size are computed together."""
    known = [(a[kept], b[kept]) for a, b in errors for kept in [(a >= 0) & (b >= 0)]]
    samples = (Samples.of([pair[side] for pair in known]).by_size() for side in (0, 1))
    ratios: dict[int, LogRatios] = {}
    for (places, first), (_, second) in zip(*samples, strict=True):
        lost = np.stack([np.isinf(first), np.isinf(second)], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            d = np.log(first) - np.log(second)
            near = np.abs(first - second) <= SAME_WITHIN * np.minimum(first, second)
        d = np.where((first == second) | (near & ~lost.any(axis=-1)), 0.0, d)
        ratios.update(zip(places.tolist(), with_locked(d, lost), strict=True))
    return [ratios[place] for place in range(len(known))]


def with_locked(d: FloatArray, lost: BoolArray) -> list[LogRatios]:
    """Return the log ratios of k pairs, d (k, n) and lost (k, n, 2), with the runs that locked out."""
    locked = _locked(d)
    plain = np.asarray(np.isfinite(d).all(axis=1) & ~(lost | locked).any(axis=(1, 2)))
    return [LogRatios(*of) for of in zip(d, lost, locked, plain.tolist(), strict=True)]


def _locked(d: FloatArray) -> BoolArray:
    """Return `LogRatios.locked` (k, n, 2) of (k, n) log ratios."""
    finite, limit = np.isfinite(d), np.log(LOCKED_OUT)
    locked = np.stack([d > limit, d < -limit], axis=-1) & finite[..., None]
    for row in np.flatnonzero(locked.any(axis=(1, 2))):
        ratios = d[row][finite[row]]
        locked[row] &= (np.abs(ratios - np.median(ratios)) > limit).any()
    return locked


def middles(ordered: FloatArray) -> FloatArray:
    """Return the medians of (k, n) values in ascending order; between an infinite one and another, the infinite."""
    left, right = ordered[:, (ordered.shape[1] - 1) // 2], ordered[:, ordered.shape[1] // 2]
    with np.errstate(invalid="ignore"):
        mean = np.where(np.isinf(right), right, (left + right) / 2)
    return np.asarray(np.where(np.isinf(left), left, mean))


# The number that stands for the errors of a cell, with its interval: the median, of few seeds the geometric mean.


LEAST_SEEDS = 6
"""Of fewer seeds nothing is decided: no exact test reaches 5 %, and too few different resamples can be drawn."""

GEOMETRIC, MEDIAN, MEAN = "geometric mean", "median", "mean"


CENTRE_NUMBERS = ("value", "low", "high", "lower_quartile", "upper_quartile", "geometric")
CENTRE = np.dtype([("kind", object), *((name, np.float64) for name in CENTRE_NUMBERS), ("locked", np.int64)])
"""What stands for the errors of a cell.

- kind: `MEDIAN` of all runs from `LEAST_SEEDS` on, below them `GEOMETRIC` of those that went well: it does not depend
  on whether a failure was drawn
- value: infinite where half of the runs or more were lost
- low: lower end of the 95 % interval; NaN where there is none
- high: upper end; infinite where it reaches the lost runs
- lower_quartile, upper_quartile: of the runs, a lost one larger than every number
- geometric: geometric mean of those that went well
- locked: runs that are `LOCKED_OUT` times their median
"""

Centre = np.record
Centres = np.recarray[Any, Any]
"""One, and (k,) of them, with the fields of `CENTRE`."""


def no_centres(count: int, kind: str) -> Centres:
    """Return the centres of ``count`` cells without a value."""
    made = np.rec.array(np.zeros(count, CENTRE))
    made.kind = kind
    for name in CENTRE_NUMBERS:
        made[name] = np.nan
    return made


def centres(samples: Sequence[FloatArray]) -> list[Centre]:
    """Return what `centres_of` gives for each sample."""
    return list(centres_of(Samples.of(samples)))


def centres_of(samples: Samples, confidence: float = 0.95, least: float | FloatArray = LEAST_SEEDS) -> Centres:
    """Return the centres of samples of errors, infinite for a lost run; NaN (did not apply) is left out.

    The median has an interval by order statistics: lock-outs that were not drawn move it little. The geometric mean has
    Student's interval on the logarithms, of few runs a wider one (`few_intervals`): errors of an RMSE scatter more like
    a lognormal than like a normal. The median stands from ``least`` values on, of each sample its own.
    """
    made = no_centres(len(samples.sizes), MEDIAN)
    for places, errors in samples.without_nan().by_size():
        if errors.shape[1]:
            for name, values in zip(CENTRE_NUMBERS[:5], quantiles_of_rows(errors, confidence), strict=True):
                made[name][places] = values
            locked = np.isfinite(errors) & (errors > LOCKED_OUT * made.value[places, None])
            made.locked[places] = locked.sum(axis=1)
    few = samples.sizes < least
    made.kind[few] = GEOMETRIC
    for places, errors in samples.only(np.isfinite(samples.values)).by_size():
        if errors.shape[1]:
            ends = _geometric(errors, confidence)
            made.geometric[places] = ends[0]
            for name, values in zip(CENTRE_NUMBERS[:3], ends, strict=True):
                made[name][places[few[places]]] = values[few[places]]
    return made


def costs_of(samples: Samples, least: float | FloatArray = LEAST_SEEDS) -> FloatArray:
    """Return (k,) by what each sample is ranked: its centre, infinite where a run was lost."""
    lost = samples.count(np.isposinf(samples.values)) > 0
    return np.where(lost, np.inf, centres_of(samples, least=least).value)


def _geometric(errors: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return geometric mean and ends of (k, n) errors; where they differ by rounding alone, the first."""
    with np.errstate(all="ignore"):
        logs = np.log(errors)
        mean, low, high = (np.exp(end) for end in (logs.mean(axis=1), *few_intervals(logs, confidence)))
    alike = np.ptp(errors, axis=1) <= SAME_WITHIN * errors.max(axis=1)
    same = errors[:, 0] if errors.shape[1] > 1 else np.full(len(errors), np.nan)
    return np.where(alike, errors[:, 0], mean), np.where(alike, same, low), np.where(alike, same, high)
