"""The verdict on two methods: from the errors on common seeds to log ratios, tests, an interval, and a word."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.intervals import (
    EQUAL_WITHIN,
    OUTLIER_FACTOR,
    failure_bound,
    failures_text,
    median_intervals,
    quantiles,
)
from jerkbench.evaluation.max_t import max_t, standard_errors, studentised
from jerkbench.evaluation.over_seeds import MIN_SEEDS, Samples

MARGIN = 0.03
"""Ratios from 1/1.03 to 1.03 are equal for every practical purpose."""

LEVEL = 0.05
"""At most this fraction of studies contains any false statement."""

MEDIAN_FACTOR = 3.0
"""If the medians differ by more than this factor, the method is called better, not only failing in fewer runs."""

MAX_FACTOR = 1000.0
"""An interval that contains 1 and exceeds this factor on both sides has no information and is not reported."""


@dataclass(frozen=True, eq=False)
class LogRatios:
    """The log ratios d_i = log(a_i/b_i) of the errors of two methods on the seeds that both have.

    Attributes:
        d: (n,) infinite if only the run of a failed, minus infinite if only the run of b failed, 0 if both failed.
        failed: (n, 2) whether the run of a, and the run of b, diverged or failed.
    """

    d: FloatArray
    failed: BoolArray

    @property
    def n(self) -> int:
        """Number of common seeds."""
        return len(self.d)

    @cached_property
    def outlying(self) -> BoolArray:
        """(n, 2) whether the error of a is more than `OUTLIER_FACTOR` times the error of b, and the reverse.

        All False if every ratio is within `OUTLIER_FACTOR` times the median ratio: then no run is an exception.
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
        """Whether no run failed and no run is an outlier, so that the mean of d describes the runs."""
        return bool(np.isfinite(self.d).all()) and not (self.failed | self.outlying).any()

    @property
    def swapped(self) -> "LogRatios":
        """The log ratios of b to a."""
        return LogRatios(-self.d, self.failed[:, ::-1])


def log_ratios(a: npt.ArrayLike, b: npt.ArrayLike) -> LogRatios:
    """Return the log ratios of the errors (n,) of a to the errors (n,) of b on the same seeds.

    An infinite error is a failed run. Seeds with an error that is NaN (the metric does not apply) or negative are left
    out. Errors that differ only by rounding are equal.
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
    """Return the two-sided p of the sign test (binomial test of 1/2), without ties.

    For seeds on which only one of two methods failed, it is McNemar's exact test.

    Source: McNemar, "Note on the sampling error of the difference between correlated proportions", Psychometrika 12
    (1947).
    """
    from scipy.special import bdtr  # scipy.stats takes half a second to import, in the first table too

    fewer, total = min(for_a, for_b), for_a + for_b
    return min(1.0, 2.0 * float(bdtr(fewer, total, 0.5))) if total else 1.0


def median_p(d: FloatArray) -> float:
    """Return the two-sided p of the sign test that the median of (n,) values is 0; a tie counts for both sides.

    `median_intervals` inverts this test.
    """
    from scipy.special import bdtr

    return min(1.0, 2.0 * float(bdtr(min((d <= 0).sum(), (d >= 0).sum()), len(d), 0.5)))


class Verdict(StrEnum):
    """The statement about a against b, at the level of the study."""

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
"""The verdict on b against a; the other verdicts are symmetric."""

WINS = (Verdict.BETTER, Verdict.FEWER_FAILED)
DEFEATS = (Verdict.WORSE, Verdict.MORE_FAILED)
BY_FAILURES = (Verdict.FEWER_FAILED, Verdict.MORE_FAILED)

NOT_EXCLUDED = "rare failures cannot be excluded"
"""Reason for "undecided": the errors are equal, but so few seeds do not show rare failures."""

FAILED_MORE = "the method with the smaller errors failed in more runs"
"""Reason for "undecided": errors and failures contradict each other."""


class Judgement(NamedTuple):
    """The comparison of a with b on their common seeds.

    Attributes:
        ratio: geometric mean of a/b; if runs failed or are outliers, the median.
        low: lower end of the interval of the ratio at the level of the study; the interval decides. NaN for fewer than
            `MIN_SEEDS`, for a median of too few seeds for this level, and if the interval exceeds `MAX_FACTOR`.
        high: upper end; infinite if it reaches the failed runs.
        n: number of common seeds.
        p: p value of a difference of the errors, corrected for the study.
        p_failed: p value of a difference of the failure rates (outliers are failures), corrected for the study.
        failed: number of runs of a, and of b, that diverged or failed.
        outlying: number of runs of a, and of b, that are outliers; see `LogRatios`.
        median: whether the ratio and its test are those of the median.
        critical: critical number of standard errors of the mean log ratio; NaN for a median.
        verdict: at the level of the study.
        reason: why the verdict is "undecided" although the interval would decide; otherwise empty.
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
        """Number of runs of a, and of b, that failed or are outliers."""
        return self.failed[0] + self.outlying[0], self.failed[1] + self.outlying[1]

    @property
    def swapped(self) -> "Judgement":
        """The comparison of b with a."""
        ratio, low, high = (1 / value if value else math.inf for value in (self.ratio, self.high, self.low))
        verdict = SWAPPED.get(self.verdict, self.verdict)
        failed, outlying = self.failed[::-1], self.outlying[::-1]
        return self._replace(ratio=ratio, low=low, high=high, failed=failed, outlying=outlying, verdict=verdict)

    @property
    def failure_rates(self) -> str:
        """The failed runs and outliers of both methods, with the bounds of their rates."""
        ours, theirs = (failures_text(*of, self.n) for of in zip(self.failed, self.outlying, strict=True))
        return ours if ours == theirs else f"{ours} against {theirs}"


