"""Two combinations that were compared: what was shown, at the level of the study."""

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jerkbench.evaluation.statistics.families import Correction
from jerkbench.evaluation.statistics.intervals import loss_bound, seeds_without_loss, up_to
from jerkbench.evaluation.statistics.judgement import LEVEL, NOT_EXCLUDED, Judgement, Verdict, judged
from jerkbench.evaluation.statistics.over_seeds import LogRatios
from jerkbench.evaluation.statistics.seeds import seeds_needed
from jerkbench.report.analysis.rule import RULE, Rule
from jerkbench.report.analysis.runs import Combination, Pair


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
    rule: Rule = RULE

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


def judged_pairs(pairs: Iterable[Pair], rule: Rule = RULE) -> list[Comparison]:
    """Judge the pairs as one family; phases of one recording are not independent and have a range instead."""
    pairs = list(pairs)
    seeds = [pair for pair in pairs if pair.replicate != "phase"]
    verdicts = iter(judged([pair.ratios for pair in seeds], rule.margin, rule.level, rule.correction))
    return [
        Comparison(pair, _of_phases(pair.ratios) if pair.replicate == "phase" else next(verdicts), len(seeds), rule)
        for pair in pairs
    ]


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
    return f"{marks} {test}{_undecided(tested)} Of each method {losses_of(one.judgement for one in tested)}."


def _undecided(tested: Sequence[Comparison]) -> str:
    """Say how many are undecided, where any is, and how many of them for losses that were not seen."""
    count = sum(comparison.verdict is Verdict.UNDECIDED for comparison in tested)
    if not count:
        return ""
    return f" Of the {len(tested)} here {count} {'is' if count == 1 else 'are'} undecided{not_excluded(tested)}."


def not_excluded(compared: Iterable[Comparison]) -> str:
    """Say how many would be equal but for losses that so few seeds do not exclude; nothing of none."""
    near = [one.rule.margin for one in compared if one.judgement.reason == NOT_EXCLUDED]
    if not near:
        return ""
    within, needed = f"{len(near)} of them within {100 * near[0]:g} %", seeds_without_loss(near[0])
    return f", {within}, as {NOT_EXCLUDED} ({needed} seeds without one would)"


def losses_of(judgements: Iterable[Judgement]) -> str:
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
