"""Scenario by scenario: which methods lead, and how every two of them compare."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.comparison import losses_of, not_excluded
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.leading import Contest
from jerkbench.report.analysis.runs import Combination

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


def summary(standings: Sequence[Standing]) -> list[str]:
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
    return f"Of {total} pairs of methods {told}; of each method {losses_of(pair.judgement for pair in tested)}."
