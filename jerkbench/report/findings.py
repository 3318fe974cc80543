"""Generated text about a study: its main result, and comparisons of methods with each other and with baselines."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import OUTLIER_FACTOR, failures_text, up_to
from jerkbench.evaluation.judgement import BY_FAILURES, DEFEATS, WINS, Judgement, Verdict
from jerkbench.report.columns import FACTORS, varying_factors
from jerkbench.report.comparisons import UNTESTED, Comparison, Standing, failures_range
from jerkbench.report.labels import TUNED_SUFFIX
from jerkbench.report.study_verdicts import StudyVerdicts
from jerkbench.report.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


_FAILED = f"failed or with over {OUTLIER_FACTOR:g} times the error"
"""Text about the runs that count as failures."""

LOG_RATIO_ALL_FAILED = math.log(100.0)
"""Size of a difference if all runs of one method and no run of the other method failed. It is equal to the size of an
error ratio of 100."""


def certain_size(judgement: Judgement) -> float:
    """Return the size of a difference at the end of its confidence interval that is closer to equality (log ratio).

    If the methods differ in their failure rates, the result is proportional to the difference of the failure rates. For
    a difference that is not significant, the result is 0.
    """
    if judgement.verdict in BY_FAILURES:
        return LOG_RATIO_ALL_FAILED * abs(judgement.failures[0] - judgement.failures[1]) / judgement.n
    if judgement.verdict not in {Verdict.BETTER, Verdict.WORSE}:
        return 0.0
    ends = (abs(math.log(end)) for end in (judgement.low, judgement.high) if 0 < end < math.inf)
    return min(ends, default=LOG_RATIO_ALL_FAILED)  # no ratio is defined if a median run failed


def size_text(judgement: Judgement) -> str:
    """Return text with the size of a significant difference, such as "2.0 times better, 95 % 1.9 to 2.1"."""
    if judgement.verdict in BY_FAILURES:
        ours, theirs = judgement.failures
        return f"{ours} of {judgement.n} runs {_FAILED} against {theirs}"
    better = judgement.verdict is Verdict.BETTER
    seen, direction = (judgement.swapped, "better") if better else (judgement, "worse")
    if not 0 < seen.ratio < math.inf:
        return f"{direction}, because the median run of one method failed"
    interval = "" if math.isnan(seen.low) else f", 95 % {factor_number(seen.low)} to {factor_number(seen.high)}"
    return f"{factor_number(seen.ratio)} times {direction}{interval}"


class MethodPair(NamedTuple):
    """The comparisons of two methods in all scenarios that contain both methods.

    Attributes:
        ours: name of the first method.
        theirs: name of the second method.
        rounds: name of each scenario, and the comparison of the first method with the second method in this scenario.
            If the study has only one scenario, the name of the scenario is empty.
    """

    ours: str
    theirs: str
    rounds: tuple[tuple[str, Judgement], ...]

    @property
    def wins(self) -> int:
        """The number of scenarios in which the first method is significantly better."""
        return sum(judgement.verdict in WINS for _, judgement in self.rounds)

    @property
    def defeats(self) -> int:
        """The number of scenarios in which the second method is significantly better."""
        return sum(judgement.verdict in DEFEATS for _, judgement in self.rounds)

    @property
    def certain_size(self) -> float:
        """The mean size of the difference over the scenarios, as computed by the function `certain_size`."""
        return sum(certain_size(judgement) for _, judgement in self.rounds) / len(self.rounds)

    @property
    def swapped(self) -> "MethodPair":
        """The same comparisons with the first and the second method swapped."""
        return MethodPair(self.theirs, self.ours, tuple((name, judgement.swapped) for name, judgement in self.rounds))


def method_pairs(standings: Iterable[Standing]) -> list[MethodPair]:
    """Return each pair of methods that was tested in at least one scenario.

    The phases of one recording are not tested for significance. Each pair is ordered such that its first method is
    better in at least as many scenarios as its second method.
    """
    rounds: dict[tuple[str, str], list[tuple[str, Judgement]]] = {}
    for standing in standings:
        for pair in standing.tested:
            names = standing.name(pair.subject), standing.name(pair.baseline)
            if names[::-1] in rounds:
                names, pair = names[::-1], pair.swapped  # noqa: PLW2901 - the same pair, as the other method sees it
            rounds.setdefault(names, []).append((", ".join(standing.scenario), pair.judgement))
    pairings = [MethodPair(ours, theirs, tuple(seen)) for (ours, theirs), seen in rounds.items()]
    return [pair.swapped if pair.defeats > pair.wins else pair for pair in pairings]


# The main result of a study: a title that names the best method, and up to three sentences.

_BASELINES = (f"baseline{TUNED_SUFFIX}", "baseline")
"""Labels of the filters that are references, the preferred label first."""
_NAMED = 3
"""Maximum number of methods or scenarios that a sentence lists."""


class Answer(NamedTuple):
    """The main result of a study.

    Attributes:
        title: text with the best method, and the ratio by which its error is smaller.
        sentences: sentences about scenarios with and without significant differences, and about the number of seeds.
    """

    title: str
    sentences: tuple[str, ...] = ()


def answer(standings: Sequence[Standing]) -> Answer:
    """Return the main result of a study over all its scenarios."""
    tested = [standing for standing in standings if standing.tested]
    if not tested:
        if not any(len(standing.rivals) > 1 for standing in standings):
            return Answer("The study has only one method, so no methods are compared.")
        many = not any(standing.comparisons for standing in standings)
        return Answer("The best method is not tested: there are too many pairs of methods." if many else UNTESTED)
    said = _of_methods(tested, len({standing.name(rival) for standing in tested for rival in standing.rivals}))
    judgements = [pair.judgement for standing in tested for pair in standing.tested]
    low, high = (of(judgement.n for judgement in judgements) for of in (min, max))
    seeds = f"{low}" if low == high else f"{low} to {high}"
    basis = f"Each comparison uses {seeds} seeds; {failures_range(judgements)}."
    return Answer(said.title, (*said.sentences, basis))


def _of_methods(tested: Sequence[Standing], methods: int) -> Answer:
    decided = [standing for standing in tested if standing.decided]
    if not decided:
        verdicts, rule = {pair.verdict for standing in tested for pair in standing.tested}, tested[0].tested[0].rule
        if verdicts <= {Verdict.EQUAL, Verdict.SMALL}:
            every = "Both" if methods == 2 else f"All {methods}"
            return Answer(f"{every} methods {rule.small if Verdict.SMALL in verdicts else f'are {rule.equal}'}")
        where = f" in any of {len(tested)} scenarios" if len(tested) > 1 else ""
        return Answer(f"None of {methods} methods is significantly better than another{where}")
    sole, shared, reference = Counter[str](), Counter[str](), reference_method(tested)
    for standing in decided:  # count the scenarios in which a method is the only best, or one of several best
        (sole if len(standing.leaders) == 1 else shared).update(standing.leaders)
    names = {**sole, **shared}
    won, tied = max((sole[name], shared[name]) for name in names)
    compared = [against(standing, reference) for standing in tested]
    leaders = sorted(
        (name for name in names if (sole[name], shared[name]) == (won, tied)),
        key=lambda name: mean_log_ratio(compared, name),
    )
    ending = "s" if len(leaders) == 1 else ""
    of = f" in {{}} of {len(tested)} scenarios" if len(tested) > 1 else ""
    claims = [f"lead{ending}{of.format(won)}"] * bool(won) + [f"share{ending} the lead{of.format(tied)}"] * bool(tied)
    title = f"Of {methods} methods, {_named(leaders)} {' and '.join(claims)}"
    both = {leaders[0], reference}
    method_pair = next(
        (pair for pair in method_pairs(tested) if methods == 2 or {pair.ours, pair.theirs} == both), None
    )
    undecided = [", ".join(standing.scenario) for standing in tested if not standing.decided]
    sentences = [f"No significant difference between methods on {_named(undecided)}."] if undecided else []
    if method_pair and method_pair.wins + method_pair.defeats:
        method_pair = method_pair if method_pair.ours == leaders[0] else method_pair.swapped
        better = [judgement for _, judgement in method_pair.rounds if judgement.verdict is Verdict.BETTER]
        times = max(better, key=certain_size).swapped.ratio if better else math.inf
        if 0 < times < math.inf:
            who = " and is" if len(leaders) == 1 and len(claims) == 1 else f"; {method_pair.ours} is"
            up_to = "up to " if len(method_pair.rounds) > 1 else ""
            title += f"{who} {up_to}{factor_number(times)} times better than {method_pair.theirs}"
        sentences = [pair_finding(method_pair), *sentences]
    return Answer(title, tuple(sentences))


def reference_method(tested: Iterable[Standing]) -> str:
    """Return the name of the reference method, with which all other methods of a study are compared.

    Only methods that ran in the largest number of scenarios are considered. The first choice is the tuned filter
    ``baseline`` without adaptation, then ``baseline`` without tuning, then the first filter without adaptation. If this
    filter ran with several settings, the setting with the smallest error is returned, because a comparison with a worse
    setting would make all other methods look better.
    """
    names: dict[str, list[Combination]] = {}
    for standing in tested:
        for rival in standing.rivals:
            names.setdefault(standing.name(rival), []).append(rival)

    def order(name: str) -> tuple[int, bool, int]:
        plain, model = names[name][0].adaptation == "none", names[name][0].filter
        return len(names[name]), plain, -_BASELINES.index(model) if plain and model in _BASELINES else -len(_BASELINES)

    first = max(names, key=order)
    settings = [
        name for name in names if order(name) == order(first) and names[name][0].filter == names[first][0].filter
    ]
    compared = [against(standing, first) for standing in tested]
    return min(settings, key=lambda name: mean_log_ratio(compared, name))


def against(standing: Standing, reference: str) -> dict[str, Comparison]:
    """Return the comparisons with the reference method in one scenario, by the name of the compared method."""
    of: dict[str, Comparison] = {}
    for pair in standing.tested:
        ours, theirs = standing.name(pair.subject), standing.name(pair.baseline)
        if theirs == reference:
            of[ours] = pair
        elif ours == reference:
            of[theirs] = pair.swapped
    return of


def mean_log_ratio(compared: Iterable[Mapping[str, Comparison]], name: str) -> float:
    """Return the mean of the log error ratio (method to reference method), or infinity if its median run failed."""
    ratios = [of[name].judgement.ratio for of in compared if name in of]
    return sum(math.log(ratio) if ratio > 0 else 0.0 for ratio in ratios) / max(1, len(ratios))


def pair_finding(method_pair: MethodPair) -> str:
    """Return a sentence that counts the scenarios with each verdict, and states the largest difference.

    An example of the sentence is "jerk against baseline: better in 2 of 3 scenarios (most on none: 2.0 times better, 95
    % 1.9 to 2.1); undecided in 1."
    """
    parts: list[str] = []
    for verdict, text in _VERDICT_TEXTS.items():
        rounds = [(name, judgement) for name, judgement in method_pair.rounds if judgement.verdict is verdict]
        if rounds:
            of = f" of {len(method_pair.rounds)} scenarios" if not parts and len(method_pair.rounds) > 1 else ""
            name, largest = max(rounds, key=lambda one: certain_size(one[1]))
            most = f"{'most ' if len(rounds) > 1 else ''}{f'on {name}: ' if name else ''}{size_text(largest)}"
            parts.append(f"{text} in {len(rounds)}{of}{f' ({most})' if certain_size(largest) else ''}")
    return f"{method_pair.ours} against {method_pair.theirs}: {'; '.join(parts)}."


_VERDICT_TEXTS = {
    Verdict.BETTER: "better",
    Verdict.FEWER_FAILED: "failing in fewer runs",
    Verdict.WORSE: "worse",
    Verdict.MORE_FAILED: "failing in more runs",
    Verdict.SMALL: "different by less than the margin",
    Verdict.EQUAL: "equal",
    Verdict.UNDECIDED: "undecided",
}
"""Text of each verdict, in the order in which a finding lists them."""


def _named(names: Sequence[str]) -> str:
    """Return text with the first `_NAMED` names, and the number of names that are left out."""
    if len(names) > _NAMED:
        return f"{', '.join(names[:_NAMED])} and {len(names) - _NAMED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


# Findings: sentences about the comparisons with the baselines of a study.


def findings(rows: "pd.DataFrame", verdicts: StudyVerdicts, baseline: Mapping[str, str] | None = None) -> list[str]:
    """Return a sentence for each comparison with ``baseline``, sorted by decreasing size of the difference.

    If ``baseline`` is None, the baselines are ``adaptation=none`` and ``filter=baseline``. If the study has no run with
    such a baseline, the function compares the pairs of methods that `strongest` selects. The result is empty for a
    metric for which lower values are not better.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    baselines = [baseline] if baseline else study_baselines(rows)
    found = [pair for values in baselines if verdicts.standings for pair in verdicts.against(values)]
    found = found or [pair for one in informative_standings(verdicts.standings) for pair in one.comparisons]
    varying = varying_factors(rows)
    return [finding(comparison, varying) for comparison in sorted(found, key=_order)]


