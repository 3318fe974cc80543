"""Comparison of two studies: changes of a metric, gate for CI, and output formats."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import JerkbenchError, NotComparableError
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import failure_bound
from jerkbench.evaluation.judgement import Judgement, Verdict
from jerkbench.jobs.study import Study
from jerkbench.report.columns import checked, quantity
from jerkbench.report.comparisons import (
    RULE,
    MethodRuns,
    VerdictRule,
    compare_runs,
    on_common_seeds,
    runs_by_combination,
)
from jerkbench.report.labels import DECIDING_SCORES, LABELLED_PARTS, Conditions, conditions, differing_conditions
from jerkbench.report.table_model import factor_number, first_of, number
from jerkbench.report.terminal import print_grid
from jerkbench.report.writers import markdown_grid

if TYPE_CHECKING:
    import pandas as pd


_Name = TypeVar("_Name")
_Value = TypeVar("_Value")

SINGLE_RUN_LIMIT = 10.0
"""The gate for continuous integration fails if the error of any run increases by more than this factor."""


class Change(NamedTuple):
    """The change of the metric of one combination from a first to a second set of results.

    Attributes:
        first: runs of the first set. If the two sets have common seeds, ``first`` contains only the runs with these
            seeds.
        second: runs of the second set. If the two sets have common seeds, ``second`` contains only the runs with these
            seeds.
        judgement: statistical comparison of the second set with the first set, corrected for the number of
            combinations. Without common seeds, the verdict is undecided.
        rule: margin and level of the verdict.
        paired: whether the two sets have common seeds.
        absent: number of seeds of the first set that are missing in the second set, or 0 if the sets have no common
            seed.
    """

    first: MethodRuns
    second: MethodRuns
    judgement: Judgement
    rule: VerdictRule
    paired: bool
    absent: int

    @property
    def values(self) -> tuple[FloatArray, FloatArray]:
        """The values of the metric in the first and in the second set.

        The value of a run that diverged or failed is NaN.
        """
        first, second = (np.where(runs.failed, np.nan, runs.errors) for runs in (self.first, self.second))
        return first, second

    @property
    def runs(self) -> tuple[int, int]:
        """The numbers of runs in the first and in the second set."""
        return len(self.first.seeds), len(self.second.seeds)

    @property
    def failed(self) -> tuple[int, int]:
        """The numbers of runs that diverged or failed in the first and in the second set."""
        return int(self.first.failed.sum()), int(self.second.failed.sum())

    @property
    def same(self) -> bool:
        """True if both sets contain the same seeds, with the same values and the same failed runs."""
        failed = self.first.failed, self.second.failed
        return self.paired and np.array_equal(*self.values, equal_nan=True) and np.array_equal(*failed)

    @property
    def common(self) -> int:
        """The number of seeds for which both sets have a finite value of the metric."""
        first, second = map(np.isfinite, self.values)
        return int(sum(first & second)) if self.paired else 0

    @property
    def risen(self) -> BoolArray:
        """Mask of the runs whose metric increased from 0 or less, so that the ratio of both values is not defined."""
        first, second = self.values
        return (second > first) & (first <= 0) if self.paired else np.zeros(0, dtype=bool)

    def failures(self, percent: float) -> list[str]:
        """Return the reasons why the second set fails a gate that allows the metric to increase by ``percent`` percent.

        No statistical test is needed: the runs of both sets have the same seeds, so any difference is an effect of the
        changed code. In the geometric mean, the improvement of each run is limited to a factor of `SINGLE_RUN_LIMIT`.
        Therefore, a large improvement in a single run cannot compensate increases in all other runs.
        """
        if not self.paired:
            return []
        first, second = self.values
        with np.errstate(divide="ignore", invalid="ignore"):
            valued, found = [np.isfinite(values) for values in (first, second)], list[str]()
            ratios = np.where(valued[0] & valued[1] & (first > 0) & (second > 0), second / first, np.nan)
        n, bounded = (~np.isnan(ratios)).sum(), np.maximum(ratios, 1 / SINGLE_RUN_LIMIT)
        if n and (mean := float(np.exp(np.nanmean(np.log(bounded))))) > 1 + percent / 100:
            found.append(
                f"the geometric mean of {n} runs is {100 * (mean - 1):.3g} % larger than in A (allowed: {percent:g} %;"
                f" largest increase: {np.nanmax(ratios):.4g} times, seed {self.first.seeds[np.nanargmax(ratios)]})"
            )
        if (newly := self.second.failed & ~self.first.failed).any():
            where = self._seeds(newly)
            found.append(
                f"{self.failed[1]} of {self.runs[1]} runs diverged or failed in B, {self.failed[0]} in A {where}"
            )
        elif (missing := valued[0] & ~valued[1]).any():
            where = self._seeds(missing)
            found.append(f"{valued[1].sum()} of {self.runs[1]} runs have a value in B, {valued[0].sum()} in A {where}")
        if (ruined := ratios > SINGLE_RUN_LIMIT).any():
            found.append(
                f"{ruined.sum()} of {self.runs[1]} runs increased by more than {SINGLE_RUN_LIMIT:g} times, at most by"
                f" {np.nanmax(ratios):.4g} times {self._seeds(ruined)}"
            )
        if self.risen.any():
            found.append(f"{self.risen.sum()} of {self.runs[1]} runs increased from 0 {self._seeds(self.risen)}")
        return found

    def _seeds(self, where: BoolArray) -> str:
        seeds = [str(seed) for seed in self.first.seeds[where]]
        return f"(seed{'s' * (len(seeds) > 1)} {first_of(seeds, 5)})"

    @property
    def unjudged(self) -> str:
        """The reason why the gate cannot compare the two sets, or an empty text if the gate can compare the sets."""
        if not self.paired:
            return "A and B have no seed in common"
        if self.absent:
            return "runs of A are missing in B"
        return "" if self.same or self.common else "no seed has a value in both"

    @property
    def verdict(self) -> str:
        """Short text with the verdict of the comparison of the second set with the first set."""
        if self.same:
            return "identical"
        if not self.paired:
            return "no verdict (no common seed)"
        if self.risen.any() and not self.judgement.n:
            return "worse (it was 0)"
        if not self.common:
            return "no seed has a value in both"
        if self.first.phases:
            return "no test (phases of one recording)"
        verdict = self.judgement.verdict
        text = {Verdict.EQUAL: self.rule.equal, Verdict.SMALL: self.rule.small}.get(verdict, verdict.value)
        return text + (f", because {self.judgement.reason}" if self.judgement.reason else "")

    @property
    def failure_rates(self) -> str:
        """Text with the failure rates and their bounds, or an empty text for phases and without common values."""
        return "" if self.first.phases or not self.judgement.n else self.judgement.failure_rates


def changes(before: "pd.DataFrame", after: "pd.DataFrame", metric: str, rule: VerdictRule = RULE) -> list[Change]:
    """Return the change of ``metric`` for each combination that both sets contain.

    If each set has only one combination, these two combinations are compared even if their factors differ.

    Raises:
        JerkbenchError: the sets have no common combination, or lower values of the metric are not better.
    """
    if not quantity(metric).lowest_is_best:
        raise JerkbenchError(f"{metric} cannot be compared, because lower is not better; compare another metric.")
    first, second = (runs_by_combination(checked(rows, metric), metric) for rows in (before, after))
    both = [(ours, theirs) for _, ours, theirs in common_pairs(first, second)]
    if not both:
        counts = f"{len(first)} combinations of the first set, {len(second)} of the second set"
        raise NotComparableError(f"The two sets have no combination in common ({counts}).")
    compared = compare_runs(((second, first) for first, second in both), rule)
    return [_change(two, one.judgement, rule) for two, one in zip(both, compared, strict=True)]


def common_pairs(first: Mapping[_Name, _Value], second: Mapping[_Name, _Value]) -> list[tuple[_Name, _Value, _Value]]:
    """Return a tuple (name, first value, second value) for each name that two mappings have in common.

    If each mapping has only one name, these two names are paired even if they differ.
    """
    if len(first) == len(second) == 1:
        return list(zip(first, first.values(), second.values(), strict=True))
    return [(name, value, second[name]) for name, value in first.items() if name in second]


def _change(two: tuple[MethodRuns, MethodRuns], judgement: Judgement, rule: VerdictRule) -> Change:
    first, second = on_common_seeds(*two)
    if not len(first.seeds):
        return Change(*two, judgement, rule, paired=False, absent=0)
    return Change(first, second, judgement, rule, paired=True, absent=len(two[0].seeds) - len(first.seeds))


def change_rows(changed: Sequence[Change], varying: Sequence[str]) -> list[list[str]]:
    """Return a table row for each change: factors, both means, their ratio and its interval, failure rates, verdict."""
    rows = []
    for change in changed:
        judgement, texts = change.judgement, [getattr(change.first.combination, key) for key in varying]
        for values, runs, failed in zip(change.values, change.runs, change.failed, strict=True):
            mean = _average(values)
            text = number(mean) if math.isfinite(mean) else "n/a"
            texts.append(f"{text} ({failed}/{runs} failed)" if failed else text)
        ratio, low, high = map(factor_number, (judgement.ratio, judgement.low, judgement.high))
        known = change.common and 0 < judgement.ratio < math.inf
        interval = f"[{low}, {high}]" if change.common and math.isfinite(judgement.low) else ""
        rows.append([*texts, f"×{ratio}" if known else "", interval, change.failure_rates, change.verdict])  # noqa: RUF001
    return rows


def _average(values: FloatArray) -> float:
    """Return the geometric mean of the finite values. If a value is not positive, return the arithmetic mean."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan
    return float(np.exp(np.mean(np.log(known)))) if (known > 0).all() else float(np.mean(known))


