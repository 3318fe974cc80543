"""Scenario by scenario: how every two methods compare, and which lead."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jerkbench.evaluation.statistics.families import Correction
from jerkbench.evaluation.statistics.intervals import loss_bound, seeds_without_loss, up_to
from jerkbench.evaluation.statistics.judgement import LEVEL, NOT_EXCLUDED, Judgement, Verdict, judged
from jerkbench.evaluation.statistics.over_seeds import LogRatios
from jerkbench.evaluation.statistics.seeds import seeds_needed
from jerkbench.report.analysis.columns import FACTORS
from jerkbench.report.analysis.runs import RULE, Combination, Pair, VerdictRule


@dataclass(frozen=True, eq=False)
class Comparison:
    """One combination against another.

    Attributes:
        pair: what was compared.
        judgement: ratio, interval and verdict at the level of the study; of phases of one recording ``low`` and
            ``high`` are the smallest and the largest ratio, and there is no p and no verdict.
        family: how many comparisons the study has.
        rule: how they were judged.
    """

    pair: Pair
    judgement: Judgement
    family: int
    rule: VerdictRule = RULE

    @property
    def subject(self) -> Combination:
        """Values of the six factors."""
        return self.pair.subject

    @property
    def baseline(self) -> Combination:
        """Values of the six factors of what it is compared with."""
        return self.pair.baseline

    @property
    def replicate(self) -> str:
        """Either "seed" or "phase"."""
        return self.pair.replicate

    @property
    def verdict(self) -> Verdict:
        """At the level of the study."""
        return self.judgement.verdict

    @property
    def shown(self) -> bool:
        """Whether a difference was shown."""
        return self.verdict not in {Verdict.EQUAL, Verdict.UNDECIDED}

    @property
    def turned(self) -> "Comparison":
        """The same, as the baseline sees it."""
        return dataclasses.replace(self, pair=self.pair.turned, judgement=self.judgement.turned)

    @property
    def mark(self) -> str:
        """A star where a difference was shown, "=" where the two are equal."""
        return "*" if self.shown else "=" if self.verdict is Verdict.EQUAL else ""

    @cached_property
    def needed(self) -> int | None:
        """How many seeds would show the difference of what is undecided; None where none would, or losses hinder."""
        ratios, judgement = self.pair.ratios, self.judgement
        open_ = self.verdict is Verdict.UNDECIDED and not judgement.reason and self.replicate != "phase"
        if not open_ or not ratios.plain or ratios.n < 2:
            return None
        return seeds_needed(ratios.d, max(1, self.family), self.rule.level, judgement.critical)


def judged_pairs(pairs: Iterable[Pair], rule: VerdictRule = RULE) -> list[Comparison]:
    """Judge the pairs as one family; phases of one recording are not independent and have a range instead."""
    pairs = list(pairs)
    seeds = [pair for pair in pairs if pair.replicate != "phase"]
    verdicts = iter(judged([pair.ratios for pair in seeds], rule.margin, rule.level, rule.correction))
    compared = [
        Comparison(pair, _of_phases(pair.ratios) if pair.replicate == "phase" else next(verdicts), len(seeds), rule)
        for pair in pairs
    ]
    return [_floored(one) if one.pair.below_floor else one for one in compared]


BELOW_FLOOR = "the reference is not known so well"


def _floored(comparison: Comparison) -> Comparison:
    """The same without a verdict: the two differ by less than the reference's own sigma."""
    judgement = dataclasses.replace(comparison.judgement, verdict=Verdict.UNDECIDED, reason=BELOW_FLOOR)
    return dataclasses.replace(comparison, judgement=judgement)


def family_note(comparisons: Sequence[Comparison]) -> str:
    """Say what the marks mean, and how many comparisons are undecided."""
    tested = [comparison for comparison in comparisons if comparison.replicate != "phase" and comparison.judgement.n]
    if not tested:
        return "Without seeds there is no test of a difference."
    rule, family = tested[0].rule, max(comparison.family for comparison in tested)
    marks = f"*: a difference was shown; =: equal within {100 * rule.margin:g} %."
    if rule.correction is Correction.FDR:
        test = f"Of the marks 5 % may be wrong (Benjamini and Hochberg over the study's {family} comparisons)."
    else:
        test = (
            f"At most 5 % of such studies have any wrong mark (largest studentised mean log ratio of all {family} "
            "comparisons, bootstrap over the seeds)."
        )
    if rule.level < LEVEL:
        test += f" Seeds were added in blocks: the last look spends {100 * rule.level:.2g} of these 5 %."
    return f"{marks} {test}{_undecided(tested)} Of each method {losses_range(one.judgement for one in tested)}."


def _undecided(tested: Sequence[Comparison]) -> str:
    """Say how many are undecided, where any is, and how many of them for losses that were not seen."""
    count = sum(comparison.verdict is Verdict.UNDECIDED for comparison in tested)
    if not count:
        return ""
    floored = sum(comparison.pair.below_floor for comparison in tested)
    why = f", {floored} of them because they differ by less than the reference's own sigma" if floored else ""
    return f" Of the {len(tested)} here {count} {'is' if count == 1 else 'are'} undecided{not_excluded(tested)}{why}."


def not_excluded(compared: Iterable[Comparison]) -> str:
    """Say how many would be equal but for losses that so few seeds do not exclude; nothing of none."""
    near = [one.rule.margin for one in compared if one.judgement.reason == NOT_EXCLUDED]
    if not near:
        return ""
    within, needed = f"{len(near)} of them within {100 * near[0]:g} %", seeds_without_loss(near[0])
    return f", {within}, as {NOT_EXCLUDED} ({needed} seeds without one would)"