def _order(comparison: Comparison) -> float:
    """Return a sort key that decreases with the size of a difference (for phases, with the smallest log ratio)."""
    low, high = comparison.judgement.low, comparison.judgement.high
    if not comparison.phases:
        return -certain_size(comparison.judgement)
    return -max(math.log(low) if low > 1 else 0.0, -math.log(high) if 0 < high < 1 else 0.0)


def finding(comparison: Comparison, varying: Sequence[str]) -> str:
    """Return a sentence about a comparison. Names in the sentence contain only labels of the factors ``varying``."""
    subject, baseline, where = method_names(comparison, varying)
    judgement, failed = comparison.judgement, failures_clause(comparison, subject, baseline)
    n, ratio, known = judgement.n, judgement.ratio, 0 < judgement.ratio < math.inf
    noun = "phases" if comparison.phases else "seeds"
    # a recording that is not divided into phases has only one run
    count = f"{n} {noun}" if n != 1 else "one run" if comparison.phases else "1 seed"
    if n == 0:
        return f"{subject} cannot be compared with {baseline}{where}: no seed has a value in both."
    if all(count == comparison.runs for count in comparison.failed):
        return f"{subject} cannot be compared with {baseline}{where}: all {comparison.runs} runs of both failed."
    if not (comparison.ratios.d.any() or any(judgement.failures)):
        return f"{subject} gives the same as {baseline}{where} ({count}){failed}."
    if comparison.phases:
        over = f"{f'range {_range(comparison)} over ' if known else ''}{count}" if n > 1 else count
        return f"{subject} {_times(ratio)} {baseline}{where} ({over} of one recording; no test){failed}."
    if comparison.verdict in BY_FAILURES:
        (ours, theirs), p = judgement.failures, number(judgement.p_failed)
        bounds = f"{up_to(ours, n)} against {up_to(theirs, n)}; McNemar, p {p}"
        counts = f"{ours} of {n} {_FAILED} against {theirs} of {n} ({bounds})"
        return f"{subject} {comparison.verdict.value} than {baseline}{where}: {counts}."
    median = "median, " if judgement.median else ""
    interval = "" if math.isnan(judgement.low) else f"95 % {_range(comparison)}, "
    detail = f"({median}{interval}{count})" if known else f"(the median run of one method failed, {count})"
    factor = f"{number(ratio)} times " if known else ""
    said = f"{subject} {_times(ratio)} {baseline}{where} {detail}"
    if comparison.verdict is Verdict.EQUAL:
        said = f"{subject} and {baseline} are {comparison.rule.equal}{where}: {factor}{detail}"
    elif comparison.verdict is Verdict.SMALL:
        said = f"{subject} and {baseline} {comparison.rule.small}{where}: {factor_number(ratio)} times {detail}"
    elif comparison.verdict is Verdict.UNDECIDED:
        more = f"; {comparison.needed} seeds would decide" if comparison.needed else ""
        more += f", because {judgement.reason}" if judgement.reason else ""
        said = f"Undecided between {subject} and {baseline}{where}: {factor}{detail}{more}"
    return f"{said}{failed}."


