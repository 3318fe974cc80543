"""Two methods over all scenarios: in how many one beats the other, and by how much."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from jerkbench.evaluation.statistics.judgement import BY_LOSSES, DEFEATS, WINS, Judgement, Verdict
from jerkbench.report.analysis.columns import Combination
from jerkbench.report.analysis.standings import UNTESTED, Comparison, Standing, losses_range
from jerkbench.report.tables.table_model import factor_number

ALL_LOST = math.log(100.0)
"""A method that loses every run, beside one that loses none, weighs as much as one that is 100 times worse."""


def certain_size(judgement: Judgement) -> float:
    """Return what is certain of a difference: the log ratio at that end of its interval that is nearest to none."""
    if judgement.verdict in BY_LOSSES:
        return ALL_LOST * abs(judgement.failures[0] - judgement.failures[1]) / judgement.n
    if judgement.verdict not in {Verdict.BETTER, Verdict.WORSE}:
        return 0.0
    ends = (abs(math.log(end)) for end in (judgement.low, judgement.high) if 0 < end < math.inf)
    return min(ends, default=ALL_LOST)  # the median run of one is lost: no size, and nothing uncertain


def size_text(judgement: Judgement) -> str:
    """Say how large a difference is that was shown."""
    if judgement.verdict in BY_LOSSES:
        ours, theirs = judgement.failures
        return f"{ours} of {judgement.n} runs lost or locked out against {theirs}"
    better = judgement.verdict is Verdict.BETTER
    seen, word = (judgement.turned, "better") if better else (judgement, "worse")
    if not 0 < seen.ratio < math.inf:
        return f"{word}, as the median run of the one is lost"
    times, low, high = map(factor_number, (seen.ratio, seen.low, seen.high))
    return f"{times} times {word}, 95 % {low} to {high}"


class Duel(NamedTuple):
    """Two methods over all scenarios that have both.

    Attributes:
        ours: name of the first, which beats the second at least as often as it is beaten.
        theirs: name of the second.
        rounds: of each scenario its name (empty where there is only one), and the judgement of the first.
    """

    ours: str
    theirs: str
    rounds: tuple[tuple[str, Judgement], ...]

    @property
    def won(self) -> int:
        """In how many the first beats the second."""
        return sum(judgement.verdict in WINS for _, judgement in self.rounds)

    @property
    def lost(self) -> int:
        """In how many the second beats the first."""
        return sum(judgement.verdict in DEFEATS for _, judgement in self.rounds)

    @property
    def certain_size(self) -> float:
        """The mean over the scenarios of what is certain of the difference."""
        return sum(certain_size(judgement) for _, judgement in self.rounds) / len(self.rounds)

    @property
    def turned(self) -> "Duel":
        """The same with the second as the first."""
        return Duel(self.theirs, self.ours, tuple((name, judgement.turned) for name, judgement in self.rounds))


def duels(standings: Iterable[Standing]) -> list[Duel]:
    """Return every two methods that were compared, over all scenarios; phases of one recording are no test."""
    rounds: dict[tuple[str, str], list[tuple[str, Judgement]]] = {}
    for standing in standings:
        for pair in standing.tested:
            names = standing.name(pair.subject), standing.name(pair.baseline)
            if names[::-1] in rounds:
                names, pair = names[::-1], pair.turned  # noqa: PLW2901 - the same pair, as the other method sees it
            rounds.setdefault(names, []).append((", ".join(standing.scenario), pair.judgement))
    pairings = [Duel(ours, theirs, tuple(seen)) for (ours, theirs), seen in rounds.items()]
    return [duel.turned if duel.lost > duel.won else duel for duel in pairings]


# The answer of a study: a title that says who won and by how much, and what it rests on in up to three sentences.

NAMED = 3
"""So many leaders are named."""


class Answer(NamedTuple):
    """What a study says about its methods.

    Attributes:
        title: who won, and by how much.
        sentences: where, where not, and over how many runs.
    """

    title: str
    sentences: tuple[str, ...] = ()


def answer(standings: Sequence[Standing]) -> Answer:
    """Return what a study says about its methods, over all its scenarios."""
    tested = [standing for standing in standings if standing.tested]
    if not tested:
        if not any(len(standing.rivals) > 1 for standing in standings):
            return Answer("There is one method, and nothing to compare it with.")
        many = not any(standing.comparisons for standing in standings)
        return Answer("Who leads is not tested: there are too many pairs of methods." if many else UNTESTED)
    methods = {standing.name(rival) for standing in tested for rival in standing.rivals}
    said = _of_two(tested) if len(methods) == 2 else _of_many(tested, len(methods))
    judgements = [pair.judgement for standing in tested for pair in standing.tested]
    low, high = (of(judgement.n for judgement in judgements) for of in (min, max))
    seeds = f"{low}" if low == high else f"{low} to {high}"
    basis = f"Each comparison uses {seeds} seeds; {losses_range(judgements)}."
    return Answer(said.title, (*said.sentences, basis))


def _of_two(tested: Sequence[Standing]) -> Answer:
    (duel,) = duels(tested)
    both = f"{duel.ours} and {duel.theirs}"
    if len(duel.rounds) > 1:
        shown = f"{duel.ours} beats {duel.theirs} in {duel.won} of {len(duel.rounds)} scenarios"
        title = shown if duel.won + duel.lost else f"No difference between {both} was shown"
        return Answer(title, (duel_sentence(duel),))
    ((_, judgement),) = duel.rounds
    if judgement.verdict is Verdict.EQUAL:
        return Answer(f"{both} are {tested[0].tested[0].rule.equal}")
    if judgement.verdict is Verdict.UNDECIDED:
        return Answer(f"No difference between {both} was shown")
    return Answer(f"{duel.ours} beats {duel.theirs}: {size_text(judgement)}")


def _of_many(tested: Sequence[Standing], methods: int) -> Answer:
    decided = [standing for standing in tested if standing.decided]
    if not decided:
        if all(pair.verdict is Verdict.EQUAL for standing in tested for pair in standing.tested):
            return Answer(f"All {methods} methods are {tested[0].tested[0].rule.equal}")
        where = f" in any of {len(tested)} scenarios" if len(tested) > 1 else ""
        return Answer(f"None of {methods} methods was shown to beat another{where}")
    counts = Counter(name for standing in decided for name in standing.leaders)
    most, reference = max(counts.values()), reference_method(tested)
    compared = [against(standing, reference) for standing in tested]
    leaders = sorted(
        (name for name, count in counts.items() if count == most), key=lambda name: mean_log_ratio(compared, name)
    )
    verb = "leads" if len(leaders) == 1 else "lead"
    where = f" in {most} of {len(tested)} scenarios" if len(tested) > 1 else ""
    title = f"Of {methods} methods, {_named(leaders)} {verb}{where}"
    duel = next((duel for duel in duels(tested) if {duel.ours, duel.theirs} == {leaders[0], reference}), None)
    undecided = [", ".join(standing.scenario) for standing in tested if not standing.decided]
    sentences = [f"No difference between methods was shown on {_named(undecided)}."] if undecided else []
    if duel and duel.won + duel.lost:
        duel = duel if duel.ours == leaders[0] else duel.turned
        better = [judgement for _, judgement in duel.rounds if judgement.verdict is Verdict.BETTER]
        times = max(better, key=certain_size).turned.ratio if better else math.inf
        if 0 < times < math.inf:
            who = " and is" if len(leaders) == 1 else f"; {duel.ours} is"
            up_to = "up to " if len(duel.rounds) > 1 else ""
            title += f"{who} {up_to}{factor_number(times)} times better than {duel.theirs}"
        sentences = [duel_sentence(duel), *sentences]
    return Answer(title, tuple(sentences))


def reference_method(tested: Iterable[Standing]) -> str:
    """Return the method that others are held against.

    Of those that most scenarios have: the baseline without adaptation, else the first without, else the first.
    """
    names: dict[str, list[Combination]] = {}
    for standing in tested:
        for rival in standing.rivals:
            names.setdefault(standing.name(rival), []).append(rival)

    def order(name: str) -> tuple[int, bool, bool]:
        rivals = names[name]
        plain = rivals[0].adaptation == "none"
        return len(rivals), plain and rivals[0].filter == "baseline", plain

    return max(names, key=order)


def against(standing: Standing, reference: str) -> dict[str, Comparison]:
    """Return each method's comparison with the reference in a scenario."""
    of: dict[str, Comparison] = {}
    for pair in standing.tested:
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


