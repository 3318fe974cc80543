"""What a study says in sentences: the answer, every two methods over all scenarios, the comparisons with baselines."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import OUTLIER_FACTOR, failures_text, up_to
from jerkbench.evaluation.judgement import BY_FAILURES, DEFEATS, WINS, Judgement, Verdict
from jerkbench.report.columns import FACTORS
from jerkbench.report.comparisons import UNTESTED, Comparison, Standing, leads, losses_range
from jerkbench.report.study_verdicts import StudyVerdicts
from jerkbench.report.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


_FAILED = f"failed or with over {OUTLIER_FACTOR:g} times the error"
"""The failures of a run, in words."""

ALL_LOST = math.log(100.0)
"""A method that loses every run, beside one that loses none, weighs as much as one that is 100 times worse."""


def certain_size(judgement: Judgement) -> float:
    """Return what is certain of a difference: the log ratio at that end of its interval that is nearest to none."""
    if judgement.verdict in BY_FAILURES:
        return ALL_LOST * abs(judgement.failures[0] - judgement.failures[1]) / judgement.n
    if judgement.verdict not in {Verdict.BETTER, Verdict.WORSE}:
        return 0.0
    ends = (abs(math.log(end)) for end in (judgement.low, judgement.high) if 0 < end < math.inf)
    return min(ends, default=ALL_LOST)  # the median run of one is lost: no size, and nothing uncertain


def size_text(judgement: Judgement) -> str:
    """Say how large a difference is that was shown."""
    if judgement.verdict in BY_FAILURES:
        ours, theirs = judgement.failures
        return f"{ours} of {judgement.n} runs {_FAILED} against {theirs}"
    better = judgement.verdict is Verdict.BETTER
    seen, word = (judgement.swapped, "better") if better else (judgement, "worse")
    if not 0 < seen.ratio < math.inf:
        return f"{word}, as the median run of the one is lost"
    interval = "" if math.isnan(seen.low) else f", 95 % {factor_number(seen.low)} to {factor_number(seen.high)}"
    return f"{factor_number(seen.ratio)} times {word}{interval}"


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
        return Duel(self.theirs, self.ours, tuple((name, judgement.swapped) for name, judgement in self.rounds))


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

_NAMED = 3
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
        title = shown if duel.won + duel.lost else _no_difference(both, tested)
        return Answer(title, (duel_sentence(duel),))
    ((_, judgement),) = duel.rounds
    if judgement.verdict is Verdict.EQUAL:
        return Answer(f"{both} are {tested[0].tested[0].rule.equal}")
    if judgement.verdict is Verdict.SMALL:
        return Answer(f"{both} {tested[0].tested[0].rule.small}")
    if judgement.verdict is Verdict.UNDECIDED:
        return Answer(_no_difference(both, tested))
    return Answer(f"{duel.ours} beats {duel.theirs}: {size_text(judgement)}")


def _no_difference(both: str, tested: Sequence[Standing]) -> str:
    pairs = [pair for standing in tested for pair in standing.tested]
    than = f"of more than {100 * pairs[0].rule.margin:g} % " * any(pair.verdict is Verdict.SMALL for pair in pairs)
    return f"No difference {than}between {both} was shown"


def _of_many(tested: Sequence[Standing], methods: int) -> Answer:
    decided = [standing for standing in tested if standing.decided]
    if not decided:
        verdicts, rule = {pair.verdict for standing in tested for pair in standing.tested}, tested[0].tested[0].rule
        if verdicts <= {Verdict.EQUAL, Verdict.SMALL}:
            return Answer(f"All {methods} methods {rule.small if Verdict.SMALL in verdicts else f'are {rule.equal}'}")
        where = f" in any of {len(tested)} scenarios" if len(tested) > 1 else ""
        return Answer(f"None of {methods} methods was shown to beat another{where}")
    (alone, shared), reference = leads(decided), reference_method(tested)
    names = {**alone, **shared}
    won, tied = max((alone[name], shared[name]) for name in names)
    compared = [against(standing, reference) for standing in tested]
    leaders = sorted(
        (name for name in names if (alone[name], shared[name]) == (won, tied)),
        key=lambda name: mean_log_ratio(compared, name),
    )
    ending = "s" if len(leaders) == 1 else ""
    of = f" in {{}} of {len(tested)} scenarios" if len(tested) > 1 else ""
    verbs = [f"lead{ending}{of.format(won)}"] * bool(won) + [f"share{ending} the lead{of.format(tied)}"] * bool(tied)
    title = f"Of {methods} methods, {_named(leaders)} {' and '.join(verbs)}"
    duel = next((duel for duel in duels(tested) if {duel.ours, duel.theirs} == {leaders[0], reference}), None)
    undecided = [", ".join(standing.scenario) for standing in tested if not standing.decided]
    sentences = [f"No difference between methods was shown on {_named(undecided)}."] if undecided else []
    if duel and duel.won + duel.lost:
        duel = duel if duel.ours == leaders[0] else duel.turned
        better = [judgement for _, judgement in duel.rounds if judgement.verdict is Verdict.BETTER]
        times = max(better, key=certain_size).swapped.ratio if better else math.inf
        if 0 < times < math.inf:
            who = " and is" if len(leaders) == 1 and len(verbs) == 1 else f"; {duel.ours} is"
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
    for verdict, words in _WORDS.items():
        rounds = [(name, judgement) for name, judgement in duel.rounds if judgement.verdict is verdict]
        if rounds:
            of = f" of {len(duel.rounds)} scenarios" if not told and len(duel.rounds) > 1 else ""
            name, largest = max(rounds, key=lambda one: certain_size(one[1]))
            most = f"{'most ' if len(rounds) > 1 else ''}on {name}: {size_text(largest)}"
            told.append(f"{words} in {len(rounds)}{of}{f' ({most})' if certain_size(largest) else ''}")
    return f"{duel.ours} against {duel.theirs}: {'; '.join(told)}."


_WORDS = {
    Verdict.BETTER: "better",
    Verdict.FEWER_FAILED: "failing in fewer runs",
    Verdict.WORSE: "worse",
    Verdict.MORE_FAILED: "failing in more runs",
    Verdict.SMALL: "different by less than the margin",
    Verdict.EQUAL: "equal",
    Verdict.UNDECIDED: "undecided",
}
"""Each verdict in a sentence, in the order in which they are told."""


def _named(names: Sequence[str]) -> str:
    """Return names as a person lists them, the first few."""
    if len(names) > _NAMED:
        return f"{', '.join(names[:_NAMED])} and {len(names) - _NAMED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


# The comparisons with a study's baselines in sentences.


def findings(rows: "pd.DataFrame", verdicts: StudyVerdicts, baseline: Mapping[str, str] | None = None) -> list[str]:
    """Return a sentence for each comparison with ``baseline``, the largest certain difference first.

    Without a baseline, the comparisons with ``adaptation=none`` and ``filter=baseline`` are used; if there are none,
    the pairs of `strongest`. There is none for a metric whose lowest value is not the best.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    varying = varying_factors(rows)
    return [sentence(comparison, varying) for comparison in sorted(compared(rows, verdicts, baseline), key=_order)]


