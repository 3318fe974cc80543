"""The verdicts of a study. All pairs of methods are tested once, and all tables and the report use these verdicts."""

import itertools
import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.judgement import LEVEL
from jerkbench.evaluation.ranks import (
    over_scenarios,
    rank_range,
)
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
    Comparison,
    MethodRuns,
    Standing,
    VerdictRule,
    compare_runs,
    partners,
    runs_by_combination,
)
from jerkbench.report.table_model import number

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


# Comparison of methods over all scenarios of a study: ranks with confidence ranges, and error ratios.

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
