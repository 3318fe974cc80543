"""Two methods over all scenarios: in how many one beats the other, and by how much."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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


# The answer of a study: a title that says who won and by how much, and what it rests on in up to three sentences.

NAMED = 3
"""So many leaders are named."""


@dataclass(frozen=True)
class Answer:
    """What a study says about its methods.

    Attributes:
        title: who won, and by how much.
        sentences: where, where not, and over how many runs.
    """

    title: str
    sentences: tuple[str, ...] = ()


def answer(standings: Sequence[Standing]) -> Answer:
    """Return what a study says about its methods, over all its scenarios."""
    tested = [standing for standing in standings if tested_pairs(standing)]
    if not tested:
        return Answer(_untested(standings))
    methods = {standing.name(rival) for standing in tested for rival in standing.contest.rivals}
    said = _of_two(tested) if len(methods) == 2 else _of_many(tested, len(methods))
    return Answer(said.title, (*said.sentences, _basis(tested)))


def shows_something(standings: Iterable[Standing]) -> bool:
    """Whether any two methods were shown to differ, or to be equal."""
    return any(pair.verdict is not Verdict.UNDECIDED for standing in standings for pair in tested_pairs(standing))


def tested_pairs(standing: Standing) -> list[Comparison]:
    """Return the comparisons of a scenario that a test has judged: phases of one recording are none."""
    return [pair for pair in standing.contest.comparisons if pair.replicate != "phase" and pair.judgement.n]


def _untested(standings: Sequence[Standing]) -> str:
    if not any(len(standing.contest.rivals) > 1 for standing in standings):
        return "There is one method, and nothing to compare it with."
    if not any(standing.contest.comparisons for standing in standings):
        return "Who leads is not tested: there are too many pairs of methods."
    return UNTESTED


def _of_two(tested: Sequence[Standing]) -> Answer:
    (duel,) = duels(tested)
    if duel.scenarios == 1:
        return _once(duel, tested[0])
    if duel.won + duel.lost:
        return Answer(f"{duel.ours} beats {duel.theirs} in {duel.won} of {duel.scenarios} scenarios", _rounds(duel))
    return Answer(f"No difference between {duel.ours} and {duel.theirs} was shown", _rounds(duel))


def _once(duel: Duel, standing: Standing) -> Answer:
    (only,) = duel.rounds
    if only.verdict is Verdict.EQUAL:
        return Answer(f"{duel.ours} and {duel.theirs} are equal within {_margin(standing)}")
    if only.verdict is Verdict.UNDECIDED:
        return Answer(f"No difference between {duel.ours} and {duel.theirs} was shown")
    return Answer(f"{duel.ours} beats {duel.theirs}: {only.words}")


def _of_many(tested: Sequence[Standing], methods: int) -> Answer:
    decided = [standing for standing in tested if standing.contest.decided]
    if not decided:
        return Answer(_of_none(tested, methods))
    counts = Counter(name for standing in decided for name in standing.leaders)
    most, reference = max(counts.values()), reference_of(tested)
    compared = [against(standing, reference) for standing in tested]
    leaders = sorted(
        (name for name, count in counts.items() if count == most), key=lambda name: mean_log_ratio(compared, name)
    )
    verb = "leads" if len(leaders) == 1 else "lead"
    where = f" in {most} of {len(tested)} scenarios" if len(tested) > 1 else ""
    title = f"Of {methods} methods {named(leaders)} {verb}{where}"
    duel = next((duel for duel in duels(tested) if {duel.ours, duel.theirs} == {leaders[0], reference}), None)
    sentences = [f"No difference between methods was shown on {named(open_)}."] if (open_ := _open(tested)) else []
    if duel and duel.won + duel.lost:
        duel = duel if duel.ours == leaders[0] else duel.turned
        title += _by_how_much(duel, alone=len(leaders) == 1)
        sentences = [*_rounds(duel), *sentences]
    return Answer(title, tuple(sentences))


def _by_how_much(duel: Duel, *, alone: bool) -> str:
    """Say how much better the first of two methods is at most; nothing where it is nowhere better."""
    best = max(duel.rounds, key=lambda bout: bout.weight if bout.verdict is Verdict.BETTER else -1.0)
    times = best.judgement.turned.ratio
    if best.verdict is not Verdict.BETTER or not 0 < times < math.inf:
        return ""
    who = " and is" if alone else f"; {duel.ours} is"
    return f"{who} {'up to ' if duel.scenarios > 1 else ''}{factor_number(times)} times better than {duel.theirs}"


def _open(tested: Iterable[Standing]) -> list[str]:
    """Return the scenarios in which no difference was shown."""
    return [", ".join(standing.scenario) for standing in tested if not standing.contest.decided]


def _of_none(tested: Sequence[Standing], methods: int) -> str:
    if all(pair.verdict is Verdict.EQUAL for standing in tested for pair in tested_pairs(standing)):
        return f"All {methods} methods are equal within {_margin(tested[0])}"
    where = f" in any of {len(tested)} scenarios" if len(tested) > 1 else ""
    return f"None of {methods} methods was shown to beat another{where}"


def reference_of(tested: Iterable[Standing]) -> str:
    """Return the method that others are held against.

    Of those that most scenarios have: the baseline without adaptation, else the first without, else the first.
    """
    names: dict[str, list[Combination]] = {}
    for standing in tested:
        for rival in standing.contest.rivals:
            names.setdefault(standing.name(rival), []).append(rival)
    return max(names, key=lambda name: (len(names[name]), *_plain(names[name][0])))


def _plain(rival: Combination) -> tuple[bool, bool]:
    values = dict(zip(FACTORS, rival, strict=True))
    return values["filter"] == "baseline" and values["adaptation"] == "none", values["adaptation"] == "none"


def against(standing: Standing, reference: str) -> dict[str, Comparison]:
    """Return each method's comparison with the reference in a scenario."""
    of: dict[str, Comparison] = {}
    for pair in tested_pairs(standing):
        ours, theirs = standing.name(pair.subject), standing.name(pair.baseline)
        if theirs == reference:
            of[ours] = pair
        elif ours == reference:
            of[theirs] = pair.turned
    return of


