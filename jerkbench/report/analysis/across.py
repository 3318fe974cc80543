"""Methods over all scenarios of a study: places and their range, ratios, mean ranks, agreement of metrics."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.judgement import LEVEL
from jerkbench.evaluation.statistics.ranks import (
    critical_difference,
    kendall_tau,
    mean_ranks,
    over_scenarios,
    rank_cliques,
    rank_range,
)
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.study_verdicts import StudyVerdicts, study_verdicts
from jerkbench.report.tables.table_model import number

if TYPE_CHECKING:
    import pandas as pd

TOLD = 5
"""So many methods are named."""

LEAST_SCENARIOS = 5
"""Fewer scenarios do not tell how much scenarios differ: there is no mixed model."""

OTHERS = ("velocity_rmse_mps", "position_max_m", "outage_rmse_m")
"""Metrics whose ranking is held against that of the leading one, where they have values."""


@dataclass(frozen=True, eq=False)
class Field:
    """The methods that ran in every scenario, on seeds that all have.

    Attributes:
        scenarios: names of the S scenarios.
        methods: names of the k methods.
        logs: (S, n, k) logarithms of the errors; infinite where the run was lost.
    """

    scenarios: tuple[str, ...]
    methods: tuple[str, ...]
    logs: FloatArray


def across(rows: "pd.DataFrame", verdicts: StudyVerdicts, metric: str) -> list[str]:
    """Return sentences about the methods over all scenarios; none of fewer than two scenarios or methods."""
    field = common_field(verdicts)
    if field is None:
        return []
    return [_places(field), *_ratios(field), _ranks(field), *_agreement(rows, field, metric)]


def common_field(verdicts: StudyVerdicts) -> Field | None:
    """Return the methods that every scenario has, on common seeds; None of fewer than two, and of phases."""
    runs = [
        {standing.name(rival): verdicts.entered[rival] for rival in standing.contest.rivals}
        for standing in verdicts.standings
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
    return Field(scenarios, tuple(methods), np.log(errors))


def _places(field: Field) -> str:
    ranges = rank_range(field.logs)
    order = np.argsort(ranges.place, kind="stable")[:TOLD]
    places = [f"{field.methods[k]} {ranges.place[k]} ({ranges.low[k]} to {ranges.high[k]})" for k in order]
    return (
        f"Places over {len(field.scenarios)} scenarios by geometric mean, with their 95 % range over other scenarios "
        f"of this kind and other seeds (bootstrap): {', '.join(places)}{_more(field)}."
    )


def _more(field: Field) -> str:
    return f", and {len(field.methods) - TOLD} others" if len(field.methods) > TOLD else ""


def _ratios(field: Field) -> Iterator[str]:
    """Say how the first compares with the second and with the last, of methods that lost no run.

    These two are chosen by the errors that are tested. The intervals therefore hold for all pairs at once (Bonferroni).
    """
    if len(field.scenarios) < LEAST_SCENARIOS:
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


def _ranks(field: Field) -> str:
    """Say from which difference of mean ranks on methods differ, and whom the first cannot be told from."""
    ranks = mean_ranks(field.logs.mean(axis=1))
    least = critical_difference(len(ranks), len(field.scenarios))
    first = int(np.argmin(ranks))
    groups = [group for group in rank_cliques(ranks, least) if first in group]
    near = [f"{field.methods[k]} {ranks[k]:.1f}" for k in (groups[0][:TOLD] if groups else [first])]
    more = f", and {len(groups[0]) - TOLD} others" if groups and len(groups[0]) > TOLD else ""
    alone = "the first is alone" if len(near) == 1 else "not told apart from the first"
    return f"Mean ranks differ from {least:.1f} on (Nemenyi, 5 %); {alone}: {', '.join(near)}{more}."


def _agreement(rows: "pd.DataFrame", field: Field, metric: str) -> Iterator[str]:
    """Say whether other metrics rank the methods alike."""
    told = []
    for other in OTHERS:
        if other == metric or other not in rows or rows[other].isna().all():
            continue
        second = common_field(study_verdicts(rows, other, most=0))  # its places alone, nothing is judged
        if second is None or second.methods != field.methods:
            continue
        tau, p = kendall_tau(*(mean_ranks(of.logs.mean(axis=1)) for of in (field, second)))
        if math.isfinite(tau):
            told.append(f"{quantity(other).title} {tau:.2f} (p {number(p)})")
    if told:
        yield f"Kendall's tau of the mean ranks by {quantity(metric).title} with those by: {', '.join(told)}."
