"""Comparisons of methods on common seeds, the parameters of verdicts, and the best methods of each scenario."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, require_known
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import OUTLIER_FACTOR, failure_bound, up_to
from jerkbench.evaluation.judgement import (
    DEFEATS,
    LEVEL,
    MARGIN,
    WINS,
    Judgement,
    LogRatios,
    Verdict,
    judged,
    log_ratios,
)
from jerkbench.evaluation.planning import seeds_needed
from jerkbench.renamed import new_label
from jerkbench.report.columns import FACTORS, MAIN, numbers_of_rows, require_factors
from jerkbench.report.table_model import factor_number, number, range_text

if TYPE_CHECKING:
    import pandas as pd


_FLOOR = "reference_floor_m"
"""The column with the position RMSE that the errors of the reference alone would cause."""


class MethodRuns(NamedTuple):
    """The runs of one combination.

    Attributes:
        combination: labels of the six factors (data set, disturbance, attitude, filter, adaptation, noise).
        seeds: (n,) seeds in ascending order.
        errors: (n,) value of the metric in each run, or infinity for a run that diverged or failed.
        failed: (n,) whether each run diverged or failed.
        phases: whether the runs are phases of one recording (different starts of the decimation) instead of seeds.
        floor: smallest difference of the metric that the accuracy of the reference can resolve, or 0 if this accuracy
            is unknown.
    """

    combination: Combination
    seeds: IntArray
    errors: FloatArray
    failed: BoolArray
    phases: bool
    floor: float = 0.0

    def only(self, places: IntArray) -> "MethodRuns":
        """Return the runs at the indices ``places`` (k,)."""
        return self._replace(seeds=self.seeds[places], errors=self.errors[places], failed=self.failed[places])

    @property
    def typical(self) -> float:
        """The root mean square of the errors over all runs."""
        with np.errstate(over="ignore"):
            return float(np.sqrt(np.mean(self.errors**2))) if len(self.errors) else np.nan


def runs_by_combination(rows: "pd.DataFrame", metric: str) -> dict[Combination, MethodRuns]:
    """Return the runs of each combination. The columns of the factors in ``rows`` must contain text."""
    errors = np.where(rows["status"] == "ok", rows[metric].to_numpy(dtype=float), np.inf)
    seeds, ok = rows["seed"].to_numpy(), (rows["status"] == "ok").to_numpy()
    phases = (rows["replicate"] == "phase").to_numpy()
    floored = metric == MAIN and _FLOOR in rows
    floors = rows[_FLOOR].to_numpy(dtype=float) if floored else np.zeros(len(rows))
    groups = {}
    for values, places in numbers_of_rows(rows, FACTORS).items():
        key, order = Combination(*values), places[np.argsort(seeds[places], kind="stable")]
        floor = float(np.nan_to_num(floors[order]).max(initial=0.0))
        groups[key] = MethodRuns(key, seeds[order], errors[order], ~ok[order], bool(phases[order].any()), floor)
    return groups


def on_common_seeds(ours: MethodRuns, theirs: MethodRuns) -> tuple[MethodRuns, MethodRuns]:
    """Return the runs of two methods, restricted to the seeds that both methods have run."""
    if len(ours.seeds) == len(theirs.seeds) and (ours.seeds == theirs.seeds).all():
        return ours, theirs
    _, first, second = np.intersect1d(ours.seeds, theirs.seeds, return_indices=True)
    return ours.only(first), theirs.only(second)


# The parameters of the verdicts of a study: margin and level.


@dataclass(frozen=True)
class VerdictRule:
    """The parameters with which `jerkbench.evaluation.judgement.judged` computes the verdicts of a study.

    Attributes:
        margin: two methods count as equal if their error ratio is between 1/(1 + margin) and 1 + margin [-].
        level: maximum probability that a study contains any wrong verdict (family-wise error rate). If seeds are added
            in blocks, the level of each interim analysis is smaller.
    """

    margin: float = MARGIN
    level: float = LEVEL

    def __post_init__(self) -> None:
        """Check that the margin is not negative.

        Raises:
            JerkbenchError: the margin is negative.
        """
        if self.margin < 0:
            raise JerkbenchError(f"The margin of equality is {100 * self.margin:g} %; give 0 or more, for example 3.")

    @property
    def equal(self) -> str:
        """The text for two methods whose ratio is within the margin."""
        return f"equal within {100 * self.margin:g} %"

    @property
    def small(self) -> str:
        """The text for two methods whose difference is significant, but within the margin."""
        return f"differ by less than {100 * self.margin:g} %"

    def of(self, rows: "pd.DataFrame") -> "VerdictRule":
        """Return the rule for a study. The level is at most the level of the last interim analysis of the study.

        If seeds were added in blocks, ``rows.attrs`` contains the level of the last interim analysis.
        """
        return replace(self, level=min(self.level, rows.attrs.get(SPENDS, self.level)))


RULE = VerdictRule()

SPENDS = "level"
"""Key in ``rows.attrs`` of the value of `VerdictRule.level`."""


# Baselines: a baseline such as adaptation=none selects the combination with which a combination is compared.


def parse_baseline(text: str) -> dict[str, str]:
    """Convert a text ``factor=value[;factor=value]`` to a mapping. Without parentheses, commas may replace semicolons.

    Raises:
        JerkbenchError: the text has a different form, or contains an unknown factor.
    """
    parts = text.split(";") if ";" in text else text.split(",") if text.count("=") > 1 and "(" not in text else [text]
    values = {}
    for part in parts:
        key, equals, value = (part.strip() for part in part.partition("="))
        if not equals or not value:
            raise JerkbenchError(f"The baseline '{text}' is not of the form FACTOR=NAME, for example adaptation=none.")
        require_factors([key])
        values[key] = new_label(key, value)
    return values


def partners(
    combinations: Collection[Combination], baseline: Mapping[str, str]
) -> list[tuple[Combination, Combination]]:
    """Return pairs of a combination and its partner, which differs only in having the values of ``baseline``.

    A combination is left out if its partner does not exist, or if it has the values of the baseline itself.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    pairs = [(key, key._replace(**baseline)) for key in combinations]
    if not any(partner in combinations for _, partner in pairs):
        for factor, name in baseline.items():
            require_known(factor, name, {getattr(key, factor) for key in combinations}, JerkbenchError)
        factors = ", ".join(f"{factor}={name}" for factor, name in baseline.items())
        raise JerkbenchError(f"No combination has {factors} together; `jerkbench table DIR` shows all combinations.")
    return [(key, partner) for key, partner in pairs if partner in combinations and partner != key]