def study_baselines(rows: "pd.DataFrame", factors: Sequence[str] = ("adaptation", "filter")) -> list[dict[str, str]]:
    """Return a baseline for each factor of which the study contains the reference value (`REFERENCES`) and others."""
    values = {factor: set(rows[factor].astype(str)) for factor in factors}
    return [{factor: name} for factor, name in _references(values).items() if {name} < values[factor]]


def method_names(comparison: Comparison, varying: Sequence[str]) -> tuple[str, str, str]:
    """Return the names of both compared methods, and the text " on SCENARIO" with the name of the scenario.

    The name of a method contains the labels of all factors in which the two methods differ, and the filter and the
    adaptation if they vary in the study. The name of the scenario contains the labels of all other varying factors.
    """
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
    times, direction = (1 / ratio, "better") if 0 < ratio < 1 else (ratio, "worse")
    return f"is {factor_number(times)} times {direction} than"


def _range(comparison: Comparison) -> str:
    """Return text with the interval of a ratio. In a sentence with "x times better", the interval is inverted."""
    low, high = comparison.judgement.low, comparison.judgement.high
    inverse = (comparison.shown or comparison.phases) and 0 < comparison.judgement.ratio < 1
    ends = (1 / high if high else math.inf, 1 / low if low else math.inf) if inverse else (low, high)
    written = (
        number if comparison.verdict in {Verdict.EQUAL, Verdict.UNDECIDED} and not comparison.phases else factor_number
    )
    if math.isinf(ends[1]):
        return f"from {written(ends[0])} up, because a run failed"
    return f"{written(ends[0])} to {written(ends[1])}"