# Notes about the significance test, which are printed below the table of a comparison.

ON_THE_SAME = (
    "On the same seeds: at most 5 % of such sets have any wrong verdict (largest studentised mean log ratio of "
    "{count}, bootstrap over the seeds)."
)
NO_COMMON_SEED = "Without a verdict, because A and B have no common seed ({count}): use the same first_seed and seeds."


def notes_of_tests(changed: Iterable[Change]) -> list[str]:
    """Return notes about the significance test, and about combinations without common seeds, which are not tested."""
    paired = [change.paired for change in changed if not change.first.phases]
    counts = ((ON_THE_SAME, sum(paired)), (NO_COMMON_SEED, len(paired) - sum(paired)))
    return [note.format(count=count) for note, count in counts if count]


# Output of a comparison as a terminal table, Markdown and JSON.


class StudyComparison(NamedTuple):
    """A comparison of two studies in one metric.

    Attributes:
        metric: column of the metric that was compared.
        changes: change of the metric for each combination.
        varying: factors in which the compared combinations differ from each other.
        notes: notes below the table.
        allowed: maximum increase of the metric [%] with which the gate passes, or None for a comparison without a gate.
        failed: whether the gate fails, because a combination is worse than allowed or cannot be compared.
    """

    metric: str
    changes: Sequence[Change]
    varying: Sequence[str]
    notes: Sequence[str]
    allowed: float | None
    failed: bool

    @property
    def failures(self) -> list[list[str]]:
        """For each combination, the list of reasons why it fails the gate, which is empty if the combination passes."""
        return [[] if self.allowed is None else change.failures(self.allowed) for change in self.changes]

    @property
    def names(self) -> list[str]:
        """The name of each combination: its values of the varying factors, or "all" if no factor varies."""
        factors = ([getattr(change.first.combination, key) for key in self.varying] for change in self.changes)
        return [", ".join(values) or "all" for values in factors]


