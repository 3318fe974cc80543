"""Rows of runs -> each combination against a baseline, over the same seeds."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, unknown
from jerkbench.evaluation.statistics.family import Correction
from jerkbench.evaluation.statistics.judgement import LEVEL, MARGIN, Judgement, Verdict, judged
from jerkbench.evaluation.statistics.log_ratio import LogRatios, log_ratios
from jerkbench.evaluation.statistics.seeds_needed import seeds_needed
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd

Combination = tuple[str, ...]
"""The values of the six factors."""


@dataclass(frozen=True)
class Rule:
    """How the comparisons of a study are judged; see `jerkbench.evaluation.statistics.judgement.judged`.

    Attributes:
        margin: ratios up to 1 + margin are equal for every practical purpose.
        correction: what 5 % are 5 % of: studies with any wrong sentence, or sentences.
        level: these 5 %, or what a look at seeds that were added in blocks may spend of them.
    """

    margin: float = MARGIN
    correction: Correction = Correction.MAX_T
    level: float = LEVEL

    def __post_init__(self) -> None:
        """Check the margin.

        Raises:
            JerkbenchError: it is below 0.
        """
        if self.margin < 0:
            raise JerkbenchError(f"The margin of equality is {100 * self.margin:g} %; give 0 or more, for example 3.")

    def of(self, rows: "pd.DataFrame") -> "Rule":
        """Return the rule for the rows of a study, which know what their last look may spend."""
        return dataclasses.replace(self, level=min(self.level, rows.attrs.get(SPENDS, self.level)))


RULE = Rule()

SPENDS = "level"
"""Among the attributes of a study's rows: see `Rule.level`."""


@dataclass(frozen=True, eq=False)
class Runs:
    """The runs of one combination.

    Attributes:
        combination: values of the six factors.
        seeds: (n,) in ascending order.
        errors: (n,) the metric, infinite where the run was lost.
        lost: (n,) whether it was.
        phases: whether they are phases of one recording.
    """

    combination: Combination
    seeds: IntArray
    errors: FloatArray
    lost: BoolArray
    phases: bool

    def only(self, places: IntArray) -> "Runs":
        """Return the runs at ``places``."""
        return Runs(self.combination, self.seeds[places], self.errors[places], self.lost[places], self.phases)


@dataclass(frozen=True, eq=False)
class Pair:
    """The runs of two combinations on the seeds that both have.

    Attributes:
        subject: values of the six factors.
        baseline: of what it is compared with.
        ratios: log ratios of the metric, subject over baseline; a lost run is the worst of all.
        lost: how many of the subject's runs, and of the baseline's, diverged or failed.
        runs: seeds that both have.
        replicate: "seed" or "phase".
    """

    subject: Combination
    baseline: Combination
    ratios: LogRatios
    lost: tuple[int, int]
    runs: int
    replicate: str


@dataclass(frozen=True, eq=False)
class Comparison:
    """One combination against another.

    Attributes:
        pair: what was compared.
        judgement: ratio, interval and verdict at the level of the study; of phases of one recording ``low`` and
            ``high`` are the smallest and the largest ratio, and there is no p and no verdict.
        family: how many comparisons the study has.
        rule: how they were judged.
    """

    pair: Pair
    judgement: Judgement
    family: int
    rule: Rule = RULE

    @property
    def subject(self) -> Combination:
        """Values of the six factors."""
        return self.pair.subject

    @property
    def baseline(self) -> Combination:
        """Values of the six factors of what it is compared with."""
        return self.pair.baseline

    @property
    def replicate(self) -> str:
        """Either "seed" or "phase"."""
        return self.pair.replicate

    @property
    def verdict(self) -> Verdict:
        """At the level of the study."""
        return self.judgement.verdict

    @property
    def shown(self) -> bool:
        """Whether a difference was shown."""
        return self.verdict not in {Verdict.EQUAL, Verdict.UNDECIDED}

    @property
    def mark(self) -> str:
        """A star where a difference was shown, "=" where the two are equal."""
        return "*" if self.shown else "=" if self.verdict is Verdict.EQUAL else ""

    @cached_property
    def needed(self) -> int | None:
        """How many seeds would decide what is undecided; None where nothing is, or runs were lost."""
        ratios = self.pair.ratios
        if self.verdict is not Verdict.UNDECIDED or self.replicate == "phase" or not ratios.plain or ratios.n < 2:
            return None
        return seeds_needed(ratios.d, self.rule.margin, max(1, self.family), self.rule.level)


def family_note(comparisons: Sequence[Comparison]) -> str:
    """Say what the marks mean, and how many comparisons are undecided."""
    tested = [one for one in comparisons if one.replicate != "phase" and one.judgement.n]
    if not tested:
        return "Without seeds there is no test of a difference."
    rule = tested[0].rule
    marks = f"*: a difference was shown; =: equal within {100 * rule.margin:g} %."
    if rule.correction is Correction.FDR:
        test = f"Of the marks 5 % may be wrong (Benjamini and Hochberg over {len(tested)} comparisons)."
    else:
        test = (
            f"At most 5 % of such studies have any wrong mark (largest studentised mean log ratio of {len(tested)} "
            "comparisons, bootstrap over the seeds)."
        )
    if rule.level < LEVEL:
        test += f" Seeds were added in blocks: the last look spends {100 * rule.level:.2g} of these 5 %."
    undecided = sum(one.verdict is Verdict.UNDECIDED for one in tested)
    return f"{marks} {test}" + (f" {undecided} of {len(tested)} are undecided." if undecided else "")