def failures_clause(comparison: Comparison, subject: str, baseline: str) -> str:
    """Return text with the number of failed runs and of outliers of both methods, and the bounds of the failure rates.

    For phases, the text contains no bounds. If no phase failed or is an outlier, the text is empty.
    """
    judgement, phases = comparison.judgement, comparison.phases
    if not any((*comparison.failed, *judgement.outlying)):
        return "" if phases else f"; {judgement.failure_rates}"
    counts = zip((subject, baseline), comparison.failed, judgement.outlying, strict=True)
    parts = [
        f"{name}: {failures_text(failed, locked, comparison.runs, bound=not phases)}"
        for name, failed, locked in counts
        if failed or locked
    ]
    return f"; {'; '.join(parts)}"


# The strongest findings of a study: pairs of methods that differ in one factor, compared over all scenarios.

REFERENCES = {"filter": _BASELINES, "adaptation": ("none",)}
"""For each factor, the reference values. The other values are compared with the first one that a study contains."""


def _references(values: Mapping[str, set[str]]) -> dict[str, str]:
    """Return the reference value of each factor of which ``values`` contains a reference value."""
    found = {factor: [name for name in REFERENCES[factor] if name in known] for factor, known in values.items()}
    return {factor: names[0] for factor, names in found.items() if names}


