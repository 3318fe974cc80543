"""The comparison of two methods on common seeds: log ratios of their errors, tests, intervals and verdicts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.intervals import (
    EQUAL_WITHIN,
    MIN_SEEDS,
    OUTLIER_FACTOR,
    Samples,
    failure_bound,
    failures_text,
    median_intervals,
    quantiles,
)

MARGIN = 0.03
"""Default margin of equality: ratios from 1/1.03 to 1.03 count as equal."""

LEVEL = 0.05
"""Maximum fraction of studies with any false verdict."""

MEDIAN_FACTOR = 3.0
"""If the median ratio exceeds this factor, the verdict is "better" instead of "fails in fewer runs"."""

MAX_FACTOR = 1000.0
"""An interval that contains both 1/1000 and 1000 has no information, and is not reported."""


@dataclass(frozen=True, eq=False)
class LogRatios:
    """The log ratios d_i = log(a_i/b_i) of the errors a_i and b_i of two methods a and b on their n common seeds.

    Attributes:
        d: (n,) log ratio for each seed. The log ratio is infinite if only the run of a failed, minus infinite if only
            the run of b failed, and 0 if both failed.
        failed: (n, 2) whether the run of a and the run of b diverged or failed.
    """

    d: FloatArray
    failed: BoolArray

    @property
    def n(self) -> int:
        """The number of common seeds."""
        return len(self.d)

    @cached_property
    def outlying(self) -> BoolArray:
        """Mask (n, 2) of seeds on which the error of a is over `OUTLIER_FACTOR` times the error of b, or vice versa.

        If all ratios are within a factor of `OUTLIER_FACTOR` of the median ratio, all values of the mask are False.
        """
        limit = math.log(OUTLIER_FACTOR)
        finite = np.isfinite(self.d)
        beyond = np.stack([self.d > limit, self.d < -limit], axis=1) & finite[:, None]
        if beyond.any():
            ratios = self.d[finite]
            beyond &= bool((np.abs(ratios - np.median(ratios)) > limit).any())
        return beyond

    @cached_property
    def plain(self) -> bool:
        """True if no run failed or is an outlier. The comparison then uses the mean of d instead of the median of d."""
        return bool(np.isfinite(self.d).all()) and not (self.failed | self.outlying).any()

    @property
    def swapped(self) -> "LogRatios":
        """The log ratios log(b_i/a_i), with the methods swapped."""
        return LogRatios(-self.d, self.failed[:, ::-1])


def log_ratios(a: npt.ArrayLike, b: npt.ArrayLike) -> LogRatios:
    """Return the log ratios of the errors (n,) of a to the errors (n,) of b on the same seeds.

    An infinite error means that the run failed. Seeds are left out if an error is NaN (the metric does not apply) or
    negative. The log ratio of errors that differ only by rounding is 0.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    used = (a >= 0) & (b >= 0)
    errors = np.stack([a[used], b[used]], axis=1)
    failed = np.isinf(errors)
    with np.errstate(divide="ignore", invalid="ignore"):
        d = np.subtract(*np.log(errors).T)
        near = np.abs(np.subtract(*errors.T)) <= EQUAL_WITHIN * errors.min(axis=1)
    equal = (errors[:, 0] == errors[:, 1]) | (near & ~failed.any(axis=1))
    return LogRatios(np.where(equal, 0.0, d), failed)


def sign_p(for_a: int, for_b: int) -> float:
    """Return the two-sided p value of the sign test (binomial test of 1/2), without ties.

    If the arguments are the numbers of seeds on which only one of two methods failed, this is McNemar's exact test.

    Source: McNemar, "Note on the sampling error of the difference between correlated proportions", Psychometrika 12
    (1947).
    """
    from scipy.special import bdtr  # importing scipy.stats takes half a second

    fewer, total = min(for_a, for_b), for_a + for_b
    return min(1.0, 2.0 * float(bdtr(fewer, total, 0.5))) if total else 1.0


def median_p(d: FloatArray) -> float:
    """Return the two-sided p value of the sign test of the hypothesis that the median of (n,) values is 0.

    Values of 0 are counted as positive and as negative. `median_intervals` is the inverse of this test.
    """
    from scipy.special import bdtr

    return min(1.0, 2.0 * float(bdtr(min((d <= 0).sum(), (d >= 0).sum()), len(d), 0.5)))


# All comparisons without failures are tested together, by resampled seeds and the largest |t| of all means.

_RESAMPLES = 1999
_SEED = 14
"""Seed of the bootstrap. It is fixed, so that equal rows give equal verdicts."""