def judged(comparisons: Sequence[LogRatios], margin: float = MARGIN, level: float = LEVEL) -> list[Judgement]:
    """Judge all comparisons of a study as one family; the first verdict that applies is returned.

    ::

        fails ...   McNemar's exact test of the runs in which only one of the two failed is significant, unless the sign
                    test of the errors says "better" or "worse" by more than `MEDIAN_FACTOR` times
        small ...   the interval lies within 1/(1 + margin) to 1 + margin and excludes 1
        equal       the interval lies within these limits and contains 1, and the failure rate of each method is below
                    the margin (`failure_bound`, for each comparison by itself)
        better      the interval lies below 1, and a failed in no more runs than b
        worse       the interval lies above 1, and b failed in no more runs than a
        undecided   otherwise, and for fewer than `MIN_SEEDS` seeds

    The intervals are simultaneous for the study. If no run failed, the interval is mean -+ c s/sqrt(n) of d = log(a/b),
    with the c that `max_t` computes for each of these comparisons. Otherwise it is the interval of the median by order
    statistics, the inverse of the exact sign test (a failed run is worse than any other), with Bonferroni's correction
    for the study. Outliers count as failures.

    Args:
        comparisons: all comparisons of the study.
        margin: of equality.
        level: fraction of studies with any false statement.
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
                exact = 2 * count  # two tests for each comparison: of the errors and of the failures
                ((low,), (high,)) = median_intervals(ordered, 1 - level / exact, exact=True)
                failed = ratios.failed | ratios.outlying
                alone = (failed & ~failed[:, ::-1]).sum(axis=0).tolist()
                p, p_failed = min(1.0, exact * median_p(ratios.d)), min(1.0, exact * sign_p(*alone))
        judgements.append(_judgement(ratios, (centre, float(low), float(high)), (p, p_failed), critical, margin, level))
    return judgements


def _tests_of_means(comparisons: Sequence[LogRatios], level: float, count: int) -> dict[int, tuple[float, ...]]:
    """Return p, the critical |t| and the half width of the interval for each comparison without failures.

    Comparisons with the same number of seeds are one family of `max_t`; each family gets its part of the level.
    """
    numbers = [k for k, ratios in enumerate(comparisons) if ratios.plain and ratios.n >= MIN_SEEDS]
    tests: dict[int, tuple[float, ...]] = {}
    for places, d in Samples.of([comparisons[k].d for k in numbers]).by_size():
        part, family, error = len(places) / count, max_t(d), standard_errors(d)
        p = np.minimum(1.0, family.p(studentised(np.abs(d.mean(axis=1)), error)) / part)
        critical = family.critical(level * part)
        half = np.multiply(critical, error, out=np.full_like(error, np.inf), where=np.isfinite(critical))
        found = zip(p.tolist(), critical.tolist(), half.tolist(), strict=True)
        tests |= zip((numbers[place] for place in places), found, strict=True)
    return tests


def _judgement(
    ratios: LogRatios,
    interval: tuple[float, float, float],
    p_values: tuple[float, float],
    critical: float,
    margin: float,
    level: float,
) -> Judgement:
    """Return the first verdict that applies; each comparison with NaN is false."""
    (centre, low, high), (p, p_failed) = interval, p_values
    failed, outlying = ((int(of[:, 0].sum()), int(of[:, 1].sum())) for of in (ratios.failed, ratios.outlying))
    ours, theirs = failed[0] + outlying[0], failed[1] + outlying[1]
    side, more_failed = np.sign(centre), failed[0] - failed[1]  # a method that fails more often is not called better
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