def strongest(standings: Sequence[Standing]) -> list[str]:
    """Return a sentence for each pair of methods that differ in one factor, sorted by decreasing difference.

    If the study contains the reference value of a factor (`REFERENCES`, such as adaptation "none"), each other value is
    compared with the reference value. Without a reference value, all pairs of values of the factor are compared.
    Methods that no chain of these comparisons connects are also compared, for example tuned methods, which differ in
    several factors. If a study has several scenarios, a sentence describes a pair of methods over all scenarios. Phases
    of one recording are not tested, so they have a sentence for each scenario.
    """
    informative = informative_standings(standings)
    pairs = method_pairs(informative)
    if len(informative) > 1 and pairs:
        return [pair_finding(pair) for pair in sorted(pairs, key=lambda pair: -pair.certain_size)]
    rivals = [rival for standing in informative for rival in standing.rivals]
    varying = [factor for k, factor in enumerate(FACTORS) if len({rival[k] for rival in rivals}) > 1]
    return [finding(pair, varying) for pair in sorted((p for one in informative for p in one.comparisons), key=_order)]


def informative_standings(standings: Sequence[Standing]) -> list[Standing]:
    """Return each scenario, reduced to the comparisons that the function `strongest` describes."""
    rivals = {rival for standing in standings for rival in standing.rivals}
    references = _references({factor: {getattr(rival, factor) for rival in rivals} for factor in REFERENCES})

    def of_one_factor(pair: Comparison) -> bool:
        values = zip(FACTORS, pair.subject, pair.baseline, strict=True)
        differ = [(factor, both) for factor, *both in values if both[0] != both[1]]
        return len(differ) == 1 and all(references.get(factor, both[0]) in both for factor, both in differ)

    informative = []
    for standing in standings:
        telling = {pair[:2] for pair in standing.comparisons if of_one_factor(pair)}
        connected = {rival: {rival} for rival in standing.rivals}
        for first, second in telling:
            joined = connected[first] | connected[second]
            connected.update(dict.fromkeys(joined, joined))
        pairs = standing.comparisons
        selected = (pair for pair in pairs if pair[:2] in telling or pair.baseline not in connected[pair.subject])
        informative.append(standing._replace(comparisons=tuple(selected)))
    return informative
