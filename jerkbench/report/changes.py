"""Comparison of two sets of results: what became better or worse, the gate for CI, and the output formats."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import JerkbenchError, NotComparableError
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import failure_bound
from jerkbench.evaluation.judgement import Judgement, Verdict
from jerkbench.files import JunitCase, junit
from jerkbench.report.columns import checked, quantity
from jerkbench.report.comparisons import (
    RULE,
    MethodRuns,
    Standing,
    VerdictRule,
    compare_runs,
    on_common_seeds,
    runs_by_combination,
)
from jerkbench.report.table_model import factor_number, number
from jerkbench.report.terminal import print_grid
from jerkbench.report.writers import markdown_grid

if TYPE_CHECKING:
    import pandas as pd


BeforeAfter = tuple[MethodRuns, MethodRuns]
"""The runs of a combination in the first set, and in the second."""


SINGLE_RUN_LIMIT = 10.0
"""The gate fails if the error of any run increases by more than this factor."""


class Change(NamedTuple):
    """One combination in two sets of results.

    Attributes:
        first: runs of the first set; where the two sets have common seeds, the runs of these seeds.
        second: the same for the second set.
        judgement: second over first, at the level of all combinations; without a common seed it has no verdict.
        rule: how it was judged.
        paired: whether the two sets have common seeds.
        absent: runs of the first set that the second does not have, where they have common seeds.
    """

    first: MethodRuns
    second: MethodRuns
    judgement: Judgement
    rule: VerdictRule
    paired: bool
    absent: int

    @property
    def combination(self) -> Combination:
        """Values of the six factors in the first set."""
        return self.first.combination

    @property
    def phases(self) -> bool:
        """Whether the seeds are phases of one recording. Phases are not independent, so they are not tested."""
        return self.first.phases

    @property
    def values(self) -> tuple[FloatArray, FloatArray]:
        """The metric of each run in both sets, NaN where the run diverged or failed."""
        first, second = (np.where(runs.lost, np.nan, runs.errors) for runs in (self.first, self.second))
        return first, second

    @property
    def runs(self) -> tuple[int, int]:
        """The number of runs in both sets."""
        return len(self.first.seeds), len(self.second.seeds)

    @property
    def lost(self) -> tuple[int, int]:
        """The number of runs that diverged or failed in both sets."""
        return int(self.first.lost.sum()), int(self.second.lost.sum())

    @property
    def same(self) -> bool:
        """Whether all values are identical."""
        lost = self.first.lost, self.second.lost
        return self.paired and np.array_equal(*self.values, equal_nan=True) and np.array_equal(*lost)

    @property
    def common(self) -> int:
        """The number of seeds for which both sets have a value."""
        first, second = map(np.isfinite, self.values)
        return int(sum(first & second)) if self.paired else 0

    @property
    def risen(self) -> BoolArray:
        """Which runs increased from 0 or less, so that they have no ratio."""
        first, second = self.values
        return (second > first) & (first <= 0) if self.paired else np.zeros(0, dtype=bool)

    def failures(self, percent: float) -> list[str]:
        """Return why the second set fails a gate that allows an increase by ``percent``.

        The same seeds are compared, so any difference is an effect of the change, and no statistics are needed. In the
        mean an improvement counts at most `SINGLE_RUN_LIMIT` times, so that one run does not hide all others.
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
        if (newly := self.second.lost & ~self.first.lost).any():
            where = self._seeds(newly)
            found.append(f"{self.lost[1]} of {self.runs[1]} runs diverged or failed in B, {self.lost[0]} in A {where}")
        elif (gone := valued[0] & ~valued[1]).any():
            where = self._seeds(gone)
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
        """Name the first seeds of some runs."""
        seeds, shown = self.first.seeds[where].tolist(), 5
        more = f" and {len(seeds) - shown} more" if len(seeds) > shown else ""
        return f"(seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds[:shown]))}{more})"

    @property
    def unjudged(self) -> str:
        """Why a gate cannot judge the second set; empty if it can."""
        if not self.paired:
            return "A and B have no seed in common"
        if self.absent:
            return "runs of A are missing in B"
        return "" if self.same or self.common else "no seed has a value in both"

    @property
    def verdict(self) -> str:
        """In a few words."""
        if self.same:
            return "the same to the bit"
        if not self.paired:
            return "no verdict (no common seed)"
        if self.risen.any() and not self.judgement.n:
            return "worse (it was 0)"
        if not self.common:
            return "no run of both to compare"
        if self.phases:
            return "no test (phases of one recording)"
        verdict = self.judgement.verdict
        words = {Verdict.EQUAL: self.rule.equal, Verdict.SMALL: self.rule.small}.get(verdict, verdict.value)
        return words + (f", as {self.judgement.reason}" if self.judgement.reason else "")

    @property
    def losses(self) -> str:
        """The runs that either lost, with the bounds of their shares; nothing of phases, and without a run of both."""
        return "" if self.phases or not self.judgement.n else self.judgement.failure_rates