def parse_baseline(text: str) -> dict[str, str]:
    """Read ``factor=value[;factor=value]`` (a comma does as well, where no value has one).

    Raises:
        JerkbenchError: it is not of that form, or names no factor.
    """
    parts = text.split(";") if ";" in text else text.split(",") if text.count("=") > 1 and "(" not in text else [text]
    found = {}
    for part in parts:
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not value:
            raise JerkbenchError(f"The baseline '{text}' is not of the form FACTOR=NAME, for example adaptation=none.")
        if key not in FACTORS:
            raise JerkbenchError(unknown("factor", key, FACTORS))
        found[key] = value
    return found


def compare_to(rows: "pd.DataFrame", metric: str, baseline: Mapping[str, str], rule: Rule = RULE) -> list[Comparison]:
    """Compare every combination with the one that is like it but for the factors of ``baseline``.

    What has no such partner, or is the partner itself, is left out. All of them are one family.

    Raises:
        JerkbenchError: no combination has the values of the baseline, or there is no such metric.
    """
    return judged_pairs(pairs_to(rows, metric, baseline), rule.of(rows))


def pairs_to(rows: "pd.DataFrame", metric: str, baseline: Mapping[str, str]) -> list[Pair]:
    """Return what `compare_to` compares, not yet judged.

    Raises:
        JerkbenchError: no combination has the values of the baseline, or there is no such metric.
    """
    rows = checked(rows, metric)
    groups = grouped(rows, metric)
    partners = {key: with_values(key, baseline) for key in groups}
    if not any(partner in groups for partner in partners.values()):
        raise JerkbenchError(_no_baseline(rows, baseline))
    return [
        paired(groups[key], groups[partner])
        for key, partner in partners.items()
        if partner in groups and partner != key
    ]


def grouped(rows: "pd.DataFrame", metric: str) -> dict[Combination, Runs]:
    """Return the runs of each combination; the factors are text."""
    errors = np.where(rows["status"] == "ok", rows[metric].to_numpy(dtype=float), np.inf)
    seeds, ok = rows["seed"].to_numpy(), (rows["status"] == "ok").to_numpy()
    phases = (rows["replicate"] == "phase").to_numpy()
    found: dict[Combination, list[int]] = {}
    for place, key in enumerate(zip(*(rows[factor] for factor in FACTORS), strict=True)):
        found.setdefault(key, []).append(place)
    groups = {}
    for key, places in found.items():
        order = np.array(places)[np.argsort(seeds[places], kind="stable")]
        groups[key] = Runs(key, seeds[order], errors[order], ~ok[order], bool(phases[order].any()))
    return groups


def judged_pairs(pairs: Iterable[Pair], rule: Rule = RULE) -> list[Comparison]:
    """Judge the pairs as one family; phases of one recording are not independent and have a range instead."""
    pairs = list(pairs)
    seeds = [pair for pair in pairs if pair.replicate != "phase"]
    verdicts = iter(judged([pair.ratios for pair in seeds], rule.margin, rule.level, rule.correction))
    return [
        Comparison(pair, _of_phases(pair.ratios) if pair.replicate == "phase" else next(verdicts), len(seeds), rule)
        for pair in pairs
    ]


def paired(ours: Runs, theirs: Runs) -> Pair:
    """Return the runs of two combinations on the seeds that both have."""
    if len(ours.seeds) != len(theirs.seeds) or (ours.seeds != theirs.seeds).any():
        _, first, second = np.intersect1d(ours.seeds, theirs.seeds, return_indices=True)
        ours, theirs = ours.only(first), theirs.only(second)
    lost = int(ours.lost.sum()), int(theirs.lost.sum())
    ratios = log_ratios(ours.errors, theirs.errors)
    replicate = "phase" if ours.phases else "seed"
    return Pair(ours.combination, theirs.combination, ratios, lost, len(ours.seeds), replicate)


def with_values(combination: Combination, values: Mapping[str, str]) -> Combination:
    """Return the combination with some of its factors replaced."""
    return tuple(values.get(key, value) for key, value in zip(FACTORS, combination, strict=True))


def _of_phases(ratios: LogRatios) -> Judgement:
    """Return the geometric mean, or with lost runs the median, with the range, and no test."""
    (one,) = judged([ratios])
    low, high = (np.exp(ratios.d.min()), np.exp(ratios.d.max())) if ratios.n > 1 else (np.nan, np.nan)
    return dataclasses.replace(
        one, low=float(low), high=float(high), p=np.nan, p_equal=np.nan, p_lost=np.nan, verdict=Verdict.UNDECIDED
    )


def _no_baseline(rows: "pd.DataFrame", baseline: Mapping[str, str]) -> str:
    key, value = next(((k, v) for k, v in baseline.items() if v not in set(rows[k])), next(iter(baseline.items())))
    if value in set(rows[key]):
        asked = ", ".join(f"{k}={v}" for k, v in baseline.items())
        return f"No combination has {asked} together; `jerkbench table DIR` shows those that there are."
    return unknown(key, value, {str(one) for one in rows[key]})
