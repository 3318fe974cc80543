"""Many comparisons at once: the tests of a family, and what its verdicts may get wrong."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.over_seeds import LEAST_SEEDS, SAME_WITHIN, LogRatios, Samples

_RESAMPLES = 1999
_SEED = 14
"""Fixed: the same rows give the same verdicts."""

_ROWS_AT_ONCE = 16
"""Means that go through the bootstrap together: so many stay in the processor's cache."""

_FLAT = 1e-12
"""A resample with less of the variance than this is one value, drawn n times: its t is infinite."""

COMMON = 0.9
"""So many of a family's means have no wider scale than the one that is the least for all."""

TAIL = 0.05
"""The share of a mean's own resamples that its scale is taken from."""

STEEPEST = 0.01
"""No tail falls faster than t^-100: of few seeds the largest t of all resamples may be one number."""


class MaxT(NamedTuple):
    """The distribution of the largest score of a family of m means.

    A mean has the tail P(|t*| > x) = TAIL (x/quantile)^(-1/slope).

    Attributes:
        scales: (3, m) of each mean: the quantile that `TAIL` of its resamples reach (infinite where so many have no
            spread), the slope, which is the mean log of these resamples over the quantile, and the share of the
            resamples that have no spread.
        maxima: (B,) largest scores, in ascending order; infinite where every mean's resample had no spread.
        share: how much of the family's level is this distribution's; 1 where it is the whole family's.
    """

    scales: FloatArray
    maxima: FloatArray
    share: float = 1.0

    def p(self, t: FloatArray) -> FloatArray:
        """Return the p of (m,) |t|, corrected for the family: (1 + resamples whose largest is as large)/(B + 1).

        None is smaller than the share of its own resamples that have no spread.
        """
        larger = len(self.maxima) - np.searchsorted(self.maxima, _scores(t, self.scales), side="left")
        p = np.maximum((1.0 + larger) / (1.0 + len(self.maxima)), self.scales[2])
        return np.asarray(np.minimum(1.0, p / self.share), dtype=np.float64)

    def critical(self, level: float) -> FloatArray:
        """Return the |t| (m,) beyond which p is at most ``level``; infinite where none is."""
        quantile, slope, flat = self.scales
        allowed = int(np.floor(level * self.share * (1 + len(self.maxima)) + 1e-9)) - 1
        if allowed < 0:
            return np.full_like(quantile, np.inf)
        reached = quantile * np.exp(self.maxima[len(self.maxima) - 1 - allowed] * slope)
        return np.where(flat <= level * self.share, reached, np.inf)


def standard_errors(d: FloatArray) -> FloatArray:
    """Return the standard errors (m,) of the means of (m, n) values; 0 of values that differ by rounding alone."""
    error = d.std(axis=1, ddof=1) / np.sqrt(d.shape[1])
    return np.where(error <= SAME_WITHIN * np.maximum(1.0, np.abs(d).max(axis=1)), 0.0, error)


def studentised(distance: FloatArray, error: FloatArray) -> FloatArray:
    """Return distance/error (m,); without an error it is infinite, or 0 where there is no distance."""
    exact = np.where(distance > 0, np.inf, 0.0)
    return np.divide(distance, error, out=exact, where=error > 0)


def max_t(d: FloatArray, resamples: int = _RESAMPLES, seed: int = _SEED) -> MaxT:
    """Return the distribution of the largest |t| of (m, n) log ratios under means of 0, each on its own scale.

    Seeds are drawn with replacement, the same for all m, so that what is common to comparisons (a method, a seed)
    stays common. Of each resample b, with x centred::

        t_b = mean(x_b)/(s(x_b)/sqrt(n))        score_b = log(|t_b|/q)/h        maximum_b = max over m of score_b

    q is the value that 5 % of the mean's own |t_b| reach, h the mean of log(|t_b|/q) of these (Hill's estimator): on
    that scale every tail falls alike, and no mean whose t scatters widely sets the bar for the others. Without it one
    seed that lies apart, and is not drawn in a third of the resamples, does so for the whole study: in a study of 932
    comparisons over 20 seeds two of them raised the critical |t| from 5 to 27. A few seeds show too little of their
    own skewness: no q and no h is less than what 90 % of the family have. Constant rows add nothing.

    Sign flips would be exact for symmetric differences; of skewed ones they err in 17 % of studies of 60
    scenarios where this stays near 5 % (benchmarks/README.md).

    Source: Romano and Wolf, "Exact and approximate stepdown methods for multiple hypothesis testing", JASA 100 (2005);
    Beran, "Balanced simultaneous confidence sets", JASA 83 (1988); Hill, "A simple general approach to inference about
    the tail of a distribution", Ann. Statist. 3 (1975); Hall, "The Bootstrap and Edgeworth Expansion", Springer (1992),
    3.3 for studentising.
    """
    share = _shares(d.shape[1], resamples, seed)
    scattered = standard_errors(d) > 0
    rows = d[scattered]
    parts = [rows[start : start + _ROWS_AT_ONCE] for start in range(0, len(rows), _ROWS_AT_ONCE)]
    scales = np.concatenate([np.empty((3, 0)), *(_scales(_resampled(part, share)) for part in parts)], axis=1)
    known = np.isfinite(scales[0])
    if known.any():  # none is narrower than what COMMON of them have
        common = np.quantile(scales[:2, known], COMMON, axis=1, method="higher")
        scales[:2] = np.maximum(scales[:2], common[:, None])
    largest = np.where(share.max(axis=0) == 1.0, np.inf, -np.inf)  # resamples that have one seed only
    for place, part in enumerate(parts):
        t = _resampled(part, share)
        start = place * _ROWS_AT_ONCE
        scores = np.where(np.isfinite(t), _scores(t, scales[:, start : start + len(part), None]), -np.inf)
        # a resample without spread has the score of the largest of the others
        scores = np.where(np.isfinite(t), scores, scores.max(axis=1, keepdims=True))
        np.maximum(largest, scores.max(axis=0), out=largest)
    every = np.tile([[1.0], [1.0], [0.0]], len(d))  # the scales of constant rows are 1
    every[:, scattered] = scales
    return MaxT(every, np.sort(largest))


