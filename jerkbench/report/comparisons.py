"""The runs of two methods on common seeds, compared; scenario by scenario who leads, and by what rule."""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, require_known
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import OUTLIER_FACTOR, failure_bound, seeds_without_failure, up_to
from jerkbench.evaluation.judgement import (
    BY_FAILURES,
    DEFEATS,
    LEVEL,
    MARGIN,
    NOT_EXCLUDED,
    WINS,
    Judgement,
    LogRatios,
    Verdict,
    judged,
    log_ratios,
)
from jerkbench.evaluation.planning import seeds_needed
from jerkbench.renamed import new_label
from jerkbench.report.columns import FACTORS, numbers_of_rows, require_factors
from jerkbench.report.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


_FLOOR = "reference_floor_m"
"""The column with the floor that the reference's own sigma puts under a position RMSE."""


class MethodRuns(NamedTuple):
    """The runs of one combination.

    Attributes:
        combination: values of the six factors.
        seeds: (n,) in ascending order.
        errors: (n,) the metric, infinite where the run was lost.
        lost: (n,) whether it was.
        phases: whether they are phases of one recording.
        floor: of the metric, by the reference's own sigma; 0: not known.
    """

    combination: Combination
    seeds: IntArray
    errors: FloatArray
    lost: BoolArray
    phases: bool
    floor: float = 0.0

    def only(self, places: IntArray) -> "MethodRuns":
        """Return the runs at ``places``."""
        chosen = self.seeds[places], self.errors[places], self.lost[places]
        return MethodRuns(self.combination, *chosen, self.phases, self.floor)

    @property
    def typical(self) -> float:
        """The root mean square of the errors."""
        with np.errstate(over="ignore"):
            return float(np.sqrt(np.mean(self.errors**2))) if len(self.errors) else np.nan


def runs_by_combination(rows: "pd.DataFrame", metric: str) -> dict[Combination, MethodRuns]:
    """Return the runs of each combination; the factors are text."""
    errors = np.where(rows["status"] == "ok", rows[metric].to_numpy(dtype=float), np.inf)
    seeds, ok = rows["seed"].to_numpy(), (rows["status"] == "ok").to_numpy()
    phases = (rows["replicate"] == "phase").to_numpy()
    floored = metric == "position_rmse_m" and _FLOOR in rows
    floors = rows[_FLOOR].to_numpy(dtype=float) if floored else np.zeros(len(rows))
    groups = {}
    for values, places in numbers_of_rows(rows, FACTORS).items():
        key, order = Combination(*values), places[np.argsort(seeds[places], kind="stable")]
        floor = float(np.nan_to_num(floors[order]).max(initial=0.0))
        groups[key] = MethodRuns(key, seeds[order], errors[order], ~ok[order], bool(phases[order].any()), floor)
    return groups


def on_common_seeds(ours: MethodRuns, theirs: MethodRuns) -> tuple[MethodRuns, MethodRuns]:
    """Return the runs of both on the seeds that both have."""
    if len(ours.seeds) == len(theirs.seeds) and (ours.seeds == theirs.seeds).all():
        return ours, theirs
    _, first, second = np.intersect1d(ours.seeds, theirs.seeds, return_indices=True)
    return ours.only(first), theirs.only(second)


# The rule by which the comparisons of a study are judged.


@dataclass(frozen=True)
class VerdictRule:
    """How the comparisons of a study are judged; see `jerkbench.evaluation.judgement.judged`.

    Attributes:
        margin: ratios up to 1 + margin are equal for every practical purpose.
        level: 5 % of studies may have any wrong sentence; a look at seeds that were added in blocks may spend less.
    """

    margin: float = MARGIN
    level: float = LEVEL

    def __post_init__(self) -> None:
        """Check the margin.

        Raises:
            JerkbenchError: it is below 0.
        """
        if self.margin < 0:
            raise JerkbenchError(f"The margin of equality is {100 * self.margin:g} %; give 0 or more, for example 3.")

    @property
    def equal(self) -> str:
        """What two methods are whose ratio is within the margin."""
        return f"equal within {100 * self.margin:g} %"

    @property
    def small(self) -> str:
        """The verb for two methods whose difference is significant, but within the margin."""
        return f"differ by less than {100 * self.margin:g} %"

    def of(self, rows: "pd.DataFrame") -> "VerdictRule":
        """Return the rule for the rows of a study, which know what their last look may spend."""
        return replace(self, level=min(self.level, rows.attrs.get(SPENDS, self.level)))


