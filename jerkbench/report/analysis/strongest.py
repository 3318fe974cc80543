"""The findings of a study by size and certainty: every method against what it changes, over all scenarios."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.comparison import Comparison, losses_of
from jerkbench.report.analysis.duels import Duel, Round, duels, round_of
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.findings import sentence
from jerkbench.report.analysis.leading import Contest
from jerkbench.report.analysis.standings import Standing

REFERENCES = {"filter": "baseline", "adaptation": "none"}
"""What the other values of a factor are held against in a study that has it."""

WORDS = {
    Verdict.BETTER: "better in",
    Verdict.FEWER_LOST: "fewer runs lost in",
    Verdict.WORSE: "worse in",
    Verdict.MORE_LOST: "more runs lost in",
    Verdict.EQUAL: "equal in",
    Verdict.UNDECIDED: "undecided in",
}
"""What stands before a number of scenarios."""


def strongest(standings: Sequence[Standing]) -> list[str]:
    """Return a sentence for every two methods that differ in one factor, over all scenarios, strongest first.

    Of a factor that has its reference (`REFERENCES`) in the study the others are held against that, else every two.
    The order is that of `Duel.weight`: the mean over the scenarios of what is certain of the difference.
    """
    references = _references(standings)
    told = [_told(standing, references) for standing in standings]
    if len(told) == 1:
        return _of_one_scenario(told[0].contest)
    return [_sentence(duel) for duel in sorted(duels(told), key=lambda duel: -duel.weight)]


def largest(standings: Sequence[Standing]) -> list[tuple[float, Comparison]]:
    """Return each comparison of `strongest` that shows a difference, with what is certain of it, the largest first."""
    references = _references(standings)
    pairs = [pair for standing in standings for pair in _told(standing, references).contest.comparisons]
    weighed = [(_weight(pair), pair) for pair in pairs if pair.replicate != "phase" and pair.judgement.n]
    return sorted(((weight, pair) for weight, pair in weighed if weight > 0), key=lambda one: -one[0])


def _weight(pair: Comparison) -> float:
    return round_of(pair).weight


def _of_one_scenario(contest: Contest) -> list[str]:
    """Return the comparisons' own sentences."""
    varying = [factor for k, factor in enumerate(FACTORS) if len({rival[k] for rival in contest.rivals}) > 1]
    ranked = sorted(contest.comparisons, key=lambda pair: -_weight(pair))
    return [sentence(pair, varying) for pair in ranked]


def _references(standings: Iterable[Standing]) -> dict[str, str]:
    rivals = {rival for standing in standings for rival in standing.contest.rivals}
    values = {factor: {rival[k] for rival in rivals} for k, factor in enumerate(FACTORS)}
    return {factor: name for factor, name in REFERENCES.items() if name in values[factor]}


def _told(standing: Standing, references: Mapping[str, str]) -> Standing:
    """Return the standing with those comparisons alone that say something about one factor."""
    kept = tuple(pair for pair in standing.contest.comparisons if _tells(pair, references))
    return replace(standing, contest=replace(standing.contest, comparisons=kept))


def _tells(pair: Comparison, references: Mapping[str, str]) -> bool:
    values = zip(FACTORS, pair.subject, pair.baseline, strict=True)
    differ = [(factor, {ours, theirs}) for factor, ours, theirs in values if ours != theirs]
    return len(differ) == 1 and all(factor not in references or references[factor] in both for factor, both in differ)


def _sentence(duel: Duel) -> str:
    of = {verdict: [round_ for round_ in duel.rounds if round_.verdict is verdict] for verdict in WORDS}
    parts = [f"{WORDS[verdict]} {len(rounds)}{_most(rounds)}" for verdict, rounds in of.items() if rounds]
    lost = losses_of(round_.judgement for round_ in duel.rounds)
    return f"{duel.ours} against {duel.theirs} in {duel.scenarios} scenarios: {', '.join(parts)}; {lost}."


def _most(rounds: Sequence[Round]) -> str:
    """Say where the difference is most certain."""
    largest = max(rounds, key=lambda round_: round_.weight)
    if largest.weight == 0:
        return ""
    return f" ({'most ' if len(rounds) > 1 else ''}on {largest.scenario}: {largest.words})"
