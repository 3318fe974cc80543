"""Two filters on the same seeds: by what factor they differ, how sure that is, and how often."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals import ROUNDING

FEWEST = 6
"""With fewer pairs Wilcoxon's smallest possible p is over 5 %: nothing can be shown, whatever the values are."""


@dataclass(frozen=True)
class PairedRatio:
    """How a compares with b over the same seeds.

    With d_i = log(a_i/b_i) over the n pairs of which both are finite and positive::

        ratio     = exp(mean d)                                    below 1: a is the smaller
        low, high = exp(mean d -+ t_{n-1} s_d/sqrt(n))             95 %
        p         = Wilcoxon's signed-rank test of d against 0     two-sided
        effect    = (W+ - W-)/(W+ + W-)                            matched-pairs rank-biserial correlation, -1 to 1

    Source: Kerby, "The simple difference formula", Comprehensive Psychology 3 (2014), for the effect.

    Attributes:
        ratio: geometric mean of a/b; NaN without a pair.
        low: lower end of its interval; NaN of fewer than two pairs.
        high: upper end.
        n: number of pairs.
        p: of the test; NaN without a pair. `holm` corrects it for the family.
        effect: -1: a is smaller in every pair, 1: larger in every pair.
    """

    ratio: float
    low: float
    high: float
    n: int
    p: float
    effect: float


def paired_ratio(a: npt.ArrayLike, b: npt.ArrayLike, confidence: float = 0.95) -> PairedRatio:
    """Compare (n,) values of a with those of b, of which the i-th belong to the same seed.

    The interval is Student's on the logarithms: it holds for as few as three pairs where the ratios scatter like a
    lognormal, which errors of the same drive under the same noise do (BCa needs about twenty).
    """
    d = _log_ratios(a, b)
    n = len(d)
    if n == 0:
        return PairedRatio(np.nan, np.nan, np.nan, 0, np.nan, np.nan)
    mean = float(np.mean(d))
    low, high = student_interval(d, confidence)
    return PairedRatio(float(np.exp(mean)), float(np.exp(low)), float(np.exp(high)), n, wilcoxon_p(d), effect(d))


def wilcoxon_p(d: FloatArray) -> float:
    """Return the two-sided p of Wilcoxon's signed-rank test that (n,) differences lie around 0."""
    from scipy.stats import wilcoxon

    d = d[d != 0]  # no sign, no rank: all equal is no difference
    return float(wilcoxon(d).pvalue) if len(d) else 1.0


def effect(d: FloatArray) -> float:
    """Return the matched-pairs rank-biserial correlation of (n,) differences; 0 where all are 0."""
    from scipy.stats import rankdata

    d = d[d != 0]
    ranks = rankdata(np.abs(d))
    return float(np.sum(np.sign(d) * ranks) / np.sum(ranks)) if len(d) else 0.0


def holm(p: Sequence[float]) -> FloatArray:
    """Return the p of a family of tests, adjusted so that 5 % are 5 % for all of them together; NaN is no member.

    With p_(1) <= ... <= p_(m), the adjusted p_(k) = max over j <= k of min(1, (m - j + 1) p_(j)).

    Source: Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statistics 6 (1979).
    """
    values = np.asarray(p, dtype=np.float64)
    adjusted = np.full_like(values, np.nan)
    members = np.flatnonzero(~np.isnan(values))
    order = members[np.argsort(values[members], kind="stable")]
    factors = np.arange(len(order), 0, -1)
    adjusted[order] = np.maximum.accumulate(np.minimum(1.0, factors * values[order]))
    return adjusted


def _log_ratios(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Return log(a/b) of the pairs that have one; what is but rounding is 0."""
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    fit = np.isfinite(first) & np.isfinite(second) & (first > 0) & (second > 0)
    d = np.log(first[fit]) - np.log(second[fit])
    return np.where(np.abs(first[fit] - second[fit]) <= ROUNDING * np.abs(second[fit]), 0.0, d)


def student_interval(d: FloatArray, confidence: float) -> tuple[float, float]:
    """Return the ends of Student's interval for the mean of ``d``; NaN of fewer than two."""
    from scipy.special import stdtrit

    n, mean = len(d), float(np.mean(d))
    if n < 2:
        return np.nan, np.nan
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * float(np.std(d, ddof=1)) / np.sqrt(n)
    return mean - half, mean + half


def unpaired_ratio(a: npt.ArrayLike, b: npt.ArrayLike, confidence: float = 0.95) -> PairedRatio:
    """Compare (n,) values with (m,) others of which no two belong together; ``n`` of the result is the smaller number.

    Ratio of the geometric means with Welch's interval on the logarithms, and the Mann-Whitney test; its effect is the
    rank-biserial correlation. Much less can be shown than with the same seeds.
    """
    from scipy.stats import mannwhitneyu, ttest_ind

    first, second = (np.log(_positive(one)) for one in (a, b))
    n = min(len(first), len(second))
    if n == 0:
        return PairedRatio(np.nan, np.nan, np.nan, 0, np.nan, np.nan)
    ratio = float(np.exp(first.mean() - second.mean()))
    if n < 2 or first.std() + second.std() == 0:
        return PairedRatio(ratio, np.nan, np.nan, n, np.nan, np.nan)
    ends = ttest_ind(first, second, equal_var=False).confidence_interval(confidence)
    test = mannwhitneyu(first, second)
    rank_biserial = 2 * float(test.statistic) / (len(first) * len(second)) - 1
    return PairedRatio(ratio, float(np.exp(ends.low)), float(np.exp(ends.high)), n, float(test.pvalue), rank_biserial)


def _positive(values: npt.ArrayLike) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    return array[np.isfinite(array) & (array > 0)]