def changes(before: "pd.DataFrame", after: "pd.DataFrame", metric: str, rule: VerdictRule = RULE) -> list[Change]:
    """Compare the combinations that both sets have; where each has a single one, these two, whatever they are called.

    Raises:
        JerkbenchError: nothing is in both, or of this metric the lowest is not the best.
    """
    if not quantity(metric).lowest_is_best:
        raise JerkbenchError(f"Of {metric} neither the lowest nor the highest is the best; compare another metric.")
    first, second = (runs_by_combination(checked(rows, metric), metric) for rows in (before, after))
    both = [(first[key], second[key]) for key in first if key in second]
    if not both and len(first) == len(second) == 1:
        both = list(zip(first.values(), second.values(), strict=True))
    if not both:
        raise NotComparableError(
            f"No combination of the {len(first)} of the first is among the {len(second)} of the second."
        )
    compared = compare_runs(((second, first) for first, second in both), rule)
    return [_change(two, one.judgement, rule) for two, one in zip(both, compared, strict=True)]


def _change(two: BeforeAfter, judgement: Judgement, rule: VerdictRule) -> Change:
    first, second = on_common_seeds(*two)
    if not len(first.seeds):
        return Change(*two, judgement, rule, paired=False, absent=0)
    return Change(first, second, judgement, rule, paired=True, absent=len(two[0].seeds) - len(first.seeds))


def change_rows(changed: Sequence[Change], varying: Sequence[str]) -> list[list[str]]:
    """Return a line of texts for each change: the factors, both means, the ratio, its interval, losses, the verdict."""
    rows = []
    for change in changed:
        judgement, texts = change.judgement, [getattr(change.combination, key) for key in varying]
        for values, runs, lost in zip(change.values, change.runs, change.lost, strict=True):
            mean = _average(values)
            text = number(mean) if math.isfinite(mean) else "n/a"
            texts.append(f"{text} ({lost}/{runs} lost)" if lost else text)
        known = change.common and 0 < judgement.ratio < math.inf
        interval = f"[{factor_number(judgement.low)}, {factor_number(judgement.high)}]"
        texts += [f"×{factor_number(judgement.ratio)}" if known else ""]  # noqa: RUF001
        texts += [interval if change.common and math.isfinite(judgement.low) else "", change.losses, change.verdict]
        rows.append(texts)
    return rows


