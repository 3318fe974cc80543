"""The verdicts of a study, and generated text: the main result, and comparisons of methods in and over scenarios.

All pairs of methods are tested once, and all tables and the report use these verdicts.
"""

import itertools
import math
import operator
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.drives_and_tunings import over_scenarios, rank_range
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.judgement import BY_FAILURES, LEVEL, Judgement, Verdict
from jerkbench.report.columns import (
    FACTORS,
    METHOD,
    REFERENCE_ATTITUDE,
    checked,
    competes,
    quantity,
    varying_factors,
)
from jerkbench.report.comparisons import (
    MAX_PAIRS,
    RULE,
    UNTESTED,
    Comparison,
    MethodRuns,
    Standing,
    VerdictRule,
    compare_runs,
    failures_range,
    partners,
    runs_by_combination,
)
from jerkbench.report.labels import TUNED_SUFFIX
from jerkbench.report.table_model import factor_number, first_of, number, range_text

if TYPE_CHECKING:
    import pandas as pd


Pair = tuple[Combination, Combination]
"""The subject and the baseline of a comparison."""


class StudyVerdicts(NamedTuple):
    """All comparisons of the methods of a study for one metric.

    Attributes:
        groups: runs of each combination.
        judged: comparisons whose tests are corrected together (one family), by the pair of combinations.
        standings: for each scenario, the competing combinations (rivals) and their comparisons.
        rule: margin and level of the verdicts.
    """

    groups: Mapping[Combination, MethodRuns]
    judged: Mapping[Pair, Comparison]
    standings: list[Standing]
    rule: VerdictRule

    def compare(self, pairs: Iterable[Pair]) -> list[Comparison]:
        """Return the comparisons of ``pairs``. The tests of pairs outside ``judged`` are corrected separately."""
        pairs = list(pairs)
        outside = [(a, b) for a, b in pairs if (a, b) not in self.judged and (b, a) not in self.judged]
        others = compare_runs(((self.groups[a], self.groups[b]) for a, b in outside), self.rule)
        known = {**self.judged, **dict(zip(outside, others, strict=True))}
        return [known[pair] if pair in known else known[pair[::-1]].swapped for pair in pairs]

    def against(self, baseline: Mapping[str, str]) -> list[Comparison]:
        """Return the comparison of each combination with its partner, which has the values of ``baseline``.

        Raises:
            JerkbenchError: no combination has the values of ``baseline``.
        """
        return self.compare(partners(self.groups, baseline))


def study_verdicts(
    rows: "pd.DataFrame",
    metric: str,
    method: Sequence[str] | None = None,
    rule: VerdictRule = RULE,
    most: int = MAX_PAIRS,
) -> StudyVerdicts:
    """Return the verdicts of a study.

    The factors that do not define a method define the scenario. The rivals of a scenario are the combinations that
    compete with each other, and differ only in the factors of a method. All pairs of rivals in all scenarios form one
    family, which means that their tests are corrected together. The family also contains pairs of a reference method
    (see `competes`) and another combination that differ in only one factor.

    Nothing is compared if there are more than ``most`` pairs, or if lower values of the metric are not better.

    Args:
        rows: one row for each combination and seed.
        metric: column of the metric that is compared.
        method: factors that define a method. The default is `METHOD`. If the attitude filter varies and no factor in
            `METHOD` varies, the default is the attitude filter.
        rule: margin and level of the verdicts.
        most: maximum number of pairs that are compared.

    Raises:
        JerkbenchError: the metric is unknown.
    """
    rows, rule = checked(rows, metric), rule.of(rows)
    groups = runs_by_combination(rows, metric)
    if not quantity(metric).lowest_is_best:
        return StudyVerdicts(groups, {}, [], rule)
    varying = varying_factors(rows)
    only_attitudes = "attitude" in varying and not set(METHOD) & set(varying)
    method = tuple(method or (("attitude",) if only_attitudes else METHOD))
    fields: dict[Combination, list[Combination]] = {}  # the combinations of each scenario
    for key in groups:
        fields.setdefault(key._replace(**dict.fromkeys(method, "")), []).append(key)
    few = sum(math.comb(len(field), 2) for field in fields.values()) <= most  # an upper bound of the number of pairs
    pairs = [  # pairs of rivals, and pairs with a reference method that differ in one factor
        (a, b)
        for field in fields.values()
        for a, b in itertools.combinations(field if few else (), 2)
        if (competes(a._asdict()) and competes(b._asdict())) or sum(map(operator.ne, a, b)) == 1
    ]
    comparisons = compare_runs(((groups[a], groups[b]) for a, b in pairs), rule)
    judged = dict(zip(pairs, comparisons, strict=True))
    standings = [_standing(field, judged, method, varying) for field in fields.values()]
    return StudyVerdicts(groups, judged, standings, rule)