_BATCH = 16
"""Number of means that are resampled in one step. Their resamples fit into the cache of the processor."""

_MIN_VARIANCE = 1e-12
"""Minimum variance of a resample, as a fraction of the variance of the values.

A resample with a smaller variance has no spread, because it contains one value n times, so its t is infinite.
"""

COMMON = 0.9
"""The scale of each mean is at least this quantile of the scales of the family."""

TAIL = 0.05
"""Fraction of the resamples, those with the largest |t|, from which the scale of a mean is estimated."""

MIN_SLOPE = 0.01
"""Minimum slope of a tail (P ~ |t|^-100). It is needed because the largest |t| of few seeds may all be equal."""


class MaxT(NamedTuple):
    """The bootstrap distribution of the largest score in a family of m means.

    The model of the tail of the resampled |t*| of a mean is P(|t*| > x) = TAIL (x/quantile)^(-1/slope). The score of a
    |t| is log(|t|/quantile)/slope.

    Attributes:
        scales: (3, m) for each mean, the quantile and the slope of its tail, and the fraction of resamples with zero
            standard deviation. The fraction `TAIL` of the resamples of a mean has a |t| of at least the quantile. The
            quantile is infinite if too many resamples have no spread. The slope is the mean of log(|t|/quantile) over
            the resamples in the tail.
        maxima: (B,) largest score of each of B resamples, in ascending order. A maximum is infinite if no mean has a
            spread in this resample.
    """

    scales: FloatArray
    maxima: FloatArray

    def p(self, t: FloatArray) -> FloatArray:
        """Return the p values (m,) of |t| (m,), corrected for the family.

        A p value is (1 + number of maxima that are at least as large as the score of |t|)/(B + 1). The p value is at
        least the fraction of resamples of this mean that have no spread.
        """
        larger = len(self.maxima) - np.searchsorted(self.maxima, _scores(t, self.scales), side="left")
        return np.asarray(np.maximum((1.0 + larger) / (1.0 + len(self.maxima)), self.scales[2]))

    def critical(self, level: float) -> FloatArray:
        """Return the critical |t| (m,), above which p is at most ``level``, or infinity if no |t| is significant."""
        quantile, slope, flat = self.scales
        allowed = int(np.floor(level * (1 + len(self.maxima)) + 1e-9)) - 1
        if allowed < 0:
            return np.full_like(quantile, np.inf)
        usable = np.isfinite(quantile) & (flat <= level)
        factor = np.exp(self.maxima[len(self.maxima) - 1 - allowed] * slope)
        return np.where(usable, np.where(usable, quantile, 1.0) * factor, np.inf)


def standard_errors(d: FloatArray) -> FloatArray:
    """Return the standard errors (m,) of the means of (m, n) values, or 0 if the values differ only by rounding."""
    error = d.std(axis=1, ddof=1) / np.sqrt(d.shape[1])
    return np.where(error <= EQUAL_WITHIN * np.maximum(1.0, np.abs(d).max(axis=1)), 0.0, error)


def studentised(distance: FloatArray, error: FloatArray) -> FloatArray:
    """Return distance/error (m,). For an error of 0, the result is infinite, or 0 if the distance is also 0."""
    exact = np.where(distance > 0, np.inf, 0.0)
    return np.divide(distance, error, out=exact, where=error > 0)


