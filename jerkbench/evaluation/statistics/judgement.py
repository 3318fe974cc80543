"""Comparisons of one study: which are better, equal, worse, and which are undecided."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.families import LEAST_SEEDS, Correction, Family, family, standard_errors
from jerkbench.evaluation.statistics.intervals import loss_bound, losses_text, median_intervals
from jerkbench.evaluation.statistics.over_seeds import LogRatios, Samples, TwoSamples, middles

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

WINS = (Verdict.BETTER, Verdict.FEWER_LOST)
DEFEATS = (Verdict.WORSE, Verdict.MORE_LOST)
BY_LOSSES = (Verdict.FEWER_LOST, Verdict.MORE_LOST)

NOT_EXCLUDED = "losses are not excluded"
"""Equal but for runs that may be lost: so few seeds did not show them."""

FAILED_MORE = "the one with the smaller errors failed in more runs"


class Judgement(NamedTuple):
    """One comparison of a with b.

    Attributes:
        ratio: geometric mean of a/b; where runs were lost or locked out, the median.
        low: lower end of its interval at the level of the study, which decides; NaN of fewer than `LEAST_SEEDS`, and of
            a median of too few seeds for such a level.
        high: upper end; infinite where it reaches the lost runs.
        sizes: seeds of a, and of b: the same, or as many as each has of its own.
        p: that they differ, corrected for the study.
        p_lost: that either loses more runs, corrected for the study.
        failures: runs that a, and that b, lost or locked out in.
        median: whether ratio and test are those of the median.
        critical: how many standard errors of the mean of the logarithms the study asks for; NaN of a median.
        verdict: at the level of the study.
        reason: why it is undecided, although the interval would decide it; else empty.
    """

    ratio: float
    low: float
    high: float
    sizes: tuple[int, int]
    p: float
    p_lost: float
    failures: tuple[int, int]
    median: bool
    critical: float
    verdict: Verdict
    reason: str

    @property
    def n(self) -> int:
        """Seeds of the smaller sample."""
        return min(self.sizes)

    @property
    def turned(self) -> "Judgement":
        """That of b with a."""
        ratio, low, high = (1 / value if value else math.inf for value in (self.ratio, self.high, self.low))
        verdict = TURNED.get(self.verdict, self.verdict)
        return self._replace(
            ratio=ratio, low=low, high=high, failures=self.failures[::-1], sizes=self.sizes[::-1], verdict=verdict
        )

    @property
    def losses(self) -> str:
        """The runs that either lost or locked out in, with the bounds of their shares."""
        ours, theirs = map(losses_text, self.failures, self.sizes)
        return ours if ours == theirs else f"{ours} against {theirs}"


def judged(
    comparisons: Sequence[LogRatios],
    margin: float = MARGIN,
    level: float = LEVEL,
    correction: Correction = Correction.MAX_T,
) -> list[Judgement]:
    """Judge all comparisons of a study as one family.

    ::

        loses ...  McNemar's exact test of the runs that either alone lost or locked out in says so
        equal      the interval lies within 1/(1 + margin) to 1 + margin, and of either less than the margin of the
                   runs is lost or locked out (`loss_bound`, of each comparison by itself)
        better     the interval lies below 1; a failed in no more runs than b
        worse      better, turned round
        undecided  otherwise, and of fewer than `LEAST_SEEDS` seeds

    The intervals are at the level of the study: mean -+ c s/sqrt(n) of d = log(a/b), each with its own c of the scale
    that `max_t` finds common to all comparisons whose runs all went well. Where runs were lost or locked out, it is
    that of the median by order statistics, the inverse of the exact sign test (a lost run is worse than every other),
    with Bonferroni's correction for the study.

    Args:
        comparisons: of the whole study.
        margin: of equality.
        level: of studies with any wrong sentence; with `Correction.FDR`, of sentences.
        correction: which of the two.
    """
    tested = family(comparisons, correction, level)
    ends = intervals_of(comparisons, tested)
    return [
        judgement_of(ends[:, k], tested.p[:, k], ratios, tested.critical[k], margin, level)
        for k, ratios in enumerate(comparisons)
    ]


def judgement_of(
    interval: FloatArray, p: FloatArray, runs: LogRatios | TwoSamples, critical: float, margin: float, level: float
) -> Judgement:
    """Return the judgement with the first verdict that holds; each comparison with NaN is false.

    Args:
        interval: centre, lower and upper end of the log ratio, at the level of the study.
        p: that they differ, and that either loses more; corrected.
        runs: what was compared.
        critical: see `Judgement`.
        margin: of equality.
        level: of the study.
    """
    (centre, low, high), (differ, lost) = interval.tolist(), p.tolist()
    ours, theirs = runs.failures
    verdict, reason = Verdict.UNDECIDED, ""
    if lost < level:
        verdict = Verdict.MORE_LOST if ours > theirs else Verdict.FEWER_LOST
    elif -np.log1p(margin) < low and high < np.log1p(margin):
        excluded = max(map(loss_bound, runs.failures, runs.sizes)) < margin
        verdict, reason = (Verdict.EQUAL, "") if excluded else (verdict, NOT_EXCLUDED)
    elif differ < level and (ours - theirs) * centre < 0:
        reason = FAILED_MORE
    elif differ < level:
        verdict = Verdict.BETTER if centre < 0 else Verdict.WORSE
    with np.errstate(over="ignore"):  # few seeds in a large study: an interval beyond all numbers
        ratio, low, high = np.exp(interval).tolist()
    failures, critical = runs.failures, float(critical)
    return Judgement(ratio, low, high, runs.sizes, differ, lost, failures, not runs.plain, critical, verdict, reason)


def intervals_of(comparisons: Sequence[LogRatios], tested: Family) -> FloatArray:
    """Return (3, m) centres and ends of the log ratios: of means where every run went well, else of medians."""
    ends = np.full((3, len(comparisons)), np.nan)
    for places, d in Samples.of([ratios.d for ratios in comparisons]).by_size():
        plain = np.array([comparisons[k].plain for k in places.tolist()], dtype=bool)
        if d.shape[1]:
            # of means: without scatter centre and ends are one, if any |t| is enough
            centre, critical = d[plain].mean(axis=1), tested.critical[places[plain]]
            with np.errstate(invalid="ignore"):
                reach = critical * standard_errors(d[plain]) if d.shape[1] > 1 else np.full(len(centre), np.nan)
                half = np.where(np.isinf(critical), np.inf, reach)
            ends[:, places[plain]] = centre, centre - half, centre + half
            ordered = np.sort(d[~plain], axis=1)  # some may be infinite
            ends[0, places[~plain]] = middles(ordered)
            if d.shape[1] >= LEAST_SEEDS:
                ends[1:, places[~plain]] = median_intervals(ordered, tested.confidence, exact=True)
    return ends
