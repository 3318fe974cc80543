"""Scenario by scenario: which methods lead, and how every two of them compare."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.best_noise import at_best_noise
from jerkbench.report.analysis.comparison import RULE, Combination, Rule, grouped
from jerkbench.report.analysis.factors import FACTORS, METHOD
from jerkbench.report.analysis.leading import MOST_PAIRS, Contest, contests
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.references import competes
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Standing:
    """One scenario.

    Attributes:
        scenario: values of the factors that make it, of those that vary.
        method: factors that make a method, of those that vary.
        contest: who leads.
    """

    scenario: tuple[str, ...]
    method: tuple[str, ...]
    contest: Contest

    def name(self, combination: Combination) -> str:
        """Return the name of a method."""
        values = dict(zip(FACTORS, combination, strict=True))
        return "+".join(values[key] for key in self.method)

    @property
    def leaders(self) -> list[str]:
        """Names of those whom nobody was shown to beat."""
        return [self.name(one) for one in self.contest.leaders]


def parse_method(text: str) -> tuple[str, ...]:
    """Read ``factor,factor``.

    Raises:
        JerkbenchError: there is no such factor, or none.
    """
    keys = tuple(word.strip() for word in text.split(",") if word.strip())
    for key in keys:
        if key not in FACTORS:
            raise JerkbenchError(unknown("factor", key, FACTORS))
    if not keys:
        raise JerkbenchError("A method is made of at least one factor, for example filter,adaptation,noise.")
    return keys


def standings(rows: "pd.DataFrame", metric: str, method: Sequence[str] = METHOD, rule: Rule = RULE) -> list[Standing]:
    """Return every scenario with its contest; all pairs of methods of all scenarios are one family.

    What a method is made of varies among rivals, everything else is the scenario. Where the noise is a part of it and
    there are more than `MOST_PAIRS` pairs, each method has the noise that its other seeds choose (`at_best_noise`).
    There is none of a metric whose lowest is not the best.

    Raises:
        JerkbenchError: there is no such metric.
    """
    rows, rule = checked(rows, metric), rule.of(rows)
    if not quantity(metric).lowest_is_best:
        return []
    if "noise" in method and _pairs(rows, method) > MOST_PAIRS:
        rows = at_best_noise(rows, metric)
    groups = grouped(rows, metric)
    fields = _fields(groups, method)
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    named = tuple(key for key in FACTORS if key in method and key in varying) or tuple(method)
    found = contests(groups, fields.values(), rule)
    return [
        Standing(_values(contest.rivals or field, method, varying), named, contest)
        for field, contest in zip(fields.values(), found, strict=True)
    ]


def _fields(groups: Iterable[Combination], method: Sequence[str]) -> dict[Combination, list[Combination]]:
    """Return the rivals of each scenario."""
    fields: dict[Combination, list[Combination]] = {}
    for key in groups:
        fields.setdefault(_scenario(key, method), []).append(key)
    return fields


def _scenario(key: Combination, method: Sequence[str]) -> Combination:
    return tuple("" if name in method else value for name, value in zip(FACTORS, key, strict=True))


def _values(field: Sequence[Combination], method: Sequence[str], varying: Sequence[str]) -> tuple[str, ...]:
    """Return the values of the scenario that tell it from others."""
    return tuple(value for key, value in zip(FACTORS, field[0], strict=True) if key not in method and key in varying)


def _pairs(rows: "pd.DataFrame", method: Sequence[str]) -> int:
    keys = {tuple(map(str, key)) for key in rows[[*FACTORS]].drop_duplicates().itertuples(index=False, name=None)}
    counts = Counter(_scenario(key, method) for key in keys if competes(dict(zip(FACTORS, key, strict=True))))
    return sum(count * (count - 1) // 2 for count in counts.values())


def summary(found: Sequence[Standing]) -> list[str]:
    """Return in sentences who leads how often, and how many pairs of methods are what."""
    decided = [one for one in found if one.contest.decided]
    verdicts = Counter(pair.verdict for one in found for pair in one.contest.comparisons if pair.judgement.n)
    if not verdicts:
        many = any(len(one.contest.rivals) > 1 and not one.contest.comparisons for one in found)
        return [f"Who leads is not tested: there are more than {MOST_PAIRS} pairs of methods."] if many else []
    return [*_leading(decided, len(found)), _counts(verdicts, found)]


def _leading(decided: Sequence[Standing], scenarios: int) -> list[str]:
    """Say who leads in which number of scenarios."""
    if not decided:
        return ["Nobody leads: no method was shown to be worse than another."]
    counts = Counter(name for one in decided for name in one.leaders)
    if scenarios == 1:
        return [f"In the lead: {', '.join(counts)}."]
    told = ", ".join(f"{name} in {count}" for name, count in counts.most_common(5))
    more = f", and {len(counts) - 5} others in fewer" if len(counts) > 5 else ""
    return [f"In the lead, of {scenarios} scenarios: {told}{more}."]


def _counts(verdicts: "Counter[Verdict]", found: Sequence[Standing]) -> str:
    """Say how many pairs are decided, equal and undecided."""
    margin = next(pair.rule.margin for one in found for pair in one.contest.comparisons)
    total = verdicts.total()
    equal, undecided = verdicts[Verdict.EQUAL], verdicts[Verdict.UNDECIDED]
    lost = verdicts[Verdict.FEWER_LOST] + verdicts[Verdict.MORE_LOST]
    parts = [
        (total - equal - undecided - lost, "differ"),
        (lost, "differ in the runs they lose"),
        (equal, f"are equal within {100 * margin:g} %"),
        (undecided, "are undecided"),
    ]
    return f"Of {total} pairs of methods " + ", ".join(f"{count} {words}" for count, words in parts if count) + "."