def _order(comparison: Comparison) -> float:
    """Sort by what is certain of a difference; of phases, by that end of their range that is nearest to none."""
    low, high = comparison.judgement.low, comparison.judgement.high
    if not comparison.phases:
        return -certain_size(comparison.judgement)
    return -max(math.log(low) if low > 1 else 0.0, -math.log(high) if 0 < high < 1 else 0.0)


def compared(
    rows: "pd.DataFrame", verdicts: StudyVerdicts, baseline: Mapping[str, str] | None = None
) -> list[Comparison]:
    """Return every comparison of which `findings` has a sentence."""
    if not verdicts.standings:
        return []
    baselines = [baseline] if baseline else study_baselines(rows)
    found = [comparison for values in baselines for comparison in verdicts.against(values)]
    references = _references(verdicts.standings)
    return found or [pair for one in verdicts.standings for pair in _told(one, references).comparisons]


def sentence(comparison: Comparison, varying: Sequence[str]) -> str:
    """Say what a comparison shows, with the factors that vary in the study."""
    subject, baseline, where = method_names(comparison, varying)
    judgement, lost = comparison.judgement, losses_clause(comparison, subject, baseline)
    n, ratio, known = judgement.n, judgement.ratio, 0 < judgement.ratio < math.inf
    noun = "phases" if comparison.phases else "seeds"
    # a recording in which nothing is withheld has one run, and no phases
    count = f"{n} {noun}" if n != 1 else "one run" if comparison.phases else "1 seed"
    if n == 0:
        return f"{subject} cannot be compared with {baseline}{where}: no run of both has a value."
    if all(count == comparison.runs for count in comparison.lost):
        return f"{subject} cannot be compared with {baseline}{where}: both lost all {comparison.runs} runs."
    if not (comparison.ratios.d.any() or any(judgement.failures)):
        return f"{subject} gives the same as {baseline}{where} ({count}){lost}."
    if comparison.phases:
        over = f"{f'range {_range(comparison)} over ' if known else ''}{count}" if n > 1 else count
        return f"{subject} {_times(ratio)} {baseline}{where} ({over} of one recording; no test){lost}."
    if comparison.verdict in BY_FAILURES:
        (ours, theirs), p = judgement.failures, number(judgement.p_failed)
        bounds = f"{up_to(ours, n)} against {up_to(theirs, n)}; McNemar, p {p}"
        counts = f"{ours} of {n} {_FAILED} against {theirs} of {n} ({bounds})"
        return f"{subject} {comparison.verdict.value} than {baseline}{where}: {counts}."
    median = "median, " if judgement.median else ""
    interval = "" if math.isnan(judgement.low) else f"95 % {_range(comparison)}, "
    detail = f"({median}{interval}{count})" if known else f"(median: that run of the one is lost, {count})"
    factor = f"{number(ratio)} times " if known else ""
    said = f"{subject} {_times(ratio)} {baseline}{where} {detail}"
    if comparison.verdict is Verdict.EQUAL:
        said = f"{subject} and {baseline} are {comparison.rule.equal}{where}: {factor}{detail}"
    elif comparison.verdict is Verdict.SMALL:
        said = f"{subject} and {baseline} {comparison.rule.small}{where}: {factor_number(ratio)} times {detail}"
    elif comparison.verdict is Verdict.UNDECIDED:
        more = f"; {comparison.needed} seeds would decide" if comparison.needed else ""
        more += f", as {judgement.reason}" if judgement.reason else ""
        said = f"Undecided between {subject} and {baseline}{where}: {factor}{detail}{more}"
    return f"{said}{lost}."