def print_comparison(comparison: StudyComparison) -> None:
    """Print the comparison of two studies as a table in the terminal."""
    print_grid(*_grid(comparison))


def comparison_json(comparison: StudyComparison) -> str:
    """Return the comparison as JSON. Means, ratios and interval ends that are not finite become null."""
    content = {
        "metrics": [comparison.metric],
        "ok": not comparison.failed,
        "changes": list(_records(comparison)),
        "notes": list(comparison.notes),
    }
    return json.dumps(content, indent=2) + "\n"


COMPARISON_WRITERS: Mapping[str, Callable[[StudyComparison], str]] = {
    "md": lambda comparison: markdown_grid(*_grid(comparison)),
    "json": comparison_json,
}
"""Functions that return a comparison as text, by format."""


def _grid(comparison: StudyComparison) -> tuple[str, list[str], list[list[str]], Sequence[str]]:
    header = [*comparison.varying, "A", "B", "B/A", "95 %", "failures", ""]
    rows = change_rows(comparison.changes, comparison.varying)
    for row, failures in zip(rows, comparison.failures, strict=True):
        row[-1] += ", fails" if failures else ""
    return quantity(comparison.metric).heading, header, rows, comparison.notes


def _records(comparison: StudyComparison) -> Iterator[dict[str, Any]]:
    for change, failures in zip(comparison.changes, comparison.failures, strict=True):
        judgement, (a, b) = change.judgement, map(_average, change.values)
        numbers = {"a": a, "b": b, "ratio": judgement.ratio, "low": judgement.low, "high": judgement.high}
        yield {
            "metric": comparison.metric,
            "combination": change.first.combination._asdict(),
            **{name: float(value) if math.isfinite(value) else None for name, value in numbers.items()},
            "runs": list(change.runs),
            "lost": list(change.failed),
            "lost_up_to": list(map(failure_bound, change.failed, change.runs)),
            "verdict": change.verdict,
            "allowed_percent": comparison.allowed,
            "worse": None if comparison.allowed is None else bool(failures),
            "failures": failures,
            "judged": not change.unjudged,
        }