def mean_log_ratio(compared: Iterable[Mapping[str, Comparison]], name: str) -> float:
    """Return the mean over scenarios of a method's log ratio to the reference: 0 of that, infinite where it is lost."""
    ratios = [of[name].judgement.ratio for of in compared if name in of]
    return sum(math.log(ratio) if ratio > 0 else 0.0 for ratio in ratios) / max(1, len(ratios))


def _rounds(duel: Duel) -> tuple[str, ...]:
    """Say in which scenarios the first is better, worse, equal or undecided, with the largest certain difference."""
    return (f"{duel.ours} against {duel.theirs}: {'; '.join(verdict_counts(duel))}.",)


def verdict_counts(duel: Duel) -> list[str]:
    """Return each verdict with its number of scenarios, and the scenario where it is most certain.

    For example "better in 2 of 3 scenarios (most on none: 2.0 times better, 95 % 1.9 to 2.1)", "undecided in 1".
    """
    told: list[str] = []
    for verdict, words in WORDS.items():
        bouts = [bout for bout in duel.rounds if bout.verdict is verdict]
        if bouts:
            of = f" of {duel.scenarios} scenarios" if not told and duel.scenarios > 1 else ""
            told.append(f"{words} in {len(bouts)}{of}{_most(bouts)}")
    return told


WORDS = {
    Verdict.BETTER: "better",
    Verdict.FEWER_LOST: "fewer runs lost",
    Verdict.WORSE: "worse",
    Verdict.MORE_LOST: "more runs lost",
    Verdict.EQUAL: "equal",
    Verdict.UNDECIDED: "undecided",
}
"""Each verdict in a sentence, in the order in which they are told."""


def _most(bouts: Sequence[Round]) -> str:
    """Say where the difference is most certain."""
    largest = max(bouts, key=lambda bout: bout.weight)
    if largest.weight == 0:
        return ""
    return f" ({'most ' if len(bouts) > 1 else ''}on {largest.scenario}: {largest.words})"


def _margin(standing: Standing) -> str:
    return f"{100 * tested_pairs(standing)[0].rule.margin:g} %"


def named(names: Sequence[str]) -> str:
    """Return names as a person lists them, the first few."""
    if len(names) > NAMED:
        return f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _basis(tested: Sequence[Standing]) -> str:
    judgements = [pair.judgement for standing in tested for pair in tested_pairs(standing)]
    low, high = (of(judgement.n for judgement in judgements) for of in (min, max))
    return f"Each comparison uses {low if low == high else f'{low} to {high}'} seeds; {losses_range(judgements)}."