def losses_range(judgements: Iterable[Judgement]) -> str:
    """Say how many runs methods lost or locked out in, the fewest and the most, with the largest bound."""
    runs = {of for one in judgements for of in zip(one.failures, one.sizes, strict=True)}
    counts, sizes = (
        f"{min(of)}" if min(of) == max(of) else f"{min(of)} to {max(of)}" for of in zip(*runs, strict=True)
    )
    return f"{counts} of {sizes} lost ({up_to(*max(runs, key=lambda of: loss_bound(*of)))})"


def _of_phases(ratios: LogRatios) -> Judgement:
    """Return the geometric mean, or with lost runs the median, with the range, and no test."""
    (judgement,) = judged([ratios])
    low, high = (np.exp(ratios.d.min()), np.exp(ratios.d.max())) if ratios.n > 1 else (np.nan, np.nan)
    return dataclasses.replace(
        judgement, low=float(low), high=float(high), p=np.nan, p_lost=np.nan, verdict=Verdict.UNDECIDED, reason=""
    )


# The leaders of each group of rivals: those whom nobody was shown to beat.


@dataclass(frozen=True, eq=False)
class Contest:
    """A group of rivals.

    Attributes:
        rivals: their combinations.
        leaders: those whom nobody was shown to beat.
        comparisons: of every two.
    """

    rivals: tuple[Combination, ...]
    leaders: tuple[Combination, ...]
    comparisons: tuple[Comparison, ...]

    @property
    def decided(self) -> bool:
        """Whether the leaders are fewer than the rivals: else nothing was shown."""
        return 0 < len(self.leaders) < len(self.rivals)


def contest(rivals: Sequence[Combination], comparisons: Iterable[Comparison]) -> Contest:
    """Return who leads of ``rivals``; nobody does where nothing was compared."""
    comparisons = tuple(comparisons)
    beaten = {_loser(comparison) for comparison in comparisons}
    leaders = tuple(rival for rival in rivals if rival not in beaten) if comparisons else ()
    return Contest(tuple(rivals), leaders, comparisons)


def _loser(comparison: Comparison) -> Combination | None:
    """Return who was shown to be worse, or to lose more runs."""
    if comparison.verdict in {Verdict.BETTER, Verdict.FEWER_LOST}:
        return comparison.baseline
    return comparison.subject if comparison.shown else None


# Scenario by scenario: which methods lead, and how every two of them compare.

UNTESTED = "Nothing is tested: the runs have no seeds, and those of one recording are not independent."

MOST_PAIRS = 50_000
"""More comparisons than these take minutes, and show little."""


@dataclass(frozen=True, eq=False)
class Standing:
    """One scenario.

    Attributes:
        scenario: values of the factors that make it, of those that vary.
        method: factors that make a method, of those that vary.
        contest: who leads.
    """

    scenario: tuple[str, ...]
    method: tuple[str, ...]
    contest: Contest

    def name(self, combination: Combination) -> str:
        """Return the name of a method."""
        values = dict(zip(FACTORS, combination, strict=True))
        return "+".join(values[key] for key in self.method)

    @property
    def leaders(self) -> list[str]:
        """Names of those whom nobody was shown to beat."""
        return [self.name(leader) for leader in self.contest.leaders]


def verdict_sentences(standings: Sequence[Standing]) -> list[str]:
    """Return in sentences who leads how often, and how many pairs of methods are what."""
    decided = [standing for standing in standings if standing.contest.decided]
    compared = [pair for standing in standings for pair in standing.contest.comparisons if pair.judgement.n]
    verdicts = Counter(pair.verdict for pair in compared if pair.replicate != "phase")
    if compared and not verdicts:
        return [UNTESTED]
    if not verdicts:
        many = any(len(standing.contest.rivals) > 1 and not standing.contest.comparisons for standing in standings)
        return [f"Who leads is not tested: there are more than {MOST_PAIRS} pairs of methods."] if many else []
    return [*_leading(decided, len(standings)), _counts(verdicts, standings)]


def _leading(decided: Sequence[Standing], scenarios: int) -> list[str]:
    """Say who leads in which number of scenarios."""
    if not decided:
        return ["Nobody leads: no method was shown to be worse than another, which does not mean that they are equal."]
    counts = Counter(name for standing in decided for name in standing.leaders)
    if scenarios == 1:
        return [f"In the lead: {', '.join(counts)}."]
    told = ", ".join(f"{name} in {count}" for name, count in counts.most_common(5))
    more = f", and {len(counts) - 5} others in fewer" if len(counts) > 5 else ""
    return [f"In the lead, of {scenarios} scenarios: {told}{more}."]


def _counts(verdicts: "Counter[Verdict]", standings: Sequence[Standing]) -> str:
    """Say how many pairs are decided, equal and undecided."""
    total = verdicts.total()
    equal, undecided = verdicts[Verdict.EQUAL], verdicts[Verdict.UNDECIDED]
    lost = verdicts[Verdict.FEWER_LOST] + verdicts[Verdict.MORE_LOST]
    tested = [pair for standing in standings for pair in standing.contest.comparisons]
    parts = [
        (total - equal - undecided - lost, "differ"),
        (lost, "differ in the runs they lose"),
        (equal, f"are equal within {100 * tested[0].rule.margin:g} %"),
        (undecided, f"are undecided{not_excluded(tested)}"),
    ]
    told = ", ".join(f"{count} {words}" for count, words in parts if count)
    return f"Of {total} pairs of methods {told}; of each method {losses_range(pair.judgement for pair in tested)}."
