"""Verdicts at the level of a study: which methods are better, how many seeds that needs, which are consistent."""

import itertools
import math
from collections.abc import Sequence
from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.families import Family, family, standard_errors
from jerkbench.evaluation.intervals import failures_text, loss_bound, median_intervals, student_interval
from jerkbench.evaluation.over_seeds import FEW, LEAST_SEEDS, LogRatios, Samples, mean_interval, middles

MARGIN = 0.03
"""Ratios from 1/1.03 to 1.03 are equal for every practical purpose."""

LEVEL = 0.05
"""At most so many studies have a sentence that is wrong."""


class Verdict(StrEnum):
    """What was shown of a against b, at the level of the whole study."""

    BETTER = "better"
    EQUAL = "equal"
    SMALL = "small difference"
    WORSE = "worse"
    FEWER_FAILED = "fails in fewer runs"
    MORE_FAILED = "fails in more runs"
    UNDECIDED = "undecided"


TURNED = {
    Verdict.BETTER: Verdict.WORSE,
    Verdict.WORSE: Verdict.BETTER,
    Verdict.FEWER_FAILED: Verdict.MORE_FAILED,
    Verdict.MORE_FAILED: Verdict.FEWER_FAILED,
}
"""Verdicts as the other side sees them; the others are the same from both sides."""

WINS = (Verdict.BETTER, Verdict.FEWER_FAILED)
DEFEATS = (Verdict.WORSE, Verdict.MORE_FAILED)
BY_FAILURES = (Verdict.FEWER_FAILED, Verdict.MORE_FAILED)

NOT_EXCLUDED = "losses are not excluded"
"""Equal but for runs that may be lost: so few seeds did not show them."""

FAILED_MORE = "the method with the smaller errors was lost or locked out in more runs"

MEDIAN_FACTOR = 3.0
"""A method that is better in the median by more than this is better, and does not only fail in fewer runs."""

MAX_FACTOR = 1000.0
"""An interval that holds 1 and reaches further to both sides says nothing, and is not given."""


class Judgement(NamedTuple):
    """One comparison of a with b on their common seeds.

    Attributes:
        ratio: geometric mean of a/b; where runs were lost or locked out, the median.
        low: lower end of its interval at the level of the study, which decides; NaN of fewer than `LEAST_SEEDS`, of a
            median of too few seeds for such a level, and where the interval would be wider than `MAX_FACTOR`.
        high: upper end; infinite where it reaches the lost runs.
        n: seeds that both have.
        p: that they differ, corrected for the study.
        p_failed: that either is lost or locked out in more runs, corrected for the study.
        lost: runs that a, and that b, lost.
        locked: runs that a, and that b, locked out in; see `LogRatios`.
        median: whether ratio and test are those of the median.
        critical: how many standard errors of the mean of the logarithms the study asks for; NaN of a median.
        verdict: at the level of the study.
        reason: why it is undecided, although the interval would decide it; else empty.
    """

    ratio: float
    low: float
    high: float
    n: int
    p: float
    p_failed: float
    lost: tuple[int, int]
    locked: tuple[int, int]
    median: bool
    critical: float
    verdict: Verdict
    reason: str

    @property
    def failures(self) -> tuple[int, int]:
        """Runs that a, and that b, lost or locked out in."""
        return self.lost[0] + self.locked[0], self.lost[1] + self.locked[1]

    @property
    def turned(self) -> "Judgement":
        """That of b with a."""
        ratio, low, high = (1 / value if value else math.inf for value in (self.ratio, self.high, self.low))
        verdict = TURNED.get(self.verdict, self.verdict)
        lost, locked = self.lost[::-1], self.locked[::-1]
        return self._replace(ratio=ratio, low=low, high=high, lost=lost, locked=locked, verdict=verdict)

    @property
    def losses(self) -> str:
        """The runs that either lost or locked out in, with the bounds of their shares."""
        ours, theirs = (failures_text(*of, self.n) for of in zip(self.lost, self.locked, strict=True))
        return ours if ours == theirs else f"{ours} against {theirs}"


def judged(comparisons: Sequence[LogRatios], margin: float = MARGIN, level: float = LEVEL) -> list[Judgement]:
    """Judge all comparisons of a study as one family.

    ::

        fails ...   McNemar's exact test of the runs that either alone lost or locked out in says so, unless the sign
                    test says "better" or "worse" by more than `MEDIAN_FACTOR` times
        small ...   the interval lies within 1/(1 + margin) to 1 + margin, and excludes 1
        equal       it lies within them and holds 1, and of either less than the margin of the runs is lost or locked
                    out (`loss_bound`, of each comparison by itself)
        better      the interval lies below 1; a was lost or locked out in no more runs than b
        worse       better, turned round
        undecided   otherwise, and of fewer than `LEAST_SEEDS` seeds

    The intervals are at the level of the study: mean -+ c s/sqrt(n) of d = log(a/b), each with its own c of the scale
    that `max_t` finds common to all comparisons whose runs all went well. Where runs were lost or locked out, it is
    that of the median by order statistics, the inverse of the exact sign test (a lost run is worse than every other),
    with Bonferroni's correction for the study.

    Args:
        comparisons: of the whole study.
        margin: of equality.
        level: of studies with any wrong sentence.
    """
    tested = family(comparisons, level)
    ends = intervals_of(comparisons, tested)
    return [
        judgement_of(ends[:, k], tested.p[:, k], ratios, tested.critical[k], margin, level)
        for k, ratios in enumerate(comparisons)
    ]