def is_rival(combination: Combination, method: Sequence[str]) -> bool:
    """Return whether a combination competes. The true attitude does not compete with attitude filters."""
    is_reference = "attitude" in method and combination.attitude.partition("(")[0] == REFERENCE_ATTITUDE
    return competes(combination._asdict()) and not is_reference


def _standing(
    field: Sequence[Combination], judged: Mapping[Pair, Comparison], method: Sequence[str], varying: Sequence[str]
) -> Standing:
    rivals = tuple(key for key in field if is_rival(key, method))
    scenario = (rivals or tuple(field))[0]._asdict().items()
    pairs = itertools.combinations(rivals if judged else (), 2)
    return Standing(
        scenario=tuple(value for key, value in scenario if key not in method and key in varying),
        method=tuple(key for key in FACTORS if key in method and key in varying) or tuple(method),
        rivals=rivals,
        comparisons=tuple(judged[pair] for pair in pairs if pair in judged),
    )


# The comparison of methods over all scenarios of a study: ranks with confidence ranges, and error ratios.

_MAX_METHODS = 5
"""Maximum number of methods that the sentence about ranks lists."""

MIN_SCENARIOS = 5
"""Minimum number of scenarios for the mixed model. With fewer, the variance between scenarios is too uncertain."""


CommonRuns = tuple[list[str], list[str], FloatArray]
"""Names of S scenarios, names of k methods, and the logarithms (S, n, k) of the errors on n common seeds.

The logarithm is infinite for failed runs.
"""


def across(verdicts: StudyVerdicts) -> list[str]:
    """Return sentences that compare the methods over all scenarios. If `common_runs` returns None, the list is empty.

    The first sentence states ranks. Two sentences compare the best method without failed runs with the second best and
    with the worst method. The methods to compare are selected by the same errors from which the intervals are computed.
    Therefore, the intervals are corrected for the number of all pairs of methods (Bonferroni).
    """
    common = common_runs(verdicts)
    if common is None:
        return []
    scenarios, methods, logs = common
    ranges = rank_range(logs)
    order = np.argsort(ranges.rank, kind="stable")[:_MAX_METHODS]
    places = [f"{methods[k]} {ranges.rank[k]} ({ranges.low[k]} to {ranges.high[k]})" for k in order]
    more = f", and {len(methods) - _MAX_METHODS} more" if len(methods) > _MAX_METHODS else ""
    reading = "with their 95 % range for other scenarios of this kind and other seeds (bootstrap)"
    sentences = [f"Ranks over {len(scenarios)} scenarios by geometric mean, {reading}: {', '.join(places)}{more}."]
    pairs, means = math.comb(len(methods), 2), logs.mean(axis=(0, 1))
    complete = [k for k in np.argsort(means, kind="stable") if math.isfinite(means[k])]
    enough = len(complete) > 1 and len(scenarios) >= MIN_SCENARIOS
    for k in dict.fromkeys((complete[1], complete[-1])) if enough else ():
        model = over_scenarios(logs[:, :, complete[0]] - logs[:, :, k], 1 - LEVEL / pairs)
        sentences.append(
            f"{methods[complete[0]]} over {methods[k]}: {number(model.ratio)} times (95 % "
            f"{number(model.low)} to {number(model.high)} for all {pairs} pairs together, mixed model of scenarios and "
            f"seeds), at worst {number(model.worst_ratio)} times on {scenarios[model.worst]}."
        )
    return sentences