# Comparisons of two combinations.


BELOW_FLOOR = "the reference is not known so well"


class Comparison(NamedTuple):
    """The comparison of two combinations on their common seeds.

    Attributes:
        subject: combination that is compared with ``baseline``.
        baseline: combination with which ``subject`` is compared.
        ratios: logarithms of the ratios of the metric (subject divided by baseline), one for each seed. A failed run
            counts as worse than all other runs.
        failed: number of runs of the subject and of the baseline that diverged or failed.
        runs: number of common seeds.
        phases: whether the runs are phases of one recording instead of seeds.
        judgement: ratio, interval and verdict, corrected for all comparisons of the study. For phases of one recording,
            ``low`` and ``high`` are the smallest and the largest ratio, p is NaN, and the verdict is undecided. The
            reason is `BELOW_FLOOR` if the difference is too small for the accuracy of the reference trajectory.
        family: number of comparisons that are tested together, for which the test is corrected.
        rule: margin and level of the verdict.
    """

    subject: Combination
    baseline: Combination
    ratios: LogRatios
    failed: tuple[int, int]
    runs: int
    phases: bool
    judgement: Judgement
    family: int
    rule: VerdictRule

    @property
    def verdict(self) -> Verdict:
        """The verdict, corrected for all comparisons of the study."""
        return self.judgement.verdict

    @property
    def tested(self) -> bool:
        """True if the difference was tested for significance. Phases of one recording are not tested."""
        return not self.phases and self.judgement.n > 0

    @property
    def shown(self) -> bool:
        """True if the difference is significant and larger than the margin."""
        return self.verdict in WINS or self.verdict in DEFEATS

    @property
    def swapped(self) -> "Comparison":
        """The same comparison with subject and baseline swapped."""
        ratios, judgement, failed = self.ratios.swapped, self.judgement.swapped, self.failed[::-1]
        return self._replace(
            subject=self.baseline, baseline=self.subject, ratios=ratios, failed=failed, judgement=judgement
        )

    @property
    def mark(self) -> str:
        """The mark of the verdict: "*" (significant), "~" (significant but within the margin), "=" (equal) or empty."""
        return "*" if self.shown else {Verdict.EQUAL: "=", Verdict.SMALL: "~"}.get(self.verdict, "")

    @property
    def ratio_text(self) -> str:
        """Text with the ratio, empty if a median run failed. A significant ratio is never rounded to 1."""
        ratio, differs = self.judgement.ratio, self.shown or self.verdict is Verdict.SMALL
        return "" if not 0 < ratio < math.inf else factor_number(ratio) if differs else number(ratio)

    @property
    def needed(self) -> int | None:
        """The number of seeds that would decide an undecided comparison.

        The value is None if the comparison is decided, if runs failed, or if no number of seeds would be sufficient.
        """
        undecided = self.verdict is Verdict.UNDECIDED and not self.judgement.reason and not self.phases
        if not undecided or not self.ratios.plain or self.ratios.n < 2:
            return None
        return seeds_needed(self.ratios.d, max(1, self.family), self.rule.level, self.judgement.critical)