def varying_factors(rows: "pd.DataFrame") -> tuple[str, ...]:
    """Return the factors that tell the combinations apart."""
    return tuple(key for key in FACTORS if len(rows[key].astype(str).unique()) > 1)


def study_baselines(rows: "pd.DataFrame", factors: Sequence[str] = ("adaptation", "filter")) -> list[dict[str, str]]:
    """Return the baselines among a study's ``factors``: the plain value of each that has others beside it."""
    values = {factor: set(rows[factor].astype(str)) for factor in factors}
    return [{factor: REFERENCES[factor]} for factor in factors if {REFERENCES[factor]} < values[factor]]


def method_names(comparison: Comparison, varying: Sequence[str]) -> tuple[str, str, str]:
    """The names of both (what differs between them, filter and adaptation always), and where they are compared."""
    differ = [key for key, a, b in zip(FACTORS, comparison.subject, comparison.baseline, strict=True) if a != b]
    named = [key for key in FACTORS if key in differ or (key in ("filter", "adaptation") and key in varying)]
    places = [key for key in varying if key not in named]
    where = ", ".join(getattr(comparison.subject, key) for key in places)
    subject, baseline = (
        "+".join(getattr(of, key) for key in named) for of in (comparison.subject, comparison.baseline)
    )
    return subject, baseline, f" on {where}" if where else ""


def _times(ratio: float) -> str:
    if not 0 < ratio < math.inf:
        return f"is {'worse' if ratio else 'better'} than"
    times, word = (1 / ratio, "better") if 0 < ratio < 1 else (ratio, "worse")
    return f"is {factor_number(times)} times {word} than"


