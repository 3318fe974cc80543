"""Two sets of results: what became better or worse, how far one may fall behind, and the text of it for all readers."""

import json
import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import JerkbenchError, NotComparableError, unknown
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.families import Correction
from jerkbench.evaluation.intervals import loss_bound
from jerkbench.evaluation.judgement import Judgement, Verdict, judged_on_other_seeds
from jerkbench.evaluation.over_seeds import two_samples
from jerkbench.files import read_yaml
from jerkbench.plugins.requirements import JunitCase, junit
from jerkbench.report.columns import METHOD, checked, quantity
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


class Change(NamedTuple):
    """One combination in two sets of results.

    Attributes:
        combination: values of the six factors (in the first set).
        means: geometric (arithmetic where a value is 0), of the runs that went well, in both sets.
        judgement: second over first, at the level of all combinations on the same seeds, or of all on others.
        rule: how it was judged.
        paired: whether the seeds match.
        phases: whether they are phases of one recording, which are no test.
        same: whether every value is the same to the bit.
        runs: in both sets.
        lost: runs that diverged or failed, in both sets.
        valued: runs that went well and have the metric, in both sets.
        common: runs of both that went well, where the seeds match; on others of that which has fewer.
        absent: runs of the first set that the second does not have, where the seeds match.
        risen: on the same seeds, how many went up from a value of which there is no ratio (0, or below).
    """

    combination: Combination
    means: tuple[float, float]
    judgement: Judgement
    rule: VerdictRule
    paired: bool
    phases: bool
    same: bool
    runs: tuple[int, int]
    lost: tuple[int, int]
    valued: tuple[int, int]
    common: int
    absent: int = 0
    risen: int = 0

    def worse(self, percent: float) -> bool:
        """Whether the second is worse by more than ``percent``, or has the metric of a smaller share of its runs.

        On the same seeds any change is one; on others only what the whole interval says, where there is one.
        """
        limit = 1 + percent / 100
        ratio, low = self.judgement.ratio, self.judgement.low
        least = ratio if self.paired or math.isnan(low) else low
        fewer = self.valued[1] * self.runs[0] < self.valued[0] * self.runs[1]
        return bool((self.common and least > limit) or self.risen or fewer)

    @property
    def unjudged(self) -> bool:
        """Whether the second cannot be said to be as good: it lacks runs, or no run of both has a value."""
        return bool(self.absent or (not self.same and not self.common))

    @property
    def verdict(self) -> str:
        """In a few words."""
        if self.same:
            return "the same to the bit"
        if self.risen and not self.judgement.n:
            return "worse (it was 0)"
        if not self.common:
            return "no run of both to compare"
        if self.phases:
            return "no test (phases of one recording)"
        equal = self.judgement.verdict is Verdict.EQUAL
        words = self.rule.equal if equal else self.judgement.verdict.value
        words += f", as {self.judgement.reason}" if self.judgement.reason else ""
        return words if self.paired else f"{words} (other seeds)"

    @property
    def losses(self) -> str:
        """The runs that either lost, with the bounds of their shares; nothing of phases, and without a run of both."""
        return "" if self.phases or not self.judgement.n else self.judgement.losses


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
    return [_change(two, judgement, rule) for two, judgement in zip(both, _judgements(both, rule), strict=True)]


def _judgements(both: Sequence[BeforeAfter], rule: VerdictRule) -> list[Judgement]:
    """Return those on the same seeds as one family, and those on others as another."""
    same = iter(compare_runs(((b, a) for a, b in both if _match(a, b)), rule))
    samples = [two_samples(b.errors, a.errors) for a, b in both if not _match(a, b)]
    others = iter(judged_on_other_seeds(samples, rule.margin, rule.level))
    return [next(same).judgement if _match(a, b) else next(others) for a, b in both]


def _match(first: MethodRuns, second: MethodRuns) -> bool:
    return len(np.intersect1d(first.seeds, second.seeds)) > 0