def max_t(d: FloatArray) -> MaxT:
    """Return the distribution of the largest |t| of m means of (m, n) log ratios under the hypothesis that all are 0.

    The n seeds are drawn with replacement, and a resample uses the same seeds for all m comparisons. The correlation
    between comparisons (common methods, common seeds) is therefore retained. The values x of a comparison are its log
    ratios minus their mean. For each resample b, t_b of a comparison is computed from its resampled values x_b,
    score_b is computed from t_b, and maximum_b is the largest score_b of the m comparisons::

        t_b = mean(x_b)/(s(x_b)/sqrt(n))        score_b = log(|t_b|/q)/h        maximum_b = max over m of score_b

    q is the 95 % quantile of the |t_b| of a mean, and h is the mean of log(|t_b|/q) over the resamples beyond q (Hill's
    estimator). On the scale of the scores, the tails of all means are equal. A mean with a heavy tail therefore does
    not raise the critical |t| of the other means. For example, a single outlying seed, which a third of the resamples
    do not contain, causes a heavy tail. Without the scores, two comparisons with an outlying seed raised the critical
    |t| from 5 to 27 in a study of 932 comparisons over 20 seeds. With few seeds, the skewness is underestimated.
    Therefore, q and h are at least the 90 % quantiles of q and h over the family. Comparisons with constant log ratios
    have no influence on the result.

    Random sign flips would be an exact test for symmetric differences. For skewed differences, sign flips give a false
    verdict in 17 % of studies of 60 scenarios, and this bootstrap in about 5 % (benchmarks/README.md).

    Source: Romano and Wolf, "Exact and approximate stepdown methods for multiple hypothesis testing", JASA 100 (2005);
    Beran, "Balanced simultaneous confidence sets", JASA 83 (1988); Hill, "A simple general approach to inference about
    the tail of a distribution", Ann. Statist. 3 (1975); Hall, "The Bootstrap and Edgeworth Expansion", Springer (1992),
    3.3 for the studentised bootstrap.
    """
    fraction = _fractions(d.shape[1])
    scattered = standard_errors(d) > 0
    rows = d[scattered]
    starts = range(0, len(rows), _BATCH)
    resampled = lru_cache(256)(lambda start: _resampled(rows[start : start + _BATCH], fraction))  # at most 70 MB
    scales = np.concatenate([np.empty((3, 0)), *(_scales(resampled(start)) for start in starts)], axis=1)
    known = np.isfinite(scales[0])
    if known.any():
        common = np.quantile(scales[:2, known], COMMON, axis=1, method="higher")
        scales[:2] = np.maximum(scales[:2], common[:, None])
    largest = np.where(fraction.max(axis=0) == 1.0, np.inf, -np.inf)  # a resample of a single seed has no spread
    for start in starts:
        t = resampled(start)
        scores = np.where(np.isfinite(t), _scores(t, scales[:, start : start + _BATCH, None]), -np.inf)
        # a resample of a mean without spread gets the largest score of the other resamples of this mean
        scores = np.where(np.isfinite(t), scores, scores.max(axis=1, keepdims=True))
        np.maximum(largest, scores.max(axis=0), out=largest)
    every = np.tile([[1.0], [1.0], [0.0]], len(d))  # quantile and slope of constant rows are 1
    every[:, scattered] = scales
    return MaxT(every, np.sort(largest))


