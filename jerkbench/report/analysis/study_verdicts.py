"""The verdicts of a study: every two methods of a scenario, judged once, for tables and page alike."""

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.report.analysis.baseline import partners
from jerkbench.report.analysis.best_noise import at_best_noise
from jerkbench.report.analysis.comparison import Comparison, judged_pairs
from jerkbench.report.analysis.factors import FACTORS, default_method
from jerkbench.report.analysis.leading import contest
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.references import attitude_competes, competes
from jerkbench.report.analysis.rows import checked
from jerkbench.report.analysis.rule import RULE, Rule
from jerkbench.report.analysis.runs import Combination, Runs, grouped, paired
from jerkbench.report.analysis.standings import MOST_PAIRS, Standing

if TYPE_CHECKING:
    import pandas as pd

Two = tuple[Combination, Combination]
"""Subject and baseline."""


@dataclass(frozen=True, eq=False)
class StudyVerdicts:
    """What a study shows of every two of its combinations, in one metric.

    Attributes:
        groups: runs of each combination.
        entered: runs of those that were compared: the same, or each method at its best noise.
        judged: the comparisons of the study's family.
        standings: each scenario with its contest.
        rule: how they were judged.
    """

    groups: Mapping[Combination, Runs]
    entered: Mapping[Combination, Runs]
    judged: Mapping[Two, Comparison]
    standings: list[Standing]
    rule: Rule

    def compare(self, pairs: Iterable[Two]) -> list[Comparison]:
        """Return the comparisons of ``pairs``; those that are not in the study's family are one of their own."""
        pairs = list(pairs)
        outside = [(a, b) for a, b in pairs if (a, b) not in self.judged and (b, a) not in self.judged]
        others = judged_pairs(paired((self.groups[a], self.groups[b]) for a, b in outside), self.rule)
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
    rule: Rule = RULE,
    most: int = MOST_PAIRS,
) -> StudyVerdicts:
    """Return the verdicts of a study.

    What a method is made of varies among rivals, everything else is the scenario. The family has every two rivals of
    every scenario, and every reference (`competes`) with those from which it differs in one factor. Where the noise is
    a part of the method and there are more than ``most`` pairs, each method has the noise that its other seeds choose
    (`at_best_noise`); where there are still more, or of a metric whose lowest is not the best, there is no family.

    Args:
        rows: one row a cell and seed.
        metric: the column that is compared.
        method: factors that make a method; without them `default_method`.
        rule: how to judge.
        most: pairs that are judged.

    Raises:
        JerkbenchError: there is no such metric.
    """
    rows, rule = checked(rows, metric), rule.of(rows)
    groups = grouped(rows, metric)
    if not quantity(metric).lowest_is_best:
        return StudyVerdicts(groups, groups, {}, [], rule)
    method = tuple(method or default_method(rows))
    entered = groups
    if "noise" in method and _count(groups, method) > most:
        rows = at_best_noise(rows, metric)
        entered = grouped(rows, metric)
    fields = _fields(entered, method)
    pairs = [pair for field in fields for pair in _pairs(field)] if _count(entered, method) <= most else []
    comparisons = judged_pairs(paired((entered[a], entered[b]) for a, b in pairs), rule)
    judged = dict(zip(pairs, comparisons, strict=True))
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    standings = [_standing(field, judged, method, varying) for field in fields]
    return StudyVerdicts(groups, entered, judged, standings, rule)


def rival(combination: Combination, method: Sequence[str]) -> bool:
    """Whether a combination competes with others; an attitude that is told the truth does not with attitudes."""
    values = dict(zip(FACTORS, combination, strict=True))
    return competes(values) and ("attitude" not in method or attitude_competes(values["attitude"]))


def _standing(
    field: Sequence[Combination], judged: Mapping[Two, Comparison], method: Sequence[str], varying: Sequence[str]
) -> Standing:
    rivals = [key for key in field if rival(key, method)]
    comparisons = [judged[pair] for pair in itertools.combinations(rivals, 2) if pair in judged]
    scenario = zip(FACTORS, (rivals or field)[0], strict=True)
    return Standing(
        scenario=tuple(value for key, value in scenario if key not in method and key in varying),
        method=tuple(key for key in FACTORS if key in method and key in varying) or tuple(method),
        contest=contest(rivals, comparisons),
    )


def _pairs(field: Sequence[Combination]) -> Iterator[Two]:
    """Yield every two rivals, and every reference with what it differs from in one factor."""
    for a, b in itertools.combinations(field, 2):
        both = all(competes(dict(zip(FACTORS, key, strict=True))) for key in (a, b))
        if both or sum(ours != theirs for ours, theirs in zip(a, b, strict=True)) == 1:
            yield a, b


def _fields(combinations: Iterable[Combination], method: Sequence[str]) -> list[list[Combination]]:
    """Return the combinations of each scenario."""
    fields: dict[Combination, list[Combination]] = {}
    for key in combinations:
        fields.setdefault(_scenario(key, method), []).append(key)
    return list(fields.values())


def _scenario(key: Combination, method: Sequence[str]) -> Combination:
    return tuple("" if name in method else value for name, value in zip(FACTORS, key, strict=True))


def _count(combinations: Iterable[Combination], method: Sequence[str]) -> int:
    """Return about how many pairs there are, without making them."""
    counts = Counter(_scenario(key, method) for key in combinations)
    return sum(count * (count - 1) // 2 for count in counts.values())
