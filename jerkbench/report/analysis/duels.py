"""Two methods over all scenarios: in how many one beats the other, and by how much."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from jerkbench.evaluation.statistics.judgement import Judgement, Verdict
from jerkbench.report.analysis.comparison import Comparison
from jerkbench.report.analysis.standings import Standing
from jerkbench.report.tables.table_model import factor_number

WON = (Verdict.BETTER, Verdict.FEWER_LOST)
LOST = (Verdict.WORSE, Verdict.MORE_LOST)

ALL_LOST = math.log(100.0)
"""A method that loses every run, beside one that loses none, weighs as much as one that is 100 times worse."""


@dataclass(frozen=True)
class Round:
    """One scenario, as the first of two methods sees it.

    Attributes:
        scenario: its name; empty where there is only one.
        judgement: of the first over the second.
    """

    scenario: str
    judgement: Judgement

    @property
    def verdict(self) -> Verdict:
        """On the first method."""
        return self.judgement.verdict

    @property
    def turned(self) -> "Round":
        """The same, as the second sees it."""
        return Round(self.scenario, self.judgement.turned)

    @property
    def weight(self) -> float:
        """What is certain of the difference: the log ratio at that end of its interval that is nearest to none."""
        of = self.judgement
        if self.verdict in {Verdict.FEWER_LOST, Verdict.MORE_LOST}:
            return ALL_LOST * abs(of.failures[0] - of.failures[1]) / of.n
        if self.verdict not in {Verdict.BETTER, Verdict.WORSE}:
            return 0.0
        ends = (abs(math.log(end)) for end in (of.low, of.high) if 0 < end < math.inf)
        return min(ends, default=ALL_LOST)  # the median run of one is lost: no size, and nothing uncertain

    @property
    def words(self) -> str:
        """The size of a difference that was shown."""
        if self.verdict in {Verdict.FEWER_LOST, Verdict.MORE_LOST}:
            ours, theirs = self.judgement.failures
            return f"{ours} of {self.judgement.n} runs lost or locked out against {theirs}"
        better = self.verdict is Verdict.BETTER
        seen, word = (self.judgement.turned, "better") if better else (self.judgement, "worse")
        if not 0 < seen.ratio < math.inf:
            return f"{word}, as the median run of the one is lost"
        times, low, high = map(factor_number, (seen.ratio, seen.low, seen.high))
        return f"{times} times {word}, 95 % {low} to {high}"


@dataclass(frozen=True)
class Duel:
    """Two methods over all scenarios that have both.

    Attributes:
        ours: name of the first, which beats the second at least as often as it is beaten.
        theirs: name of the second.
        rounds: one a scenario.
    """

    ours: str
    theirs: str
    rounds: tuple[Round, ...]

    @property
    def scenarios(self) -> int:
        """How many there are."""
        return len(self.rounds)

    @property
    def won(self) -> int:
        """In how many the first beats the second."""
        return sum(bout.verdict in WON for bout in self.rounds)

    @property
    def lost(self) -> int:
        """In how many the second beats the first."""
        return sum(bout.verdict in LOST for bout in self.rounds)

    @property
    def weight(self) -> float:
        """The mean over the scenarios of what is certain of the difference."""
        return sum(bout.weight for bout in self.rounds) / self.scenarios

    @property
    def turned(self) -> "Duel":
        """The same with the second as the first."""
        return Duel(self.theirs, self.ours, tuple(bout.turned for bout in self.rounds))

    def count(self, verdict: Verdict) -> int:
        """Return in how many scenarios this is the verdict on the first."""
        return sum(bout.verdict is verdict for bout in self.rounds)


def duels(standings: Iterable[Standing]) -> list[Duel]:
    """Return every two methods that were compared, over all scenarios; phases of one recording are no test."""
    rounds: dict[tuple[str, str], list[Round]] = {}
    for standing in standings:
        for pair in standing.contest.comparisons:
            if pair.replicate != "phase" and pair.judgement.n:
                names = standing.name(pair.subject), standing.name(pair.baseline)
                turned = (names[1], names[0]) in rounds
                seen = round_of(pair, ", ".join(standing.scenario))
                rounds.setdefault(names[::-1] if turned else names, []).append(seen.turned if turned else seen)
    pairings = [Duel(ours, theirs, tuple(seen)) for (ours, theirs), seen in rounds.items()]
    return [duel.turned if duel.lost > duel.won else duel for duel in pairings]


def round_of(pair: Comparison, scenario: str = "") -> Round:
    """Return a comparison as its subject sees it."""
    return Round(scenario, pair.judgement)