def _range(comparison: Comparison) -> str:
    """The interval of the factor that the sentence states: of better, the inverse."""
    low, high = comparison.judgement.low, comparison.judgement.high
    inverse = (comparison.shown or comparison.phases) and 0 < comparison.judgement.ratio < 1
    ends = (1 / high if high else math.inf, 1 / low if low else math.inf) if inverse else (low, high)
    written = (
        number if comparison.verdict in {Verdict.EQUAL, Verdict.UNDECIDED} and not comparison.phases else factor_number
    )
    if math.isinf(ends[1]):
        return f"from {written(ends[0])} up, since a run was lost"
    return f"{written(ends[0])} to {written(ends[1])}"


def losses_clause(comparison: Comparison, subject: str, baseline: str) -> str:
    """Say how many runs either lost or locked out in, and how many may be; of phases nothing where all went well."""
    judgement, phases = comparison.judgement, comparison.phases
    if not any((*comparison.lost, *judgement.outlying)):
        return "" if phases else f"; {judgement.failure_rates}"
    counts = zip((subject, baseline), comparison.lost, judgement.outlying, strict=True)
    told = [
        f"{name}: {failures_text(lost, locked, comparison.runs, bound=not phases)}"
        for name, lost, locked in counts
        if lost or locked
    ]
    return f"; {'; '.join(told)}"


# The findings of a study by size and certainty: every method against what it changes, over all scenarios.

REFERENCES = {"filter": "baseline", "adaptation": "none"}
"""What the other values of a factor are held against in a study that has it."""


def strongest(standings: Sequence[Standing]) -> list[str]:
    """Return a sentence for every two methods that differ in one factor, over all scenarios, strongest first.

    Of a factor that has its reference (`REFERENCES`) in the study the others are held against that, else every two.
    Methods that no chain of such comparisons connects (tuned ones differ in several factors) are compared, too.
    The order is that of `Duel.certain_size`: the mean over the scenarios of what is certain of the difference.
    """
    references = _references(standings)
    told = [_told(standing, references) for standing in standings]
    if len(told) == 1:  # the comparisons' own sentences
        varying = [factor for k, factor in enumerate(FACTORS) if len({rival[k] for rival in told[0].rivals}) > 1]
        ranked = sorted(told[0].comparisons, key=lambda pair: -certain_size(pair.judgement))
        return [sentence(pair, varying) for pair in ranked]
    return [duel_sentence(duel) for duel in sorted(duels(told), key=lambda duel: -duel.certain_size)]


def largest(standings: Sequence[Standing]) -> list[tuple[float, Comparison]]:
    """Return each comparison of `strongest` that shows a difference, with what is certain of it, the largest first."""
    references = _references(standings)
    pairs = [pair for standing in standings for pair in _told(standing, references).tested]
    weighed = [(certain_size(pair.judgement), pair) for pair in pairs]
    return sorted(((weight, pair) for weight, pair in weighed if weight > 0), key=lambda one: -one[0])


def _references(standings: Iterable[Standing]) -> dict[str, str]:
    rivals = {rival for standing in standings for rival in standing.rivals}
    values = {factor: {rival[k] for rival in rivals} for k, factor in enumerate(FACTORS)}
    return {factor: name for factor, name in REFERENCES.items() if name in values[factor]}


def _told(standing: Standing, references: Mapping[str, str]) -> Standing:
    """Return the standing with the comparisons about one factor, and those of methods that these do not connect."""

    def of_one_factor(pair: Comparison) -> bool:
        values = zip(FACTORS, pair.subject, pair.baseline, strict=True)
        differ = [(factor, both) for factor, *both in values if both[0] != both[1]]
        return len(differ) == 1 and all(references.get(factor, both[0]) in both for factor, both in differ)

    telling = {pair[:2] for pair in standing.comparisons if of_one_factor(pair)}
    connected = {rival: {rival} for rival in standing.rivals}
    for first, second in telling:
        joined = connected[first] | connected[second]
        connected.update(dict.fromkeys(joined, joined))
    pairs = standing.comparisons
    kept = (pair for pair in pairs if pair[:2] in telling or pair.baseline not in connected[pair.subject])
    return standing._replace(comparisons=tuple(kept))