def judgement_of(
    interval: FloatArray, p: FloatArray, runs: LogRatios, critical: float, margin: float, level: float
) -> Judgement:
    """Return the judgement with the first verdict that holds; each comparison with NaN is false.

    Args:
        interval: centre, lower and upper end of the log ratio, at the level of the study.
        p: that they differ, and that either fails in more runs; corrected.
        runs: what was compared.
        critical: see `Judgement`.
        margin: of equality.
        level: of the study.
    """
    (centre, low, high), (differ, failed) = interval.tolist(), p.tolist()
    lost, locked = ((int(of[:, 0].sum()), int(of[:, 1].sum())) for of in (runs.lost, runs.locked))
    ours, theirs = lost[0] + locked[0], lost[1] + locked[1]
    decides = differ < level and (ours - theirs) * centre >= 0
    verdict, reason = Verdict.UNDECIDED, ""
    if failed < level and not (decides and np.log(MEDIAN_FACTOR) < abs(centre) < np.inf):
        verdict = Verdict.MORE_FAILED if ours > theirs else Verdict.FEWER_FAILED
    elif -np.log1p(margin) < low and high < np.log1p(margin):
        excluded = max(loss_bound(ours, runs.n), loss_bound(theirs, runs.n)) < margin
        if differ < level:
            verdict = Verdict.SMALL
        else:
            verdict, reason = (Verdict.EQUAL, "") if excluded else (verdict, NOT_EXCLUDED)
    elif decides:
        verdict = Verdict.BETTER if centre < 0 else Verdict.WORSE
    elif differ < level:
        reason = FAILED_MORE
    if low < -np.log(MAX_FACTOR) and high > np.log(MAX_FACTOR):
        low = high = np.nan
    with np.errstate(over="ignore"):
        ratio, low, high = np.exp([centre, low, high]).tolist()
    return Judgement(
        *(ratio, low, high, runs.n, differ, failed, lost, locked), not runs.plain, float(critical), verdict, reason
    )


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


# Seeds: how many a verdict needs, looks at more of them, a choice judged on others.


POWER = 0.8
"""So likely is it, at least, that so many seeds decide."""

CAUTION = 0.8
"""The scatter that is planned with is larger than the true one in so many cases."""

_MOST = 10_000
"""More seeds than these nobody runs: none are named."""


def seeds_needed(d: FloatArray, comparisons: int = 1, level: float = 0.05, critical: float = np.nan) -> int | None:
    """Return how many seeds show that a and b differ; None where they may be equal, and over `_MOST`.

    Of N seeds the mean falls at mu + s Z/sqrt(N), and decides where it is more than c standard errors from 0. The
    answer is the smallest N, of the grid 1.05^k, that does so with a probability of at least `POWER` wherever in the
    95 % interval of the mean that was seen mu lies; an interval with 0 in it has none. s is the upper `CAUTION` bound
    of the standard deviation, c that of `critical_t`, as many times as large as ``critical`` is of theirs: a study
    whose comparisons go together asks for less, a heavy tail for more.

    Args:
        d: (n,) log ratios of the seeds that went well; at least two.
        comparisons: of the whole study.
        level: of the whole study.
        critical: |t| that the n seeds had to reach; without it, or where none is enough, that of `critical_t`.
    """
    from scipy.special import chdtri, ndtri, stdtrit

    n, s, mean = len(d), float(np.std(d, ddof=1)), abs(float(d.mean()))
    nearest = mean - float(stdtrit(n - 1, 0.975)) * s / np.sqrt(n)
    if nearest <= 0:
        return None
    if np.ptp(d) == 0:
        return n
    sizes = _sizes()
    sizes = sizes[sizes > n]
    planned = critical_t(np.append(n, sizes), comparisons, level)
    c = planned[1:] * (critical / planned[0] if np.isfinite(critical) else 1.0)
    error = s * np.sqrt((n - 1) / chdtri(n - 1, CAUTION)) / np.sqrt(sizes)
    enough = np.flatnonzero(nearest / error - c >= ndtri(POWER))
    return int(sizes[enough[0]]) if len(enough) else None


def critical_t(n: FloatArray, comparisons: int, level: float) -> FloatArray:
    """Return about how large the critical |t| of `max_t` is for (k,) numbers of seeds and normal log ratios.

    Bonferroni's Student quantile, wider by 1 + (8 + 7 log m)/n^2: fitted to the bootstrap's of 6 to 50 seeds and
    1 to 180 comparisons, to plan with; no verdict uses it.
    """
    from scipy.special import stdtrit

    wider = 1 + (8 + 7 * np.log(comparisons)) / n**2
    return np.asarray(stdtrit(n - 1, 1 - level / (2 * comparisons)) * wider, dtype=np.float64)