def common_runs(verdicts: StudyVerdicts) -> CommonRuns | None:
    """Return the errors, on all common seeds, of the methods that ran in all scenarios.

    Return None if the study has fewer than two scenarios or methods, no common seed, phases instead of seeds, or an
    error that is 0 or missing.
    """
    runs = [
        {standing.name(rival): verdicts.groups[rival] for rival in standing.rivals} for standing in verdicts.standings
    ]
    if len(runs) < 2 or any(of.phases for scenario in runs for of in scenario.values()):
        return None
    methods = [name for name in runs[0] if all(name in scenario for scenario in runs)]
    seeds = set.intersection(*(set(of.seeds.tolist()) for scenario in runs for of in scenario.values()))
    if len(methods) < 2 or not seeds:
        return None
    errors = np.array(
        [[scenario[name].errors[np.isin(scenario[name].seeds, list(seeds))] for name in methods] for scenario in runs]
    ).transpose(0, 2, 1)
    if not (errors > 0).all():  # the logarithm of 0 or NaN is not finite
        return None
    return [", ".join(standing.scenario) for standing in verdicts.standings], methods, np.log(errors)


# The size of a significant difference.

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
    judgements = [pair.judgement for standing in tested for pair in standing.tested]
    seeds = range_text([judgement.n for judgement in judgements])
    basis = f"Each comparison uses {seeds} seeds; {failures_range(judgements)}."
    undecided = [", ".join(standing.scenario) for standing in tested if not standing.decided]
    if len(undecided) == len(tested):
        return Answer(_title_without_leader(tested), (basis,))
    sentences = [f"No significant difference between competing methods on {_named(undecided)}."] if undecided else []
    return Answer(_title_of_leaders(tested), (*sentences, basis))


def _title_without_leader(tested: Sequence[Standing]) -> str:
    methods = len(rival_names(tested))
    verdicts, rule = {pair.verdict for standing in tested for pair in standing.tested}, tested[0].tested[0].rule
    if verdicts <= {Verdict.EQUAL, Verdict.SMALL}:
        every = "Both" if methods == 2 else f"All {methods}"
        return f"{every} methods {rule.small if Verdict.SMALL in verdicts else f'are {rule.equal}'}"
    where = f" in any of {len(tested)} scenarios" if len(tested) > 1 else ""
    return f"None of {methods} methods is significantly better than another{where}"


def _title_of_leaders(tested: Sequence[Standing]) -> str:
    """Return the title of a study in which at least one scenario has best methods.

    The title names the methods that are the only best method in most scenarios. If no scenario has an only best method,
    the title names the methods that share the lead in most scenarios.
    """
    names, reference = rival_names(tested), reference_method(tested)
    best = [standing.leaders for standing in tested if standing.decided]
    sole, shared = Counter(of[0] for of in best if len(of) == 1), Counter(name for of in best for name in of)
    compared = [against(standing, reference) for standing in tested]
    most = max((sole[name], shared[name]) for name in names)
    leaders = [name for name in names if (sole[name], shared[name]) == most]
    leaders.sort(key=lambda name: mean_log_ratio(compared, name))
    ending = "s" if len(leaders) == 1 else ""
    claim, count = (f"lead{ending}", most[0]) if most[0] else (f"share{ending} the lead", most[1])
    of = f" in {count} of {len(tested)} scenarios" if len(tested) > 1 else ""
    title = f"Of {len(names)} methods, {_named(leaders)} {claim}{of}"
    other = next(name for name in names if name != leaders[0]) if len(names) == 2 else reference
    pairs = [pairs[leaders[0]] for standing in tested if leaders[0] in (pairs := against(standing, other))]
    better = [pair.judgement for pair in pairs if pair.verdict is Verdict.BETTER]
    times = max(better, key=certain_size).swapped.ratio if better else math.inf
    if math.isinf(times) or times <= 0:
        return title
    who = " and is" if len(leaders) == 1 else f"; {leaders[0]} is"
    return f"{title}{who} {'up to ' if len(pairs) > 1 else ''}{factor_number(times)} times better than {other}"