# Checks that two studies can be compared.

COMPARED = tuple(part for part in LABELLED_PARTS if part not in DECIDING_SCORES)
"""Parts whose parameters may differ between two studies that are compared."""


def require_alike(first: Study, second: Study) -> None:
    """Check that the common combinations of two studies were run with the same data, protocol and engine.

    Raises:
        NotComparableError: common combinations were run under different conditions, or the studies have no common
            combination and one study has mixed conditions. The error message lists the differences.
    """
    shared = list(_shared(first, second))
    mixed = [f"In {study.folder}: {difference}" for study in (first, second) for difference in study.unlike]
    if mixed and not shared:
        raise NotComparableError(f"{first.folder} and {second.folder} have no combination in common. {' '.join(mixed)}")
    unlike = {name: differing for name, a, b in shared if (differing := differing_conditions(a, b, DECIDING_SCORES))}
    if not unlike:
        return
    conditions = " and ".join(dict.fromkeys(name for names in unlike.values() for name in names))
    raise NotComparableError(
        f"{first.folder} and {second.folder} were run under different conditions and cannot be compared. {len(unlike)}"
        f" combinations differ in {conditions}, for example {', '.join(next(iter(unlike)))}. Run both studies again"
        " under the same conditions."
    )


def other_methods(first: Study, second: Study) -> list[str]:
    """Return a list with a note about parameters that differ between methods of the same name, or an empty list."""
    names = [name for _, a, b in _shared(first, second) for name in differing_conditions(a, b, COMPARED)]
    return [f"A and B differ in {', '.join(dict.fromkeys(names))}."] if names else []


def _shared(first: Study, second: Study) -> Iterator[tuple[Combination, Conditions, Conditions]]:
    """Yield each common combination of two studies, with its conditions in the first and in the second study.

    If both studies have only one combination, the two combinations are paired even if their factors differ.
    """
    jobs = [{Combination(**of): study.metadata[key] for key, of in study.labels.items()} for study in (first, second)]
    for name, a, b in common_pairs(*jobs):
        yield name, conditions(a), conditions(b)