def _scores(t: FloatArray, scales: FloatArray) -> FloatArray:
    """Return the scores log(t/quantile)/slope. The distributions of the scores have equal tails for all means."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(t / scales[0]) / scales[1], dtype=np.float64)


def _resampled(d: FloatArray, fraction: FloatArray) -> FloatArray:
    """Return |t| (k, B) of B resamples of the centred rows of (k, n) values, infinite for a resample without spread."""
    centred = d - d.mean(axis=1, keepdims=True)
    centred /= np.sqrt(np.mean(centred**2, axis=1, keepdims=True))
    mean2 = (centred @ fraction) ** 2
    variance = (centred**2) @ fraction - mean2
    flat = variance < _MIN_VARIANCE
    ratio = np.divide((d.shape[1] - 1) * mean2, variance, out=mean2, where=~flat)
    ratio[flat] = np.inf
    return np.asarray(np.sqrt(ratio), dtype=np.float64)


def _scales(t: FloatArray) -> FloatArray:
    """Return the scales (3, k) of k means from the |t| (k, B) of their resamples; see `MaxT`."""
    flat = np.isinf(t)
    most = np.where(flat, 0.0, t).max(axis=1, keepdims=True)
    count = int(TAIL * (t.shape[1] + 1))
    tail = -np.partition(-np.minimum(t, most), count, axis=1)[:, : count + 1]
    quantile = tail.min(axis=1)
    slope = np.log(tail / quantile[:, None]).sum(axis=1) / count
    fraction = flat.mean(axis=1)
    return np.array([np.where(fraction > TAIL, np.inf, quantile), np.maximum(slope, MIN_SLOPE), fraction])


@lru_cache(maxsize=4)
def _fractions(n: int) -> FloatArray:
    """Return the relative frequency (n, B) of each of n seeds in each of B resamples."""
    drawn = np.random.default_rng(_SEED).multinomial(n, np.full(n, 1 / n), size=_RESAMPLES)
    return np.ascontiguousarray(drawn.T / n)


class Verdict(StrEnum):
    """The verdict on method a against method b, at the level of the study."""

    BETTER = "better"
    EQUAL = "equal"
    SMALL = "small difference"
    WORSE = "worse"
    FEWER_FAILED = "fails in fewer runs"
    MORE_FAILED = "fails in more runs"
    UNDECIDED = "undecided"


SWAPPED = {
    Verdict.BETTER: Verdict.WORSE,
    Verdict.WORSE: Verdict.BETTER,
    Verdict.FEWER_FAILED: Verdict.MORE_FAILED,
    Verdict.MORE_FAILED: Verdict.FEWER_FAILED,
}
"""The verdict on b against a for each verdict on a against b. Verdicts that are not listed are symmetric."""

WINS = (Verdict.BETTER, Verdict.FEWER_FAILED)
DEFEATS = (Verdict.WORSE, Verdict.MORE_FAILED)
BY_FAILURES = (Verdict.FEWER_FAILED, Verdict.MORE_FAILED)

NOT_EXCLUDED = "more seeds are needed to exclude rare failures"
"""Reason for "undecided": the errors are equal, but the number of seeds is too small to exclude rare failures."""

FAILED_MORE = "the method with the smaller errors failed in more runs"
"""Reason for "undecided": one method has the smaller errors, but more failures."""


class Judgement(NamedTuple):
    """The comparison of a with b on their common seeds.

    Attributes:
        ratio: geometric mean of a/b, or the median of a/b if runs failed or are outliers.
        low: lower end of the interval of the ratio at the level of the study. ``low`` is NaN for fewer than `MIN_SEEDS`
            seeds, for a median of too few seeds for this level, and if the interval exceeds `MAX_FACTOR` in both
            directions.
        high: upper end of the interval of the ratio. ``high`` is infinite if the interval contains failed runs.
        n: number of common seeds.
        p: p value of a difference of the errors, corrected for all comparisons of the study.
        p_failed: p value of a difference of the failure rates (outliers are failures), corrected for all comparisons.
        failed: numbers of runs of a and of b that diverged or failed.
        outlying: numbers of runs of a and of b that are outliers; see `LogRatios`.
        median: whether the median ratio was computed and tested, instead of the geometric mean.
        critical: critical |t| of the mean log ratio, NaN for a median.
        verdict: verdict at the level of the study.
        reason: reason why the verdict is "undecided" although the interval alone would decide, otherwise empty.
    """

    ratio: float
    low: float
    high: float
    n: int
    p: float
    p_failed: float
    failed: tuple[int, int]
    outlying: tuple[int, int]
    median: bool
    critical: float
    verdict: Verdict
    reason: str

    @property
    def failures(self) -> tuple[int, int]:
        """The numbers of runs of a and of b that failed or are outliers."""
        return self.failed[0] + self.outlying[0], self.failed[1] + self.outlying[1]

    @property
    def swapped(self) -> "Judgement":
        """The judgement with the two methods swapped."""
        ratio, low, high = (1 / value if value else math.inf for value in (self.ratio, self.high, self.low))
        verdict = SWAPPED.get(self.verdict, self.verdict)
        failed, outlying = self.failed[::-1], self.outlying[::-1]
        return self._replace(ratio=ratio, low=low, high=high, failed=failed, outlying=outlying, verdict=verdict)

    @property
    def failure_rates(self) -> str:
        """The numbers of failed runs and outliers of both methods, and the upper bounds of their rates, as text."""
        ours, theirs = (failures_text(*of, self.n) for of in zip(self.failed, self.outlying, strict=True))
        return ours if ours == theirs else f"{ours} against {theirs}"


def judged(comparisons: Sequence[LogRatios], margin: float = MARGIN, level: float = LEVEL) -> list[Judgement]:
    """Return the judgements of all comparisons of a study, which are tested together as one family.

    The verdict on method a against method b is the first one in this list whose condition is satisfied::

        fails ...   McNemar's exact test of the seeds on which only one of the two methods failed is significant, unless
                    the sign test of the errors is significant with a median ratio beyond `MEDIAN_FACTOR`
        small ...   the interval lies within 1/(1 + margin) to 1 + margin and excludes 1
        equal       the interval lies within these limits and contains 1, and the failure rate of each method is below
                    the margin (`failure_bound`, not corrected for the number of comparisons)
        better      the interval lies below 1, and a failed in no more runs than b
        worse       the interval lies above 1, and b failed in no more runs than a
        undecided   otherwise, and for fewer than `MIN_SEEDS` seeds

    The intervals of all comparisons of the study are simultaneous. If no run of a comparison failed, the interval of
    the mean of d = log(a/b) is mean -+ c s/sqrt(n), where `max_t` computes c for the comparison. If any run failed, the
    interval of the median of d is computed from order statistics. The interval of the median is the inverse of the
    exact sign test, with Bonferroni's correction for the study. In the sign test, a failed run is worse than any other
    run. Outliers count as failures.

    Args:
        comparisons: all comparisons of the study.
        margin: ratios from 1/(1 + margin) to 1 + margin count as equal.
        level: maximum fraction of studies with any false verdict.
    """
    count = max(1, sum(ratios.n >= MIN_SEEDS for ratios in comparisons))
    means = _tests_of_means(comparisons, level, count)
    judgements = []
    for k, ratios in enumerate(comparisons):
        centre = low = high = critical = np.nan
        p = p_failed = 1.0 if ratios.n else np.nan
        if ratios.plain:
            centre = float(ratios.d.mean()) if ratios.n else np.nan
            if k in means:
                p, critical, half = means[k]
                low, high = centre - half, centre + half
        else:
            ordered = np.sort(ratios.d)[None]
            (centre,) = quantiles(ordered, 0.5).tolist()
            if ratios.n >= MIN_SEEDS:
                exact = 2 * count  # each comparison has two tests: errors and failures
                ((low,), (high,)) = median_intervals(ordered, 1 - level / exact, exact=True)
                failed = ratios.failed | ratios.outlying
                discordant = (failed & ~failed[:, ::-1]).sum(axis=0).tolist()
                p, p_failed = min(1.0, exact * median_p(ratios.d)), min(1.0, exact * sign_p(*discordant))
        judgements.append(_judgement(ratios, (centre, float(low), float(high)), (p, p_failed), critical, margin, level))
    return judgements


def _tests_of_means(comparisons: Sequence[LogRatios], level: float, count: int) -> dict[int, tuple[float, ...]]:
    """Return the p value, the critical |t| and the half width of the interval of each comparison without failures.

    Comparisons with the same number of seeds are one family of `max_t`. The level of a family is proportional to its
    number of comparisons. ``count`` is the number of all tested comparisons of the study.
    """
    numbers = [k for k, ratios in enumerate(comparisons) if ratios.plain and ratios.n >= MIN_SEEDS]
    tests: dict[int, tuple[float, ...]] = {}
    for places, d in Samples.of([comparisons[k].d for k in numbers]).by_size():
        part, family, error = len(places) / count, max_t(d), standard_errors(d)
        p = np.minimum(1.0, family.p(studentised(np.abs(d.mean(axis=1)), error)) / part)
        critical = family.critical(level * part)
        half = np.multiply(critical, error, out=np.full_like(error, np.inf), where=np.isfinite(critical))
        found = zip(p.tolist(), critical.tolist(), half.tolist(), strict=True)
        tests |= zip((numbers[position] for position in places), found, strict=True)
    return tests


def _judgement(
    ratios: LogRatios,
    interval: tuple[float, float, float],
    p_values: tuple[float, float],
    critical: float,
    margin: float,
    level: float,
) -> Judgement:
    """Return the judgement of one comparison. `judged` defines the verdict. Inequalities with NaN are false."""
    (centre, low, high), (p, p_failed) = interval, p_values
    failed, outlying = ((int(of[:, 0].sum()), int(of[:, 1].sum())) for of in (ratios.failed, ratios.outlying))
    ours, theirs = failed[0] + outlying[0], failed[1] + outlying[1]
    side, more_failed = np.sign(centre), failed[0] - failed[1]  # a method with more failures is never better
    decides = p < level and (ours - theirs) * side >= 0 and more_failed * side >= 0
    verdict, reason = Verdict.UNDECIDED, ""
    clear = decides and math.log(MEDIAN_FACTOR) < abs(centre) < math.inf
    if p_failed < level and (ours - theirs) * more_failed >= 0 and not clear:
        verdict = Verdict.MORE_FAILED if ours > theirs else Verdict.FEWER_FAILED
    elif -math.log1p(margin) < low and high < math.log1p(margin):
        if decides:
            verdict = Verdict.SMALL
        elif p < level:
            reason = FAILED_MORE
        elif max(failure_bound(ours, ratios.n), failure_bound(theirs, ratios.n)) < margin:
            verdict = Verdict.EQUAL
        else:
            reason = NOT_EXCLUDED
    elif decides:
        verdict = Verdict.BETTER if centre < 0 else Verdict.WORSE
    elif p < level:
        reason = FAILED_MORE
    if low < -math.log(MAX_FACTOR) and high > math.log(MAX_FACTOR):
        low = high = np.nan
    with np.errstate(over="ignore"):
        ratio, low, high = np.exp([centre, low, high]).tolist()
    median = not ratios.plain
    return Judgement(ratio, low, high, ratios.n, p, p_failed, failed, outlying, median, critical, verdict, reason)
