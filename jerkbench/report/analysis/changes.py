"""Two sets of results: what became better or worse, combination by combination."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import JerkbenchError, NotComparableError
from jerkbench.evaluation.statistics.families import Correction
from jerkbench.evaluation.statistics.judgement import Judgement, Verdict
from jerkbench.evaluation.statistics.over_seeds import two_samples
from jerkbench.evaluation.statistics.seeds import judged_on_other_seeds
from jerkbench.report.analysis.columns import Combination, checked, quantity
from jerkbench.report.analysis.runs import RULE, MethodRuns, VerdictRule, on_common_seeds, runs_by_combination
from jerkbench.report.analysis.standings import Standing, compare_runs
from jerkbench.report.tables.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


BeforeAfter = tuple[MethodRuns, MethodRuns]
"""The runs of a combination in the first set, and in the second."""


class Change(NamedTuple):
    """One combination in two sets of results.

    Attributes:
        combination: values of the six factors (in the first set).
        means: geometric (arithmetic where a value is 0), of the runs that went well, in both sets.
        judgement: second over first, at the level of all combinations on the same seeds, or of all on others.
        rule: how it was judged.
        paired: whether the seeds match.
        phases: whether they are phases of one recording, which are no test.
        same: whether every value is the same to the bit.
        runs: in both sets.
        lost: runs that diverged or failed, in both sets.
        valued: runs that went well and have the metric, in both sets.
        common: runs of both that went well, where the seeds match; on others of that which has fewer.
        absent: runs of the first set that the second does not have, where the seeds match.
        risen: on the same seeds, how many went up from a value of which there is no ratio (0, or below).
    """

    combination: Combination
    means: tuple[float, float]
    judgement: Judgement
    rule: VerdictRule
    paired: bool
    phases: bool
    same: bool
    runs: tuple[int, int]
    lost: tuple[int, int]
    valued: tuple[int, int]
    common: int
    absent: int = 0
    risen: int = 0

    def worse(self, percent: float) -> bool:
        """Whether the second is worse by more than ``percent``, or has the metric of a smaller share of its runs.

        On the same seeds any change is one; on others only what the whole interval says, where there is one.
        """
        limit = 1 + percent / 100
        ratio, low = self.judgement.ratio, self.judgement.low
        least = ratio if self.paired or math.isnan(low) else low
        fewer = self.valued[1] * self.runs[0] < self.valued[0] * self.runs[1]
        return bool((self.common and least > limit) or self.risen or fewer)

    @property
    def unjudged(self) -> bool:
        """Whether the second cannot be said to be as good: it lacks runs, or no run of both has a value."""
        return bool(self.absent or (not self.same and not self.common))

    @property
    def verdict(self) -> str:
        """In a few words."""
        if self.same:
            return "the same to the bit"
        if self.risen and not self.judgement.n:
            return "worse (it was 0)"
        if not self.common:
            return "no run of both to compare"
        if self.phases:
            return "no test (phases of one recording)"
        equal = self.judgement.verdict is Verdict.EQUAL
        words = self.rule.equal if equal else self.judgement.verdict.value
        words += f", as {self.judgement.reason}" if self.judgement.reason else ""
        return words if self.paired else f"{words} (other seeds)"

    @property
    def losses(self) -> str:
        """The runs that either lost, with the bounds of their shares; nothing of phases, and without a run of both."""
        return "" if self.phases or not self.judgement.n else self.judgement.losses


def changes(before: "pd.DataFrame", after: "pd.DataFrame", metric: str, rule: VerdictRule = RULE) -> list[Change]:
    """Compare the combinations that both sets have; where each has a single one, these two, whatever they are called.

    Raises:
        JerkbenchError: nothing is in both, or of this metric the lowest is not the best.
    """
    if not quantity(metric).lowest_is_best:
        raise JerkbenchError(f"Of {metric} neither the lowest nor the highest is the best; compare another metric.")
    first, second = (runs_by_combination(checked(rows, metric), metric) for rows in (before, after))
    both = [(first[key], second[key]) for key in first if key in second]
    if not both and len(first) == len(second) == 1:
        both = list(zip(first.values(), second.values(), strict=True))
    if not both:
        raise NotComparableError(
            f"No combination of the {len(first)} of the first is among the {len(second)} of the second."
        )
    return [_change(two, judgement, rule) for two, judgement in zip(both, _judgements(both, rule), strict=True)]


def _judgements(both: Sequence[BeforeAfter], rule: VerdictRule) -> list[Judgement]:
    """Return those on the same seeds as one family, and those on others as another."""
    same = iter(compare_runs(((b, a) for a, b in both if _match(a, b)), rule))
    samples = [two_samples(b.errors, a.errors) for a, b in both if not _match(a, b)]
    others = iter(judged_on_other_seeds(samples, rule.margin, rule.level))
    return [next(same).judgement if _match(a, b) else next(others) for a, b in both]


def _match(first: MethodRuns, second: MethodRuns) -> bool:
    return len(np.intersect1d(first.seeds, second.seeds)) > 0


def _change(two: BeforeAfter, judgement: Judgement, rule: VerdictRule) -> Change:
    seeds_match = _match(*two)
    first, second = on_common_seeds(*two) if seeds_match else two
    well = [np.where(runs.lost, np.nan, runs.errors) for runs in (first, second)]
    valued = [np.isfinite(values) for values in well]
    return Change(
        combination=first.combination,
        means=(_average(well[0]), _average(well[1])),
        judgement=judgement,
        rule=rule,
        paired=seeds_match,
        phases=first.phases,
        same=seeds_match
        and bool(np.array_equal(well[0], well[1], equal_nan=True) and (first.lost == second.lost).all()),
        runs=(len(well[0]), len(well[1])),
        lost=(int(first.lost.sum()), int(second.lost.sum())),
        valued=(int(valued[0].sum()), int(valued[1].sum())),
        common=int((valued[0] & valued[1]).sum()) if seeds_match else min(int(of.sum()) for of in valued),
        absent=len(two[0].seeds) - len(first.seeds),
        risen=int(np.sum((well[1] > well[0]) & (well[0] <= 0))) if seeds_match else 0,
    )


def change_rows(changed: Sequence[Change], varying: Sequence[str]) -> list[list[str]]:
    """Return a line of texts for each change: the factors, both means, the ratio, its interval, losses, the verdict."""
    rows = []
    for change in changed:
        judgement, texts = change.judgement, [getattr(change.combination, key) for key in varying]
        for mean, runs, lost in zip(change.means, change.runs, change.lost, strict=True):
            text = number(mean) if math.isfinite(mean) else "n/a"
            texts.append(f"{text} ({lost}/{runs} lost)" if lost else text)
        known = change.common and 0 < judgement.ratio < math.inf
        interval = f"[{factor_number(judgement.low)}, {factor_number(judgement.high)}]"
        texts += [f"×{factor_number(judgement.ratio)}" if known else ""]  # noqa: RUF001
        texts += [interval if change.common and math.isfinite(judgement.low) else "", change.losses, change.verdict]
        rows.append(texts)
    return rows


def _average(values: FloatArray) -> float:
    """The geometric mean of what is finite, as the ratio is one; arithmetic where a value has no logarithm."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan
    return float(np.exp(np.mean(np.log(known)))) if (known > 0).all() else float(np.mean(known))