def _change(two: BeforeAfter, judgement: Judgement, rule: VerdictRule) -> Change:
    seeds_match = _match(*two)
    first, second = on_common_seeds(*two) if seeds_match else two
    well = [np.where(runs.lost, np.nan, runs.errors) for runs in (first, second)]
    valued = [np.isfinite(values) for values in well]
    return Change(
        combination=first.combination,
        means=(_average(well[0]), _average(well[1])),
        judgement=judgement,
        rule=rule,
        paired=seeds_match,
        phases=first.phases,
        same=seeds_match
        and bool(np.array_equal(well[0], well[1], equal_nan=True) and (first.lost == second.lost).all()),
        runs=(len(well[0]), len(well[1])),
        lost=(int(first.lost.sum()), int(second.lost.sum())),
        valued=(int(valued[0].sum()), int(valued[1].sum())),
        common=int((valued[0] & valued[1]).sum()) if seeds_match else min(int(of.sum()) for of in valued),
        absent=len(two[0].seeds) - len(first.seeds),
        risen=int(np.sum((well[1] > well[0]) & (well[0] <= 0))) if seeds_match else 0,
    )


def change_rows(changed: Sequence[Change], varying: Sequence[str]) -> list[list[str]]:
    """Return a line of texts for each change: the factors, both means, the ratio, its interval, losses, the verdict."""
    rows = []
    for change in changed:
        judgement, texts = change.judgement, [getattr(change.combination, key) for key in varying]
        for mean, runs, lost in zip(change.means, change.runs, change.lost, strict=True):
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
BY_SENTENCE = "On the same seeds: of the verdicts 5 % may be wrong (Benjamini and Hochberg over {count})."
ON_OTHERS = (
    "On other seeds: at most 5 % of such sets have any wrong verdict (largest studentised difference of the mean "
    "logarithms of {count}, bootstrap over the seeds of A and those of B); they show much less than the same seeds."
)


def notes_of_tests(changed: Iterable[Change]) -> list[str]:
    """Return by what test the verdicts on the same seeds were found, and by what those on others."""
    tested = [change for change in changed if not change.phases]
    same, others = ([change for change in tested if change.paired is paired] for paired in (True, False))
    by_sentence = bool(same) and same[0].rule.correction is Correction.FDR
    families = ((BY_SENTENCE if by_sentence else ON_THE_SAME, same), (ON_OTHERS, others))
    return [words.format(count=len(family)) for words, family in families if family]


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


# Two sets of results: how far one may fall behind, and the comparison as text, Markdown, JSON and JUnit.


_KEY = "tolerances"
"""The list in the file."""

_ANY = "*"
LINE = "{metric: position_rmse_m, method: mtf, scenario: gnss_outage, ratio: 1.05}"
"""An example of a rule."""


class Tolerance(NamedTuple):
    """One rule.

    Attributes:
        ratio: B/A up to which a combination passes.
        metric: pattern (``*``, ``?``, ``[...]``) of a column of rows.csv.
        method: pattern of a filter, an adaptation or a noise, or of these joined by ``+``.
        scenario: pattern of a data set, a disturbance or an attitude, or of these joined by ``+``.
    """

    ratio: float
    metric: str = _ANY
    method: str = _ANY
    scenario: str = _ANY

    def fits(self, metric: str, combination: Combination) -> bool:
        """Whether the rule is about this metric of this combination."""
        values = combination._asdict()
        scenario = [value for factor, value in values.items() if factor not in METHOD]
        method = [values[factor] for factor in METHOD]
        return (
            fnmatchcase(metric, self.metric) and _any_fits(method, self.method) and _any_fits(scenario, self.scenario)
        )

    @property
    def percent(self) -> float:
        """By how many percent a combination may be worse."""
        return 100 * (self.ratio - 1)


def _any_fits(values: Sequence[str], pattern: str) -> bool:
    return any(fnmatchcase(text, pattern) for text in (*values, "+".join(values)))