def _scores(t: FloatArray, scales: FloatArray) -> FloatArray:
    """Return how far out |t| is: log(t/quantile)/slope, alike for all tails."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(t / scales[0]) / scales[1], dtype=np.float64)


def _resampled(d: FloatArray, share: FloatArray) -> FloatArray:
    """Return |t| (k, B) of the resamples of the rows of (k, n), centred; infinite without spread."""
    centred = d - d.mean(axis=1, keepdims=True)
    centred /= np.sqrt(np.mean(centred**2, axis=1, keepdims=True))
    mean2 = (centred @ share) ** 2
    variance = (centred**2) @ share - mean2
    flat = variance < _FLAT
    ratio = np.divide((d.shape[1] - 1) * mean2, variance, out=mean2, where=~flat)
    ratio[flat] = np.inf
    return np.asarray(np.sqrt(ratio), dtype=np.float64)


def _scales(t: FloatArray) -> FloatArray:
    """Return the scales (3, k) of |t| (k, B); where more than the tail has no spread, the quantile is infinite."""
    flat = np.isinf(t)
    most = np.where(flat, 0.0, t).max(axis=1, keepdims=True)
    count = int(TAIL * (t.shape[1] + 1))
    tail = -np.partition(-np.minimum(t, most), count, axis=1)[:, : count + 1]
    quantile = tail.min(axis=1)
    slope = np.log(tail / quantile[:, None]).sum(axis=1) / count
    share = flat.mean(axis=1)
    return np.array([np.where(share > TAIL, np.inf, quantile), np.maximum(slope, STEEPEST), share])


@lru_cache(maxsize=4)
def _shares(n: int, resamples: int, seed: int) -> FloatArray:
    """Return the share (n, B) of each of n seeds in each resample."""
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=resamples)
    return np.ascontiguousarray(drawn.T / n)


# Exact tests of counts and medians: they hold whatever the distribution is, lost runs included.


def sign_p(for_a: int, for_b: int) -> float:
    """Return the two-sided p of so many seeds for either, ties left out: the exact binomial test of one half.

    Of seeds that either lost alone it is McNemar's exact test.

    Source: McNemar, "Note on the sampling error of the difference between correlated proportions", Psychometrika 12
    (1947).
    """
    from scipy.special import bdtr

    fewer, total = min(for_a, for_b), for_a + for_b
    return min(1.0, 2.0 * float(bdtr(fewer, total, 0.5))) if total else 1.0


def median_p(d: FloatArray) -> float:
    """Return the two-sided p that the median of (n,) is 0: the sign test in which a tie counts for either side.

    It is the one that the interval of order statistics inverts.
    """
    from scipy.special import bdtr

    return min(1.0, 2.0 * float(bdtr(min((d <= 0).sum(), (d >= 0).sum()), len(d), 0.5)))


# The p of a study's comparisons, corrected for all of them together.


class Family(NamedTuple):
    """The p of m comparisons, and what their intervals have to reach for the same verdicts.

    Attributes:
        p: (2, m) that a and b differ, and that either fails in more runs; NaN without a seed, and 1 of fewer than
            `LEAST_SEEDS`.
        critical: (m,) beyond which |t| on a mean differs; NaN of a median, and of fewer than `LEAST_SEEDS`.
        confidence: of the interval of a median.
    """

    p: FloatArray
    critical: FloatArray
    confidence: float


def family(comparisons: Sequence[LogRatios], level: float) -> Family:
    """Return the corrected p: by `max_t` of the means; Bonferroni for the exact tests, and between numbers of seeds."""
    total = max(1, sum(ratios.n >= LEAST_SEEDS for ratios in comparisons))
    exact = 2 * total  # of a comparison with lost runs there are two tests: of the errors, and of the losses
    p, critical = np.ones((2, len(comparisons))), np.full(len(comparisons), np.nan)
    for k, ratios in enumerate(comparisons):
        if ratios.n == 0:
            p[:, k] = np.nan
        elif not ratios.plain and ratios.n >= LEAST_SEEDS:
            failed = ratios.lost | ratios.locked
            p[:, k] = median_p(ratios.d), sign_p(*(failed & ~failed[:, ::-1]).sum(axis=0).tolist())
    p = np.minimum(1.0, exact * p)
    known = [k for k, ratios in enumerate(comparisons) if ratios.plain and ratios.n >= LEAST_SEEDS]
    for numbers, d in Samples.of([comparisons[k].d for k in known]).by_size():
        places, largest = np.array(known)[numbers], max_t(d)._replace(share=len(numbers) / total)
        t = studentised(np.abs(d.mean(axis=1)), standard_errors(d))
        p[0, places], critical[places] = largest.p(t), largest.critical(level)
    return Family(p, critical, 1 - level / exact)