@lru_cache(maxsize=1)
def _sizes() -> FloatArray:
    return np.unique(np.ceil(6 * 1.05 ** np.arange(np.ceil(np.log(_MOST / 6) / np.log(1.05)))))


# Seeds added in blocks until everything is decided: the level that each look at the results may spend.

FIRST = 20
"""Seeds before the first look: fewer decide little, as the bootstrap of many comparisons is wide."""


def looks(most: int, first: int = FIRST) -> list[int]:
    """Return the numbers of seeds at which one looks: ``first``, twice as many each time, ``most`` at the end.

    >>> looks(400)
    [20, 40, 80, 160, 320, 400]
    """
    doubled = (first << k for k in itertools.count())
    return [*itertools.takewhile(lambda size: size < most, doubled), most]


def levels(sizes: list[int], level: float = 0.05) -> FloatArray:
    """Return the level (k,) of each look at ``sizes`` seeds; together they spend ``level`` and no more.

    With t the share of the seeds of the last look, alpha(t) = level log(1 + (e - 1) t) is spent by each look; its own
    level is what the look adds. The sum, not the joint distribution of the looks, holds the level: that is valid for
    the largest of many comparisons as well, of which different ones may be the largest at different looks.

    Source: Lan and DeMets, "Discrete sequential boundaries for clinical trials", Biometrika 70 (1983), Pocock's type.
    """
    t = np.asarray(sizes, dtype=np.float64) / sizes[-1]
    return np.diff(level * np.log1p((np.e - 1) * t), prepend=0.0)


# The winner's curse: what the best of several settings is worth on seeds that did not choose it.


def chosen_on_other_seeds(errors: FloatArray) -> IntArray:
    """Return (n,) which of k settings the other seeds choose for each seed, by (k, n) errors.

    The lowest mean log is the best; a setting with fewer lost (infinite) runs goes before. Of one seed there is no
    other: it chooses for itself.

    Source: Stone, "Cross-validatory choice and assessment of statistical predictions", JRSS B 36 (1974).
    """
    lost = np.isinf(errors)
    logs = np.log(np.where(lost, 1.0, np.maximum(errors, np.finfo(float).tiny)))
    lost_by, total, count = (of.sum(axis=1, keepdims=True) for of in (lost, logs, ~lost))
    if errors.shape[1] < 2:
        return _best(lost_by, total, count)
    return _best(lost_by - lost, total - logs, count - ~lost)


def _best(lost: FloatArray, total: FloatArray, count: FloatArray) -> IntArray:
    """Return (n,) the setting with the fewest lost runs, and of these the lowest mean log."""
    mean = total / np.maximum(1, count)
    candidates = np.where(lost == lost.min(axis=0), mean, np.inf)
    return np.asarray(np.argmin(candidates, axis=0), dtype=np.int64)


# NEES and NIS against chi-square: the band in which the average of a consistent filter lies, and the verdict.


_CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN = "consistent", "overconfident", "too cautious", "not known"

NEAR = (0.5, 2.0)
"""An average over its expectation within these is near enough to be believed."""


def chi2_band(dof: float, samples: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return the band of the average of ``samples`` independent chi-square values of ``dof`` degrees each.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """
    from scipy.stats import chi2

    low, high = chi2.ppf([(1 - confidence) / 2, (1 + confidence) / 2], dof * samples) / samples
    return float(low), float(high)


def runs_verdict(averages: npt.ArrayLike, expected: float, confidence: float = 0.95, lost: int = 0) -> str:
    """Judge (n,) averages of independent runs by the interval of their mean; of one run nothing is known.

    ::

        overconfident   the whole interval is above ``expected``
        too cautious    the whole interval is below it
        consistent      the interval holds it, and lies within 0.5 to 2 times it
        not known       the interval holds it, and more: to reject nothing is no proof

    From 5 runs on the interval is that of `mean_interval`; of fewer it is Student's on the logarithms. That one is of
    the geometric mean, which is at most the mean: what is above ``expected`` is all the more so. The runs that were
    ``lost``, or have no finite average, were none of the consistent ones: of the others only "overconfident" holds.
    """
    values = np.asarray(averages, dtype=np.float64)
    kept = values[np.isfinite(values)]
    low = high = np.nan
    if len(kept) >= FEW:
        _, low, high, _ = mean_interval(kept, confidence)
    elif len(kept) > 1 and kept.min() > 0:
        low, high = np.exp(student_interval(np.log(kept), confidence))
    if low > expected:
        return OVERCONFIDENT
    if lost + len(values) > len(kept):
        return UNKNOWN
    if high < expected:  # each comparison with NaN is false
        return CAUTIOUS
    return _CONSISTENT if NEAR[0] * expected <= low and high <= NEAR[1] * expected else UNKNOWN