class Tolerances(NamedTuple):
    """All rules of a file, and what holds where none fits; the first that fits counts.

    Attributes:
        rules: in the order of the file.
        otherwise: percent where no rule fits; None: nobody asked.
    """

    rules: tuple[Tolerance, ...] = ()
    otherwise: float | None = None

    def percent(self, metric: str, combination: Combination) -> float | None:
        """Return by how many percent a combination may be worse; None: it cannot fail."""
        fitting = (rule.percent for rule in self.rules if rule.fits(metric, combination))
        return next(fitting, self.otherwise)

    def metrics(self, main: str, columns: Iterable[str]) -> list[str]:
        """Return what is to be compared: the main metric, if a rule leaves it open, and the columns that rules name."""
        named = [rule.metric for rule in self.rules if rule.metric != _ANY]
        chosen = [column for column in columns if any(fnmatchcase(column, pattern) for pattern in named)]
        return chosen if named and len(named) == len(self.rules) else list(dict.fromkeys([main, *chosen]))

    def idle(self, compared: Iterable[tuple[str, Combination]]) -> list[str]:
        """Return a sentence for each rule that fits nothing that was compared."""
        pairs = list(compared)
        return [
            f"Tolerance {number} fits no combination (metric {rule.metric}, method {rule.method}, scenario "
            f"{rule.scenario})."
            for number, rule in enumerate(self.rules, start=1)
            if not any(rule.fits(*pair) for pair in pairs)
        ]


def read_tolerances(path: Path, otherwise: float | None = None) -> Tolerances:
    """Read a file of tolerances: YAML, or TOML if its name ends so.

    Raises:
        JerkbenchError: it cannot be read, or a rule is none.
    """
    import yaml

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8")) if path.suffix == ".toml" else read_yaml(path)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, yaml.YAMLError) as error:
        raise JerkbenchError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error
    rules = content.get(_KEY) if isinstance(content, Mapping) and set(content) == {_KEY} else None
    if not isinstance(rules, list) or not rules:
        raise JerkbenchError(f"{path} has no list of tolerances: write {_KEY}:, and below it lines as - {LINE}.")
    return Tolerances(tuple(_rule(path, number, rule) for number, rule in enumerate(rules, start=1)), otherwise)


def _rule(path: Path, number: int, rule: object) -> Tolerance:
    where = f"{path}, tolerance {number}"
    if not isinstance(rule, Mapping):
        raise JerkbenchError(f"{where} is {rule!r}; write it as {LINE}.")
    known = ("metric", "method", "scenario", "ratio")
    for key in rule:
        if key not in known:
            raise JerkbenchError(f"{where}: {unknown('key', str(key), known)}")
    ratio = rule.get("ratio")
    if isinstance(ratio, bool) or not isinstance(ratio, int | float) or not 0 < ratio < math.inf:
        raise JerkbenchError(f"{where}: ratio is {ratio!r}; it must be a number above 0, 1.05 for 5 % worse at most.")
    return Tolerance(float(ratio), **{key: str(value) for key, value in rule.items() if key != "ratio"})


# A comparison of two sets of results, for a terminal, for a page, and for machines.


class MetricChanges(NamedTuple):
    """A comparison by one metric.

    Attributes:
        metric: column that was compared.
        changes: of each combination.
        varying: the factors that tell the combinations apart.
        allowed: of each change, percent by which it may be worse; None: nobody asked.
    """

    metric: str
    changes: Sequence[Change]
    varying: Sequence[str]
    allowed: Sequence[float | None]

    @property
    def worse(self) -> list[bool]:
        """Whether each change is worse than it may be."""
        pairs = zip(self.changes, self.allowed, strict=True)
        return [percent is not None and change.worse(percent) for change, percent in pairs]