# The sentences below two sets of results: how they were judged, and where others lead.

ON_THE_SAME = (
    "On the same seeds: at most 5 % of such sets have any wrong verdict (largest studentised mean log ratio of "
    "{count}, bootstrap over the seeds)."
)
BY_SENTENCE = "On the same seeds: of the verdicts 5 % may be wrong (Benjamini and Hochberg over {count})."
ON_OTHERS = (
    "On other seeds: at most 5 % of such sets have any wrong verdict (largest studentised difference of the mean "
    "logarithms of {count}, bootstrap over the seeds of A and those of B); they show much less than the same seeds."
)


def notes_of_tests(changed: Iterable[Change]) -> list[str]:
    """Return by what test the verdicts on the same seeds were found, and by what those on others."""
    tested = [change for change in changed if not change.phases]
    same, others = ([change for change in tested if change.paired is paired] for paired in (True, False))
    by_sentence = bool(same) and same[0].rule.correction is Correction.FDR
    families = ((BY_SENTENCE if by_sentence else ON_THE_SAME, same), (ON_OTHERS, others))
    return [words.format(count=len(family)) for words, family in families if family]


def other_leaders(first: Sequence[Standing], second: Sequence[Standing]) -> list[str]:
    """Return a sentence for each scenario of both sets in which others lead in the second."""
    before = {standing.scenario: standing.leaders for standing in first if standing.decided}
    notes = []
    for standing in second:
        leaders = before.get(standing.scenario)
        if leaders is None or not standing.decided or set(leaders) == set(standing.leaders):
            continue
        where = f"On {', '.join(standing.scenario)}" if standing.scenario else "In the lead"
        notes.append(f"{where}: {', '.join(leaders)} in A, {', '.join(standing.leaders)} in B.")
    return notes
