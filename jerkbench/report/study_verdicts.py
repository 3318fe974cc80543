"""The verdicts of a study: every two methods of a scenario, judged once, for tables and page alike."""

import itertools
import math
import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.judgement import LEVEL
from jerkbench.evaluation.over_seeds import Samples, costs_of
from jerkbench.evaluation.ranks import (
    critical_difference,
    kendall_tau,
    mean_ranks,
    over_scenarios,
    rank_cliques,
    rank_range,
)
from jerkbench.report.columns import (
    FACTORS,
    METHOD,
    TOLD_ATTITUDE,
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
from jerkbench.report.sweeps import at_best_noise
from jerkbench.report.table_model import number

if TYPE_CHECKING:
    import pandas as pd


Pair = tuple[Combination, Combination]
"""Subject and baseline."""


class StudyVerdicts(NamedTuple):
    """What a study shows of every two of its combinations, in one metric.

    Attributes:
        groups: runs of each combination.
        entered: runs of those that were compared: the same, or each method at its best noise.
        judged: the comparisons of the study's family.
        standings: each scenario with its contest.
        rule: how they were judged.
    """

    groups: Mapping[Combination, MethodRuns]
    entered: Mapping[Combination, MethodRuns]
    judged: Mapping[Pair, Comparison]
    standings: list[Standing]
    rule: VerdictRule

    def compare(self, pairs: Iterable[Pair]) -> list[Comparison]:
        """Return the comparisons of ``pairs``; those that are not in the study's family are one of their own."""
        pairs = list(pairs)
        outside = [(a, b) for a, b in pairs if (a, b) not in self.judged and (b, a) not in self.judged]
        others = compare_runs(((self.groups[a], self.groups[b]) for a, b in outside), self.rule)
        known = {**self.judged, **dict(zip(outside, others, strict=True))}
        return [known[pair] if pair in known else known[pair[::-1]].turned for pair in pairs]

    def against(self, baseline: Mapping[str, str]) -> list[Comparison]:
        """Return how every combination compares with its partner, which has the values of ``baseline``.

        Raises:
            JerkbenchError: no combination has them.
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

    What a method is made of varies among rivals, everything else is the scenario. The family has every two rivals of
    every scenario, and every reference (`competes`) with those from which it differs in one factor. Where the noise is
    a part of the method and there are more than ``most`` pairs, each method has the noise that its other seeds choose
    (`at_best_noise`); where there are still more, or of a metric whose lowest is not the best, there is no family.

    Args:
        rows: one row a cell and seed.
        metric: the column that is compared.
        method: factors that make a method; without them `METHOD`, or the attitude where it alone varies.
        rule: how to judge.
        most: pairs that are judged.

    Raises:
        JerkbenchError: there is no such metric.
    """
    rows, rule = checked(rows, metric), rule.of(rows)
    groups = runs_by_combination(rows, metric)
    if not quantity(metric).lowest_is_best:
        return StudyVerdicts(groups, groups, {}, [], rule)
    entered, varying = groups, [key for key in FACTORS if len(rows[key].unique()) > 1]
    only_attitudes = "attitude" in varying and not set(METHOD) & set(varying)
    method = tuple(method or (("attitude",) if only_attitudes else METHOD))
    fields = _fields(entered, method)
    if "noise" in method and _count(fields) > most:
        rows = at_best_noise(rows, metric)
        entered = runs_by_combination(rows, metric)
        fields = _fields(entered, method)
    pairs = [  # every two rivals, and every reference with what it differs from in one factor
        (a, b)
        for field in (fields if _count(fields) <= most else [])
        for a, b in itertools.combinations(field, 2)
        if (competes(a._asdict()) and competes(b._asdict())) or sum(map(operator.ne, a, b)) == 1
    ]
    comparisons = compare_runs(((entered[a], entered[b]) for a, b in pairs), rule)
    judged = dict(zip(pairs, comparisons, strict=True))
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    standings = [_standing(field, judged, method, varying) for field in fields]
    return StudyVerdicts(groups, entered, judged, standings, rule)


def is_rival(combination: Combination, method: Sequence[str]) -> bool:
    """Whether a combination competes with others; an attitude that is told the truth does not with attitudes."""
    told = "attitude" in method and combination.attitude.partition("(")[0] == TOLD_ATTITUDE
    return competes(combination._asdict()) and not told


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


def _fields(combinations: Iterable[Combination], method: Sequence[str]) -> list[list[Combination]]:
    """Return the combinations of each scenario."""
    fields: dict[Combination, list[Combination]] = {}
    for key in combinations:
        fields.setdefault(key._replace(**dict.fromkeys(method, "")), []).append(key)
    return list(fields.values())


def _count(fields: Iterable[Sequence[Combination]]) -> int:
    """Return about how many pairs there are, without making them."""
    return sum(math.comb(len(field), 2) for field in fields)


# Methods over all scenarios of a study: places and their range, ratios, mean ranks, agreement of metrics.

_TOLD = 5
"""So many methods are named."""

MIN_SCENARIOS = 5
"""Fewer scenarios do not tell how much scenarios differ: there is no mixed model."""

_OTHERS = ("velocity_rmse_mps", "position_max_m", "outage_rmse_m")
"""Metrics whose ranking is held against that of the leading one, where they have values."""


@dataclass(frozen=True, eq=False)
class CommonRuns:
    """The methods that ran in every scenario, on seeds that all have.

    Attributes:
        scenarios: names of the S scenarios.
        methods: names of the k methods.
        logs: (S, n, k) logarithms of the errors; infinite where the run was lost.
    """

    scenarios: tuple[str, ...]
    methods: tuple[str, ...]
    logs: FloatArray

    @cached_property
    def ranks(self) -> FloatArray:
        """(k,) mean ranks over the scenarios, by the tables' medians: a few runs that lock out do not decide them."""
        cells = Samples.of([np.exp(logs) for scenario in self.logs for logs in scenario.T])
        return mean_ranks(costs_of(cells).reshape(len(self.scenarios), -1))


def across(rows: "pd.DataFrame", verdicts: StudyVerdicts, metric: str) -> list[str]:
    """Return sentences about the methods over all scenarios; none of fewer than two scenarios or methods."""
    field = common_field(verdicts)
    if field is None:
        return []
    return [_places(field), *_ratios(field), _ranks(field), *_agreement(rows, field, metric)]


def common_field(verdicts: StudyVerdicts) -> CommonRuns | None:
    """Return the methods that every scenario has, on common seeds; None of fewer than two, and of phases."""
    runs = [
        {standing.name(rival): verdicts.entered[rival] for rival in standing.rivals} for standing in verdicts.standings
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
    if not (errors > 0).all():  # an error of 0, or a metric that did not apply, has no logarithm
        return None
    scenarios = tuple(", ".join(standing.scenario) for standing in verdicts.standings)
    return CommonRuns(scenarios, tuple(methods), np.log(errors))


def _places(field: CommonRuns) -> str:
    ranges = rank_range(field.logs)
    order = np.argsort(ranges.place, kind="stable")[:_TOLD]
    places = [f"{field.methods[k]} {ranges.place[k]} ({ranges.low[k]} to {ranges.high[k]})" for k in order]
    more = f", and {len(field.methods) - _TOLD} others" if len(field.methods) > _TOLD else ""
    return (
        f"Places over {len(field.scenarios)} scenarios by geometric mean, with their 95 % range over other scenarios "
        f"of this kind and other seeds (bootstrap): {', '.join(places)}{more}."
    )


def _ratios(field: CommonRuns) -> Iterator[str]:
    """Say how the first compares with the second and with the last, of methods that lost no run.

    These two are chosen by the errors that are tested. The intervals therefore hold for all pairs at once (Bonferroni).
    """
    if len(field.scenarios) < MIN_SCENARIOS:
        return
    pairs = math.comb(len(field.methods), 2)
    means = field.logs.mean(axis=(0, 1))
    whole = [k for k in np.argsort(means, kind="stable") if math.isfinite(means[k])]
    for k in dict.fromkeys((whole[1], whole[-1])) if len(whole) > 1 else ():
        model = over_scenarios(field.logs[:, :, whole[0]] - field.logs[:, :, k], 1 - LEVEL / pairs)
        yield (
            f"{field.methods[whole[0]]} over {field.methods[k]}: {number(model.ratio)} times (95 % {number(model.low)} "
            f"to {number(model.high)} for all {pairs} pairs at once, mixed model of scenarios and seeds), at worst "
            f"{number(model.worst_ratio)} times on {field.scenarios[model.worst]}."
        )


def _ranks(field: CommonRuns) -> str:
    """Say from which difference of mean ranks on methods differ, and whom the first cannot be told from."""
    ranks = field.ranks
    least = critical_difference(len(ranks), len(field.scenarios))
    first = int(np.argmin(ranks))
    groups = [group for group in rank_cliques(ranks, least) if first in group]
    near = [f"{field.methods[k]} {ranks[k]:.1f}" for k in (groups[0][:_TOLD] if groups else [first])]
    more = f", and {len(groups[0]) - _TOLD} others" if groups and len(groups[0]) > _TOLD else ""
    alone = "the first is alone" if len(near) == 1 else "not told apart from the first"
    return f"Mean ranks differ from {least:.1f} on (Nemenyi, 5 %); {alone}: {', '.join(near)}{more}."


def _agreement(rows: "pd.DataFrame", field: CommonRuns, metric: str) -> Iterator[str]:
    """Say whether other metrics rank the methods alike."""
    told = []
    for other in _OTHERS:
        if other == metric or other not in rows or rows[other].isna().all():
            continue
        second = common_field(study_verdicts(rows, other, most=0))  # its places alone, nothing is judged
        if second is None or second.methods != field.methods:
            continue
        tau, p = kendall_tau(field.ranks, second.ranks)
        if math.isfinite(tau):
            told.append(f"{quantity(other).title} {tau:.2f} (p {number(p)})")
    if told:
        yield f"Kendall's tau of the mean ranks by {quantity(metric).title} with those by: {', '.join(told)}."