class StudyComparison(NamedTuple):
    """A comparison by one metric or several.

    Attributes:
        parts: by each metric.
        notes: sentences below the numbers.
        failed: whether a combination is worse than it may be, or cannot be judged.
    """

    parts: Sequence[MetricChanges]
    notes: Sequence[str]
    failed: bool


def print_comparison(comparison: StudyComparison) -> None:
    """Print the comparison in the terminal."""
    for grid in _grids(comparison):
        print_grid(*grid)


def comparison_json(comparison: StudyComparison) -> str:
    """Return the comparison as JSON; what is no number is null."""
    content = {
        "metrics": [part.metric for part in comparison.parts],
        "ok": not comparison.failed,
        "changes": [record for part in comparison.parts for record in _records(part)],
        "notes": list(comparison.notes),
    }
    return json.dumps(content, indent=2) + "\n"


COMPARISON_WRITERS: Mapping[str, Callable[[StudyComparison], str]] = {
    "md": lambda comparison: "\n".join(markdown_grid(*grid) for grid in _grids(comparison)),
    "json": comparison_json,
    "junit": lambda comparison: junit(
        f"jerkbench compare {', '.join(part.metric for part in comparison.parts)}",
        [case for part in comparison.parts for case in _cases(part)],  # one for each combination and metric
    ),
}
"""Formats that are text."""


def _grids(comparison: StudyComparison) -> Iterator[tuple[str, list[str], list[list[str]], Sequence[str]]]:
    """The table of each metric; the notes stand below the last."""
    for part in comparison.parts:
        notes = comparison.notes if part is comparison.parts[-1] else ()
        yield quantity(part.metric).heading, *_grid(part), notes


def _grid(part: MetricChanges) -> tuple[list[str], list[list[str]]]:
    """A column says what is allowed, where it is not the same for all."""
    header, rows = [*part.varying, "A", "B", "B/A", "95 %", "losses", ""], change_rows(part.changes, part.varying)
    for row, worse in zip(rows, part.worse, strict=True):
        row[-1] += ", too much" if worse else ""
    if len(set(part.allowed)) <= 1:
        return header, rows
    allowed = ["" if percent is None else f"×{1 + percent / 100:g}" for percent in part.allowed]  # noqa: RUF001
    return [*header[:-1], "allowed", ""], [[*row[:-1], may, row[-1]] for row, may in zip(rows, allowed, strict=True)]


def _records(part: MetricChanges) -> Iterator[dict[str, Any]]:
    for change, percent, worse in zip(part.changes, part.allowed, part.worse, strict=True):
        judgement = change.judgement
        numbers = {"a": change.means[0], "b": change.means[1], "ratio": judgement.ratio}
        numbers |= {"low": judgement.low, "high": judgement.high}
        yield {
            "metric": part.metric,
            "combination": change.combination._asdict(),
            **{name: float(value) if math.isfinite(value) else None for name, value in numbers.items()},
            "runs": list(map(int, change.runs)),
            "lost": list(map(int, change.lost)),
            "lost_up_to": list(map(loss_bound, change.lost, change.runs)),
            "verdict": change.verdict,
            "allowed_percent": percent,
            "worse": None if percent is None else worse,
            "judged": not change.unjudged,
        }


def _cases(part: MetricChanges) -> Iterator[JunitCase]:
    rows = change_rows(part.changes, part.varying)
    for change, row, percent, worse in zip(part.changes, rows, part.allowed, part.worse, strict=True):
        names, (a, b, ratio, interval, lost, verdict) = row[:-6], row[-6:]
        sentence = f"A has {a}, B has {b}: {ratio} {interval}, {verdict}{f'; {lost}' if lost else ''}."
        failures = [f"{sentence} That is worse by more than {percent:g} %."] if worse else []
        if percent is not None and change.unjudged:
            failures.append(f"{sentence} B lacks runs of A, so that it cannot be judged.")
        yield JunitCase(part.metric, ", ".join(names) or "all", tuple(failures), () if failures else (sentence,))
