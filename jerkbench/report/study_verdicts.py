"""The verdicts of a study: all pairs of methods of each scenario, tested once for all tables and the report."""

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
    """The comparisons of a study in one metric.

    Attributes:
        groups: runs of each combination.
        judged: comparisons that are tested together as one family, by the pair of combinations.
        standings: competing combinations (rivals) of each scenario, and their comparisons.
        rule: margin and level of the verdicts.
    """

    groups: Mapping[Combination, MethodRuns]
    judged: Mapping[Pair, Comparison]
    standings: list[Standing]
    rule: VerdictRule

    def compare(self, pairs: Iterable[Pair]) -> list[Comparison]:
        """Return the comparisons of ``pairs``. Pairs that are not in ``judged`` are tested as a separate family."""
        pairs = list(pairs)
        outside = [(a, b) for a, b in pairs if (a, b) not in self.judged and (b, a) not in self.judged]
        others = compare_runs(((self.groups[a], self.groups[b]) for a, b in outside), self.rule)
        known = {**self.judged, **dict(zip(outside, others, strict=True))}
        return [known[pair] if pair in known else known[pair[::-1]].swapped for pair in pairs]

    def against(self, baseline: Mapping[str, str]) -> list[Comparison]:
        """Return the comparison of each combination with its partner for this ``baseline`` (see `partners`).

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

    The rivals of a scenario differ only in the factors of a method. All factors that do not define a method define the
    scenario. The comparisons of all pairs of rivals in all scenarios form one family. The family also contains each
    pair of a reference method (see `competes`) and another combination, if both differ in only one factor.

    If there are more than ``most`` pairs, or if the best value of the metric is not the lowest value, nothing is
    compared.

    Args:
        rows: one row for each combination and seed.
        metric: column that is compared.
        method: factors that define a method. The default is `METHOD`, or the attitude if the attitude varies and no
            factor of `METHOD` varies.
        rule: margin and level of the verdicts.
        most: maximum number of pairs that are compared.

    Raises:
        JerkbenchError: the metric is unknown.
    """
    rows, rule = checked(rows, metric), rule.of(rows)
    groups = runs_by_combination(rows, metric)
    if not quantity(metric).lowest_is_best:
        return StudyVerdicts(groups, {}, [], rule)
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    only_attitudes = "attitude" in varying and not set(METHOD) & set(varying)
    method = tuple(method or (("attitude",) if only_attitudes else METHOD))
    fields: dict[Combination, list[Combination]] = {}  # the combinations of each scenario
    for key in groups:
        fields.setdefault(key._replace(**dict.fromkeys(method, "")), []).append(key)
    few = sum(math.comb(len(field), 2) for field in fields.values()) <= most  # an upper bound of the number of pairs
    pairs = [  # all pairs of rivals, and pairs of a reference and a combination that differ in one factor
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
    """Return whether a combination competes. The reference attitude does not compete with estimated attitudes."""
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


# Methods over all scenarios of a study: ranks and their ranges, and ratios of two methods.

_MAX_METHODS = 5
"""Maximum number of methods that the sentence about ranks lists."""

MIN_SCENARIOS = 5
"""Minimum number of scenarios for the mixed model. With fewer, the variance between scenarios is too uncertain."""


CommonRuns = tuple[list[str], list[str], FloatArray]
"""Names of S scenarios, names of k methods, and the logarithms (S, n, k) of the errors on n common seeds.

The logarithm is infinite for failed runs.
"""


def across(verdicts: StudyVerdicts) -> list[str]:
    """Return sentences that compare the methods over all scenarios, or an empty list if `common_runs` returns None.

    Two of the sentences compare the best method with the second best and the worst method. Only methods without failed
    runs are considered. The methods are ranked by the same errors from which the intervals are computed. The intervals
    are therefore corrected for all pairs of methods (Bonferroni).
    """
    common = common_runs(verdicts)
    if common is None:
        return []
    scenarios, methods, logs = common
    ranges = rank_range(logs)
    order = np.argsort(ranges.rank, kind="stable")[:_MAX_METHODS]
    places = [f"{methods[k]} {ranges.rank[k]} ({ranges.low[k]} to {ranges.high[k]})" for k in order]
    more = f", and {len(methods) - _MAX_METHODS} others" if len(methods) > _MAX_METHODS else ""
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
    """Return the errors of the methods that ran in all scenarios, on their common seeds.

    Return None for fewer than two scenarios or methods, without a common seed, for phases, and if an error is 0 or
    missing.
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
    if not (errors > 0).all():  # 0 and NaN have no finite logarithm
        return None
    return [", ".join(standing.scenario) for standing in verdicts.standings], methods, np.log(errors)