def duel_sentence(duel: Duel) -> str:
    """Say in how many scenarios each verdict holds, and where it is most certain.

    For example "jerk against baseline: better in 2 of 3 scenarios (most on none: 2.0 times better, 95 % 1.9 to 2.1);
    undecided in 1."
    """
    told: list[str] = []
    for verdict, words in WORDS.items():
        rounds = [(name, judgement) for name, judgement in duel.rounds if judgement.verdict is verdict]
        if rounds:
            of = f" of {len(duel.rounds)} scenarios" if not told and len(duel.rounds) > 1 else ""
            name, largest = max(rounds, key=lambda one: certain_size(one[1]))
            most = f"{'most ' if len(rounds) > 1 else ''}on {name}: {size_text(largest)}"
            told.append(f"{words} in {len(rounds)}{of}{f' ({most})' if certain_size(largest) else ''}")
    return f"{duel.ours} against {duel.theirs}: {'; '.join(told)}."


WORDS = {
    Verdict.BETTER: "better",
    Verdict.FEWER_LOST: "fewer runs lost",
    Verdict.WORSE: "worse",
    Verdict.MORE_LOST: "more runs lost",
    Verdict.EQUAL: "equal",
    Verdict.UNDECIDED: "undecided",
}
"""Each verdict in a sentence, in the order in which they are told."""


def _named(names: Sequence[str]) -> str:
    """Return names as a person lists them, the first few."""
    if len(names) > NAMED:
        return f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
