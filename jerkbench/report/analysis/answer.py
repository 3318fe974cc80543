"""Two methods over all scenarios: in how many one beats the other, and by how much."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from jerkbench.evaluation.statistics.judgement import Judgement, Verdict
from jerkbench.report.analysis.columns import FACTORS
from jerkbench.report.analysis.runs import Combination
from jerkbench.report.analysis.standings import UNTESTED, Comparison, Standing, losses_range
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


# The answer of a study in one sentence, about what it varies: who leads where, and who beats whom how often.

NAMED = 3
"""So many leaders are named."""


def answer(standings: Sequence[Standing]) -> str:
    """Return one sentence about the methods of a study, over all its scenarios."""
    tested = [standing for standing in standings if _tests(standing)]
    if not tested:
        return _untested(standings)
    methods = {standing.name(rival) for standing in tested for rival in standing.contest.rivals}
    words = _of_two(tested) if len(methods) == 2 else _of_many(tested, len(methods))
    return f"{words}; {_seeds(tested)}."


def shows_something(standings: Iterable[Standing]) -> bool:
    """Whether any two methods were shown to differ, or to be equal."""
    return any(pair.verdict is not Verdict.UNDECIDED for standing in standings for pair in _tests(standing))


def _tests(standing: Standing) -> list[Comparison]:
    return [pair for pair in standing.contest.comparisons if pair.replicate != "phase" and pair.judgement.n]


def _untested(standings: Sequence[Standing]) -> str:
    if not any(len(standing.contest.rivals) > 1 for standing in standings):
        return "There is one method, and nothing to compare it with."
    if not any(standing.contest.comparisons for standing in standings):
        return "Who leads is not tested: there are too many pairs of methods."
    return UNTESTED


def _of_two(tested: Sequence[Standing]) -> str:
    (duel,) = duels(tested)
    if duel.scenarios == 1:
        return _once(duel, tested[0])
    counts = [(duel.count(Verdict.EQUAL), "equal in"), (duel.count(Verdict.UNDECIDED), "undecided in")]
    rest = [f"{words} {count}" for count, words in counts if count]
    if not duel.won + duel.lost:
        rest[0] += f" of {duel.scenarios} scenarios"
        return f"No difference between {duel.ours} and {duel.theirs} was shown: {', '.join(rest)}"
    won = f"{duel.ours} beats {duel.theirs} in {duel.won} of {duel.scenarios} scenarios"
    return ", ".join([won, f"loses in {duel.lost or 'none'}", *rest])


def _once(duel: Duel, standing: Standing) -> str:
    (only,) = duel.rounds
    if only.verdict is Verdict.EQUAL:
        return f"{duel.ours} and {duel.theirs} are equal within {_margin(standing)}"
    if only.verdict is Verdict.UNDECIDED:
        return f"No difference between {duel.ours} and {duel.theirs} was shown"
    return f"{duel.ours} beats {duel.theirs}: {only.words}"


def _of_many(tested: Sequence[Standing], methods: int) -> str:
    decided = [standing for standing in tested if standing.contest.decided]
    if not decided:
        return _of_none(tested, methods)
    counts = Counter(name for standing in decided for name in standing.leaders)
    most = max(counts.values())
    leaders = [name for name, count in counts.items() if count == most]
    verb = "leads" if len(leaders) == 1 else "lead"
    if len(tested) == 1:
        who = "it" if len(leaders) == 1 else "them"
        return f"Of {methods} methods {_named(leaders)} {verb}: nobody was shown to beat {who}"
    places = f"in {most} of {len(tested)} scenarios, beaten in {len(decided) - most or 'none'}"
    nobody = f", nobody leads in {len(tested) - len(decided)}" if len(decided) < len(tested) else ""
    baseline = _against_the_baseline(tested, leaders[0])
    return f"Of {methods} methods {_named(leaders)} {verb} most often: {places}{nobody}{baseline}"


def _of_none(tested: Sequence[Standing], methods: int) -> str:
    if all(pair.verdict is Verdict.EQUAL for standing in tested for pair in _tests(standing)):
        return f"All {methods} methods are equal within {_margin(tested[0])}"
    where = f" in any of {len(tested)} scenarios" if len(tested) > 1 else ""
    return f"None of {methods} methods was shown to beat another{where}"


def _against_the_baseline(tested: Sequence[Standing], leader: str) -> str:
    """Say how often the leader beats the baseline without adaptation, where that is there and another."""
    baselines = {
        standing.name(rival) for standing in tested for rival in standing.contest.rivals if _is_baseline(rival)
    }
    for duel in duels(tested):
        seen = duel if duel.ours == leader else duel.turned
        if seen.ours == leader and seen.theirs in baselines and seen.won + seen.lost:
            return f"; {leader} beats {seen.theirs} in {seen.won or 'none'}, loses in {seen.lost or 'none'}"
    return ""


def _is_baseline(rival: Combination) -> bool:
    values = dict(zip(FACTORS, rival, strict=True))
    return values["filter"] == "baseline" and values["adaptation"] == "none"


def _margin(standing: Standing) -> str:
    return f"{100 * _tests(standing)[0].rule.margin:g} %"


def _named(names: Sequence[str]) -> str:
    if len(names) > NAMED:
        return f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _seeds(tested: Sequence[Standing]) -> str:
    judgements = [pair.judgement for standing in tested for pair in _tests(standing)]
    low, high = (of(judgement.n for judgement in judgements) for of in (min, max))
    return f"{low if low == high else f'{low} to {high}'} seeds, {losses_range(judgements)}"