def compare_runs(pairs: Iterable[tuple[MethodRuns, MethodRuns]], rule: VerdictRule = RULE) -> list[Comparison]:
    """Return the comparison of each pair of methods. The tests are corrected for the number of all pairs.

    Phases of one recording are not independent. Therefore, phases are not tested, and the range of their ratios is
    computed instead of a confidence interval.
    """
    common = [on_common_seeds(ours, theirs) for ours, theirs in pairs]
    ratios = [log_ratios(ours.errors, theirs.errors) for ours, theirs in common]
    seeded = [of for (ours, _), of in zip(common, ratios, strict=True) if not ours.phases]
    judgements = iter(judged(seeded, rule.margin, rule.level))
    compared = []
    for (ours, theirs), of in zip(common, ratios, strict=True):
        judgement = _of_phases(of) if ours.phases else next(judgements)
        if abs(ours.typical - theirs.typical) < max(ours.floor, theirs.floor):
            judgement = judgement._replace(verdict=Verdict.UNDECIDED, reason=BELOW_FLOOR)
        failed, runs = (int(ours.failed.sum()), int(theirs.failed.sum())), len(ours.seeds)
        names = ours.combination, theirs.combination
        compared.append(Comparison(*names, of, failed, runs, ours.phases, judgement, len(seeded), rule))
    return compared


def _of_phases(ratios: LogRatios) -> Judgement:
    """Return the mean and the range of the ratios of phases, without a test.

    If runs failed, the median is returned instead of the geometric mean.
    """
    (judgement,) = judged([ratios])
    low, high = (float(np.exp(of(ratios.d))) for of in (np.min, np.max)) if ratios.n > 1 else (np.nan, np.nan)
    return judgement._replace(low=low, high=high, p=np.nan, p_failed=np.nan, verdict=Verdict.UNDECIDED, reason="")


def family_note(comparisons: Sequence[Comparison]) -> str:
    """Return the footnote that explains the marks and the test, and counts undecided comparisons and failed runs."""
    tested = [comparison for comparison in comparisons if comparison.tested]
    if not tested:
        return "Differences are not tested: the runs have no seeds."
    rule, family = tested[0].rule, max(comparison.family for comparison in tested)
    marks = f"*: significant difference; ~: they {rule.small}; =: {rule.equal}."
    test = (
        f"At most 5 % of such studies have any wrong mark (max-t test of all {family} comparisons, bootstrap over the "
        "seeds)."
    )
    if rule.level < LEVEL:
        test += f" Seeds were added in blocks: the level of the last interim analysis is {100 * rule.level:.2g} %."
    count = sum(comparison.verdict is Verdict.UNDECIDED for comparison in tested)
    floored = sum(comparison.judgement.reason == BELOW_FLOOR for comparison in tested)
    why = f", {floored} of them because the difference is less than the sigma of the reference" if floored else ""
    undecided = f" Undecided: {count} of {len(tested)}{why}." if count else ""
    return f"{marks} {test}{undecided} Runs of each method: {failures_range(one.judgement for one in tested)}."


def failures_range(judgements: Iterable[Judgement]) -> str:
    """Return text with the smallest and largest number of failed runs, a bound of the failure rate, and outliers."""
    judgements = list(judgements)
    failed = {(count, one.n) for one in judgements for count in one.failed}
    counts, sizes = map(range_text, zip(*failed, strict=True))
    bound = up_to(*max(failed, key=lambda of: failure_bound(*of)))
    outlying = max(max(one.outlying) for one in judgements)
    more = f", and up to {outlying} with over {OUTLIER_FACTOR:g} times the error of another" if outlying else ""
    return f"{counts} of {sizes} failed ({bound}){more}"


def leaders_of(rivals: Sequence[Combination], comparisons: Sequence[Comparison]) -> tuple[Combination, ...]:
    """Return the methods that are not significantly worse than any other method. Without comparisons, return ()."""
    beaten = {one.baseline if one.verdict in WINS else one.subject for one in comparisons if one.shown}
    return tuple(rival for rival in rivals if rival not in beaten) if comparisons else ()


# The best methods of each scenario, and the comparisons of all pairs of methods in the scenario.

UNTESTED = "Nothing is tested: the runs have no seeds, and phases of one recording are not independent."

MAX_PAIRS = 50_000
"""Maximum number of comparisons. More comparisons take minutes and are hardly ever significant."""


class Standing(NamedTuple):
    """The comparisons of the methods in one scenario.

    Attributes:
        scenario: labels of the scenario: values of its factors that vary in the study.
        method: names of the factors that define a method and that vary in the study, for example ("filter",).
        rivals: combinations of this scenario (one for each method) that compete with each other.
        comparisons: comparisons of all pairs of ``rivals``.
    """

    scenario: tuple[str, ...]
    method: tuple[str, ...]
    rivals: tuple[Combination, ...]
    comparisons: tuple[Comparison, ...]

    @property
    def leaders(self) -> list[str]:
        """The names of the best methods, which are not significantly worse than another method."""
        return [self.name(leader) for leader in leaders_of(self.rivals, self.comparisons)]

    @property
    def decided(self) -> bool:
        """True if at least one method is significantly worse than another method."""
        return 0 < len(self.leaders) < len(self.rivals)

    @property
    def tested(self) -> list[Comparison]:
        """The comparisons of this scenario that were tested."""
        return [pair for pair in self.comparisons if pair.tested]

    def name(self, combination: Combination) -> str:
        """Return the name of a method: its labels of the factors in ``method``, joined by "+"."""
        return "+".join(getattr(combination, key) for key in self.method)