RULE = VerdictRule()

SPENDS = "level"
"""Among the attributes of a study's rows: see `VerdictRule.level`."""


# The combination that each one is held against: like it but for some factors.


def parse_baseline(text: str) -> dict[str, str]:
    """Read ``factor=value[;factor=value]`` (a comma does as well, where no value has one).

    Raises:
        JerkbenchError: it is not of that form, or names no factor.
    """
    parts = text.split(";") if ";" in text else text.split(",") if text.count("=") > 1 and "(" not in text else [text]
    values = {}
    for part in parts:
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not value:
            raise JerkbenchError(f"The baseline '{text}' is not of the form FACTOR=NAME, for example adaptation=none.")
        require_factors([key])
        values[key] = new_label(key, value)
    return values


def partners(
    combinations: Collection[Combination], baseline: Mapping[str, str]
) -> list[tuple[Combination, Combination]]:
    """Return every combination with the one that is like it but for the factors of ``baseline``.

    What has no such partner, or is the partner itself, is left out.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    pairs = [(key, key._replace(**baseline)) for key in combinations]
    if not any(partner in combinations for _, partner in pairs):
        labels = {factor: {getattr(key, factor) for key in combinations} for factor in FACTORS}
        key, value = next(((k, v) for k, v in baseline.items() if v not in labels[k]), next(iter(baseline.items())))
        require_known(key, value, labels[key], JerkbenchError)
        factors = ", ".join(f"{k}={v}" for k, v in baseline.items())
        raise JerkbenchError(
            f"No combination has {factors} together; `jerkbench table DIR` shows those that there are."
        )
    return [(key, partner) for key, partner in pairs if partner in combinations and partner != key]


# Scenario by scenario: how every two methods compare, and which lead.


BELOW_FLOOR = "the reference is not known so well"


class Comparison(NamedTuple):
    """One combination against another, on the seeds that both have.

    Attributes:
        subject: values of the six factors.
        baseline: of what it is compared with.
        ratios: log ratios of the metric, subject over baseline; a lost run is the worst of all.
        lost: how many of the subject's runs, and of the baseline's, diverged or failed.
        runs: seeds that both have.
        phases: whether these are phases of one recording.
        below_floor: whether they differ by less than the reference knows.
        judgement: ratio, interval and verdict at the level of the study; of phases of one recording ``low`` and
            ``high`` are the smallest and the largest ratio, and there is no p and no verdict.
        family: how many comparisons the study has.
        rule: how they were judged.
    """

    subject: Combination
    baseline: Combination
    ratios: LogRatios
    lost: tuple[int, int]
    runs: int
    phases: bool
    below_floor: bool
    judgement: Judgement
    family: int
    rule: VerdictRule

    @property
    def verdict(self) -> Verdict:
        """At the level of the study."""
        return self.judgement.verdict

    @property
    def tested(self) -> bool:
        """Whether a test has judged it: phases of one recording are none."""
        return not self.phases and self.judgement.n > 0

    @property
    def shown(self) -> bool:
        """Whether one is better, or fails in fewer runs; a difference within the margin does not count."""
        return self.verdict in WINS or self.verdict in DEFEATS

    @property
    def turned(self) -> "Comparison":
        """The same, as the baseline sees it."""
        ratios, judgement, lost = self.ratios.swapped, self.judgement.swapped, self.lost[::-1]
        return self._replace(
            subject=self.baseline, baseline=self.subject, ratios=ratios, lost=lost, judgement=judgement
        )

    @property
    def mark(self) -> str:
        """A star where a difference was shown, "~" where it is within the margin, "=" where the two are equal."""
        return "*" if self.shown else {Verdict.EQUAL: "=", Verdict.SMALL: "~"}.get(self.verdict, "")

    @property
    def ratio_text(self) -> str:
        """The ratio, with as many digits as tell it from 1 where it differs from 1; nothing of a lost run."""
        ratio, differs = self.judgement.ratio, self.shown or self.verdict is Verdict.SMALL
        return "" if not 0 < ratio < math.inf else factor_number(ratio) if differs else number(ratio)

    @property
    def needed(self) -> int | None:
        """How many seeds would show the difference of what is undecided; None where none would, or losses hinder."""
        undecided = self.verdict is Verdict.UNDECIDED and not self.judgement.reason and not self.phases
        if not undecided or not self.ratios.plain or self.ratios.n < 2:
            return None
        return seeds_needed(self.ratios.d, max(1, self.family), self.rule.level, self.judgement.critical)


def compare_runs(pairs: Iterable[tuple[MethodRuns, MethodRuns]], rule: VerdictRule = RULE) -> list[Comparison]:
    """Judge the pairs as one family; phases of one recording are not independent and have a range instead."""
    common = [on_common_seeds(ours, theirs) for ours, theirs in pairs]
    ratios = [log_ratios(ours.errors, theirs.errors) for ours, theirs in common]
    seeded = [of for (ours, _), of in zip(common, ratios, strict=True) if not ours.phases]
    judgements = iter(judged(seeded, rule.margin, rule.level))
    compared = []
    for (ours, theirs), of in zip(common, ratios, strict=True):
        judgement = _of_phases(of) if ours.phases else next(judgements)
        below = abs(ours.typical - theirs.typical) < max(ours.floor, theirs.floor)
        if below:
            judgement = judgement._replace(verdict=Verdict.UNDECIDED, reason=BELOW_FLOOR)
        lost, runs = (int(ours.lost.sum()), int(theirs.lost.sum())), len(ours.seeds)
        names = ours.combination, theirs.combination
        compared.append(Comparison(*names, of, lost, runs, ours.phases, below, judgement, len(seeded), rule))
    return compared


def _of_phases(ratios: LogRatios) -> Judgement:
    """Return the geometric mean, or with lost runs the median, with the range, and no test."""
    (judgement,) = judged([ratios])
    low, high = (float(np.exp(of(ratios.d))) for of in (np.min, np.max)) if ratios.n > 1 else (np.nan, np.nan)
    return judgement._replace(low=low, high=high, p=np.nan, p_failed=np.nan, verdict=Verdict.UNDECIDED, reason="")


def family_note(comparisons: Sequence[Comparison]) -> str:
    """Say what the marks mean, and how many comparisons are undecided."""
    tested = [comparison for comparison in comparisons if comparison.tested]
    if not tested:
        return "Without seeds there is no test of a difference."
    rule, family = tested[0].rule, max(comparison.family for comparison in tested)
    marks = f"*: a difference was shown; ~: they {rule.small}; =: {rule.equal}."
    test = (
        f"At most 5 % of such studies have any wrong mark (largest studentised mean log ratio of all {family} "
        "comparisons, bootstrap over the seeds)."
    )
    if rule.level < LEVEL:
        test += f" Seeds were added in blocks: the last look spends {100 * rule.level:.2g} of these 5 %."
    count = sum(comparison.verdict is Verdict.UNDECIDED for comparison in tested)
    floored = sum(comparison.below_floor for comparison in tested)
    why = f", {floored} of them because they differ by less than the reference's own sigma" if floored else ""
    is_ = "is" if count == 1 else "are"
    undecided = f" Of the {len(tested)} here {count} {is_} undecided{not_excluded(tested)}{why}." if count else ""
    return f"{marks} {test}{undecided} Of each method {losses_range(one.judgement for one in tested)}."


def not_excluded(compared: Iterable[Comparison]) -> str:
    """Return how many comparisons would be equal if rare failures could be excluded; empty if none."""
    near = [one.rule.margin for one in compared if one.judgement.reason == NOT_EXCLUDED]
    if not near:
        return ""
    within, needed = f"{len(near)} of them within {100 * near[0]:g} %", seeds_without_failure(near[0])
    return f", {within}, as {NOT_EXCLUDED} ({needed} seeds without a failure exclude them)"


def losses_range(judgements: Iterable[Judgement]) -> str:
    """Return the smallest and largest number of failed runs, the largest bound, and the number of outliers."""
    judgements = list(judgements)
    lost = {(count, one.n) for one in judgements for count in one.failed}
    counts, sizes = (
        f"{min(of)}" if min(of) == max(of) else f"{min(of)} to {max(of)}" for of in zip(*lost, strict=True)
    )
    bound = up_to(*max(lost, key=lambda of: failure_bound(*of)))
    outlying = max(max(one.outlying) for one in judgements)
    more = f", and up to {outlying} with over {OUTLIER_FACTOR:g} times the error of another" if outlying else ""
    return f"{counts} of {sizes} failed ({bound}){more}"


def leaders_of(rivals: Sequence[Combination], comparisons: Sequence[Comparison]) -> tuple[Combination, ...]:
    """Return those of ``rivals`` whom nobody was shown to beat; nobody leads where nothing was compared."""
    beaten = {one.baseline if one.verdict in WINS else one.subject for one in comparisons if one.shown}
    return tuple(rival for rival in rivals if rival not in beaten) if comparisons else ()


# Scenario by scenario: which methods lead, and how every two of them compare.

UNTESTED = "Nothing is tested: the runs have no seeds, and those of one recording are not independent."

MAX_PAIRS = 50_000
"""More comparisons than these take minutes, and show little."""


class Standing(NamedTuple):
    """One scenario.

    Attributes:
        scenario: values of the factors that make it, of those that vary.
        method: factors that make a method, of those that vary.
        rivals: the combinations that compete.
        comparisons: of every two of them.
    """

    scenario: tuple[str, ...]
    method: tuple[str, ...]
    rivals: tuple[Combination, ...]
    comparisons: tuple[Comparison, ...]

    @property
    def leaders(self) -> list[str]:
        """Names of those whom nobody was shown to beat."""
        return [self.name(leader) for leader in leaders_of(self.rivals, self.comparisons)]

    @property
    def decided(self) -> bool:
        """Whether the leaders are fewer than the rivals: else nothing was shown."""
        return 0 < len(self.leaders) < len(self.rivals)

    @property
    def tested(self) -> list[Comparison]:
        """The comparisons that a test has judged."""
        return [pair for pair in self.comparisons if pair.tested]

    def name(self, combination: Combination) -> str:
        """Return the name of a method."""
        return "+".join(getattr(combination, key) for key in self.method)


def leads(standings: Iterable[Standing]) -> tuple[Counter[str], Counter[str]]:
    """Return in how many decided scenarios each method leads alone, and in how many it shares the lead."""
    alone, shared = Counter[str](), Counter[str]()
    for standing in standings:
        if standing.decided:
            (alone if len(standing.leaders) == 1 else shared).update(standing.leaders)
    return alone, shared


def _counted(words: str, names: Counter[str], scenarios: int) -> str:
    if scenarios == 1:
        return f"{words}: {', '.join(names)}."
    told = ", ".join(f"{name} in {count}" for name, count in names.most_common(5))
    more = f", and {len(names) - 5} others in fewer" if len(names) > 5 else ""
    return f"{words}, of {scenarios} scenarios: {told}{more}."


def verdict_sentences(standings: Sequence[Standing]) -> list[str]:
    """Return in sentences who leads how often, and how many pairs of methods are what."""
    compared = [pair for standing in standings for pair in standing.comparisons]
    verdicts = Counter(pair.verdict for pair in compared if pair.tested)
    if not verdicts:
        if any(pair.judgement.n for pair in compared):
            return [UNTESTED]
        many = any(len(standing.rivals) > 1 and not standing.comparisons for standing in standings)
        return [f"Who leads is not tested: there are more than {MAX_PAIRS} pairs of methods."] if many else []
    alone, shared = leads(standings)
    leading = "Nobody leads: no method was shown to be worse than another, which does not mean that they are equal."
    if alone or shared:
        counts = (("Alone in the lead", alone), ("Sharing the lead", shared))
        leading = " ".join(_counted(words, of, len(standings)) for words, of in counts if of)
    failed = sum(verdicts[verdict] for verdict in BY_FAILURES)
    parts = [
        (verdicts[Verdict.BETTER] + verdicts[Verdict.WORSE], "differ"),
        (failed, "differ in the runs in which they fail"),
        (verdicts[Verdict.SMALL], compared[0].rule.small),
        (verdicts[Verdict.EQUAL], f"are {compared[0].rule.equal}"),
        (verdicts[Verdict.UNDECIDED], f"are undecided{not_excluded(compared)}"),
    ]
    told = ", ".join(f"{count} {words}" for count, words in parts if count)
    losses = losses_range(pair.judgement for pair in compared)
    return [leading, f"Of {verdicts.total()} pairs of methods {told}; of each method {losses}."]
