"""Comparisons of one study: which are better, equal, worse, and which are undecided."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals.median import median_intervals
from jerkbench.evaluation.statistics.intervals.student import student_intervals
from jerkbench.evaluation.statistics.log_ratio import LogRatios
from jerkbench.evaluation.statistics.multiplicity import Correction, Family, family
from jerkbench.evaluation.statistics.samples import Samples

MARGIN = 0.03
"""Ratios from 1/1.03 to 1.03 are equal for every practical purpose."""

LEVEL = 0.05
"""At most so many studies have a sentence that is wrong."""


class Verdict(StrEnum):
    """What was shown of a against b, at the level of the whole study."""

    BETTER = "better"
    EQUAL = "equal"
    WORSE = "worse"
    FEWER_LOST = "loses fewer runs"
    MORE_LOST = "loses more runs"
    UNDECIDED = "undecided"


TURNED = {
    Verdict.BETTER: Verdict.WORSE,
    Verdict.WORSE: Verdict.BETTER,
    Verdict.FEWER_LOST: Verdict.MORE_LOST,
    Verdict.MORE_LOST: Verdict.FEWER_LOST,
}
"""Verdicts as the other side sees them; equal and undecided are the same from both."""


@dataclass(frozen=True)
class Judgement:
    """One comparison of a with b.

    Attributes:
        ratio: geometric mean of a/b; where runs were lost or locked out, the median.
        low: lower end of its own 95 % interval (Student's on the logarithms; of the median, that of order statistics).
        high: upper end; infinite where it reaches the lost runs.
        n: seeds.
        p: that they differ, corrected for the study.
        p_equal: that they are not equal within the margin, corrected for the study.
        p_lost: that either loses more runs, corrected for the study.
        failures: runs that a, and that b, lost or locked out in.
        median: whether ratio and test are those of the median.
        critical: how many standard errors of the mean of the logarithms the study asks for; NaN of a median.
        verdict: at the level of the study.
    """

    ratio: float
    low: float
    high: float
    n: int
    p: float
    p_equal: float
    p_lost: float
    failures: tuple[int, int]
    median: bool
    critical: float
    verdict: Verdict

    @property
    def turned(self) -> "Judgement":
        """That of b with a."""
        ratio, low, high = (1 / value if value else math.inf for value in (self.ratio, self.high, self.low))
        verdict = TURNED.get(self.verdict, self.verdict)
        return replace(self, ratio=ratio, low=low, high=high, failures=self.failures[::-1], verdict=verdict)


def judged(
    comparisons: Sequence[LogRatios],
    margin: float = MARGIN,
    level: float = LEVEL,
    correction: Correction = Correction.MAX_T,
) -> list[Judgement]:
    """Judge all comparisons of a study as one family.

    ::

        loses ...  McNemar's exact test of the runs that either alone lost or locked out in says so
        equal      the interval at the study's level lies within 1/(1 + margin) to 1 + margin; where either failed in
                   more runs, the share in which either failed alone is less than the margin as well
        better     it lies below 1, and so does the comparison's own; a failed in no more runs than b
        worse      better, turned round
        undecided  otherwise, and of fewer than `LEAST_SEEDS` seeds

    The intervals at the study's level are mean -+ c s/sqrt(n) of d = log(a/b), each with its own c of the scale that
    `max_t` finds common to all comparisons whose runs all went well. Where runs were lost or locked out, the median is
    tested instead, by the exact sign test (a lost run is worse than every other), with Bonferroni's correction for the
    study.

    Args:
        comparisons: of the whole study.
        margin: of equality.
        level: of studies with any wrong sentence; with `Correction.FDR`, of sentences.
        correction: which of the two.
    """
    tested = family(comparisons, float(np.log1p(margin)), correction, level)
    intervals = intervals_of(comparisons)
    return [_judgement(ratios, intervals[place], tested, place, level) for place, ratios in enumerate(comparisons)]


def _judgement(
    ratios: LogRatios, interval: tuple[float, float, float], tested: Family, place: int, level: float
) -> Judgement:
    centre, low, high = interval
    p, p_equal, p_lost = (float(values[place]) for values in (tested.differ, tested.equal, tested.lost))
    return Judgement(
        ratio=float(np.exp(centre)),
        low=float(np.exp(low)),
        high=float(np.exp(high)),
        n=ratios.n,
        p=p,
        p_equal=p_equal,
        p_lost=p_lost,
        failures=ratios.failures,
        median=not ratios.plain,
        critical=float(tested.critical[place]),
        verdict=verdict_of(ratios.failures, (centre, low, high), (p, p_equal, p_lost), level),
    )


def verdict_of(
    failures: tuple[int, int], interval: tuple[float, float, float], p: tuple[float, float, float], level: float
) -> Verdict:
    """Return the first verdict that holds; each comparison with NaN is false.

    Args:
        failures: runs that a, and that b, lost or locked out in.
        interval: centre, lower and upper end of the log ratio.
        p: that they differ, that they are not equal, that either loses more; corrected.
        level: of the study.
    """
    centre, low, high = interval
    differ, equal, lost = p
    ours, theirs = failures
    if lost < level:
        return Verdict.MORE_LOST if ours > theirs else Verdict.FEWER_LOST
    if equal < level:
        return Verdict.EQUAL
    if differ < level and not low <= 0 <= high and (ours - theirs) * centre >= 0:
        return Verdict.BETTER if centre < 0 else Verdict.WORSE
    return Verdict.UNDECIDED


def intervals_of(comparisons: Sequence[LogRatios]) -> list[tuple[float, float, float]]:
    """Return centre and ends of each log ratio: of its mean where every run went well, else of its median."""
    ends = np.full((len(comparisons), 3), np.nan)
    plain = np.array([ratios.plain for ratios in comparisons], dtype=bool)
    for of_kind, interval in ((np.flatnonzero(plain), _of_means), (np.flatnonzero(~plain), _of_medians)):
        for places, d in Samples.of([comparisons[k].d for k in of_kind.tolist()]).by_size():
            if d.shape[1]:
                ends[of_kind[places]] = np.column_stack(interval(d))
    return [(centre, low, high) for centre, low, high in ends.tolist()]


def _of_means(d: FloatArray) -> tuple[FloatArray, ...]:
    """Centre and ends, (k,) each, of (k, n) log ratios."""
    return d.mean(axis=1), *student_intervals(d, 0.95)


def _of_medians(d: FloatArray) -> tuple[FloatArray, ...]:
    """Likewise, of values that may be infinite."""
    ordered = np.sort(d, axis=1)
    return middles(ordered), *median_intervals(ordered, 0.95)


def middle(ordered: FloatArray) -> float:
    """Return the median of (n,) values in ascending order; between an infinite one and another, the infinite."""
    return float(middles(ordered[None])[0])


def middles(ordered: FloatArray) -> FloatArray:
    """Return what `middle` gives for each row of (k, n) values."""
    left, right = ordered[:, (ordered.shape[1] - 1) // 2], ordered[:, ordered.shape[1] // 2]
    with np.errstate(invalid="ignore"):
        mean = np.where(np.isinf(right), right, (left + right) / 2)
    return np.asarray(np.where(np.isinf(left), left, mean))