def rival_names(tested: Iterable[Standing]) -> list[str]:
    """Return the names of all competing methods, in order of first appearance."""
    return list(dict.fromkeys(standing.name(rival) for standing in tested for rival in standing.rivals))


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


def _named(names: Sequence[str]) -> str:
    """Return text with the first `_NAMED` names, and the number of names that are left out."""
    if len(names) > _NAMED:
        return first_of(names, _NAMED)
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


# Findings: sentences about the comparisons with the baselines of a study.


def findings(
    rows: "pd.DataFrame", verdicts: StudyVerdicts, baseline: Mapping[str, str] | None = None, *, every: bool = False
) -> list[str]:
    """Return a sentence for each comparison with ``baseline``, sorted by decreasing size of the difference.

    If ``baseline`` is None, the baselines are ``adaptation=none`` and ``filter=baseline``, and all other pairs of
    methods are included if ``every`` is True or if the study has no run with such a baseline. The result is empty for a
    metric for which lower values are not better.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    baselines = [baseline] if baseline else study_baselines(rows)
    found = [pair for values in baselines if verdicts.standings for pair in verdicts.against(values)]
    if (every and not baseline) or not found:
        pairs = [*found, *(pair for standing in verdicts.standings for pair in standing.comparisons)]
        found = list({frozenset((pair.subject, pair.baseline)): pair for pair in reversed(pairs)}.values())
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
    judgement = comparison.judgement
    failed = f"; {judgement.failure_rates}"
    if comparison.phases:
        failed = f"; {' and '.join(map(str, comparison.failed))} phases failed" * any(comparison.failed)
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
        return f"{subject} {comparison.verdict.value} than {baseline}{where} ({count}){failed}."
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


REFERENCES = {"adaptation": ("none",), "filter": _BASELINES}
"""For each factor, the reference values. The other values are compared with the first one that a study contains."""


def study_baselines(rows: "pd.DataFrame", factors: Sequence[str] = ("adaptation", "filter")) -> list[dict[str, str]]:
    """Return a baseline for each factor of which the study contains a reference value (`REFERENCES`) and others."""
    values = {factor: set(rows[factor].astype(str)) for factor in factors}
    found = {factor: [name for name in REFERENCES[factor] if name in known] for factor, known in values.items()}
    return [{factor: names[0]} for factor, names in found.items() if names and len(values[factor]) > 1]


def method_names(comparison: Comparison, varying: Sequence[str]) -> tuple[str, str, str]:
    """Return the names of both compared methods, and the text " on SCENARIO" with the name of the scenario.

    The name of a method contains the labels of all factors in which the two methods differ, and the filter and the
    adaptation if they vary in the study. The name of the scenario contains the labels of all other varying factors.
    """
    differ = [key for key, a, b in zip(FACTORS, comparison.subject, comparison.baseline, strict=True) if a != b]
    named = [key for key in FACTORS if key in differ or (key in ("filter", "adaptation") and key in varying)]
    where = ", ".join(getattr(comparison.subject, key) for key in varying if key not in named)
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
    differs = comparison.phases or comparison.verdict not in {Verdict.EQUAL, Verdict.UNDECIDED}
    written = factor_number if differs else number
    if math.isinf(ends[1]):
        return f"from {written(ends[0])} up, because a run failed"
    return f"{written(ends[0])} to {written(ends[1])}"