def _average(values: FloatArray) -> float:
    """The geometric mean of what is finite, as the ratio is one; arithmetic where a value has no logarithm."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan
    return float(np.exp(np.mean(np.log(known)))) if (known > 0).all() else float(np.mean(known))


# The sentences below two sets of results: how they were judged, and where others lead.

ON_THE_SAME = (
    "On the same seeds: at most 5 % of such sets have any wrong verdict (largest studentised mean log ratio of "
    "{count}, bootstrap over the seeds)."
)
NO_COMMON_SEED = (
    "No verdict is given where the runs of A and B have no seed in common ({count}): use the same first_seed and seeds."
)


def notes_of_tests(changed: Iterable[Change]) -> list[str]:
    """Return the test of the verdicts, and why there is none where the runs have no seed in common."""
    paired = [change.paired for change in changed if not change.phases]
    counts = ((ON_THE_SAME, sum(paired)), (NO_COMMON_SEED, len(paired) - sum(paired)))
    return [words.format(count=count) for words, count in counts if count]


def other_leaders(first: Sequence[Standing], second: Sequence[Standing]) -> list[str]:
    """Return a sentence for each scenario of both sets in which others lead in the second."""
    before = {standing.scenario: standing.leaders for standing in first if standing.decided}
    notes = []
    for standing in second:
        leaders = before.get(standing.scenario)
        if leaders is None or not standing.decided or set(leaders) == set(standing.leaders):
            continue
        where = f"On {', '.join(standing.scenario)}" if standing.scenario else "In the lead"
        notes.append(f"{where}: {', '.join(leaders)} in A, {', '.join(standing.leaders)} in B.")
    return notes


# The comparison as text, Markdown, JSON and JUnit.


class StudyComparison(NamedTuple):
    """A comparison of two studies by one metric.

    Attributes:
        metric: column that was compared.
        changes: one for each combination.
        varying: the factors in which the combinations differ.
        notes: sentences below the numbers.
        allowed: percent by which a combination may be worse; None without a limit.
        failed: whether a combination is worse than allowed, or cannot be judged.
    """

    metric: str
    changes: Sequence[Change]
    varying: Sequence[str]
    notes: Sequence[str]
    allowed: float | None
    failed: bool

    @property
    def failures(self) -> list[list[str]]:
        """Why each combination fails; empty if it passes."""
        return [[] if self.allowed is None else change.failures(self.allowed) for change in self.changes]

    @property
    def names(self) -> list[str]:
        """A name for each combination, of the factors that differ."""
        factors = ([getattr(change.combination, key) for key in self.varying] for change in self.changes)
        return [", ".join(values) or "all" for values in factors]


def print_comparison(comparison: StudyComparison) -> None:
    """Print the comparison in the terminal."""
    print_grid(*_grid(comparison))


def comparison_json(comparison: StudyComparison) -> str:
    """Return the comparison as JSON, with null for numbers that are not finite."""
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
    "junit": lambda comparison: junit(f"jerkbench compare {comparison.metric}", list(_cases(comparison))),
}
"""Formats that are text."""


def _grid(comparison: StudyComparison) -> tuple[str, list[str], list[list[str]], Sequence[str]]:
    header = [*comparison.varying, "A", "B", "B/A", "95 %", "losses", ""]
    rows = change_rows(comparison.changes, comparison.varying)
    for row, failures in zip(rows, comparison.failures, strict=True):
        row[-1] += ", fails" if failures else ""
    return quantity(comparison.metric).heading, header, rows, comparison.notes


def _records(comparison: StudyComparison) -> Iterator[dict[str, Any]]:
    for change, failures in zip(comparison.changes, comparison.failures, strict=True):
        judgement, means = change.judgement, map(_average, change.values)
        numbers = dict(zip(("a", "b"), means, strict=True))
        numbers |= {"ratio": judgement.ratio, "low": judgement.low, "high": judgement.high}
        yield {
            "metric": comparison.metric,
            "combination": change.combination._asdict(),
            **{name: float(value) if math.isfinite(value) else None for name, value in numbers.items()},
            "runs": list(change.runs),
            "lost": list(change.lost),
            "lost_up_to": list(map(failure_bound, change.lost, change.runs)),
            "verdict": change.verdict,
            "allowed_percent": comparison.allowed,
            "worse": None if comparison.allowed is None else bool(failures),
            "failures": failures,
            "judged": not change.unjudged,
        }


def _cases(comparison: StudyComparison) -> Iterator[JunitCase]:
    rows = change_rows(comparison.changes, comparison.varying)
    for change, row, name, failures in zip(
        comparison.changes, rows, comparison.names, comparison.failures, strict=True
    ):
        a, b, ratio, interval, lost, verdict = row[-6:]
        sentence = f"A has {a}, B has {b}: {ratio} {interval}, {verdict}{f'; {lost}' if lost else ''}."
        said = [f"{sentence} It fails: {failure}." for failure in failures]
        if comparison.allowed is not None and change.unjudged:
            said.append(f"{sentence} It cannot be judged: {change.unjudged}.")
        yield JunitCase(comparison.metric, name, tuple(said), () if said else (sentence,))
