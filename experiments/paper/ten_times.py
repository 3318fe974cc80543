"""The paper's claim "more than ten times better", tested scenario by scenario.

python experiments/paper/ten_times.py results/paper20
"""

import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from jerkbench.evaluation.judgement import LEVEL, Judgement, LogRatios, Verdict, judged
from jerkbench.jobs.study import load_study
from jerkbench.report.columns import varying_factors
from jerkbench.report.comparisons import Comparison
from jerkbench.report.findings import method_names, study_verdicts
from jerkbench.report.table_model import number

CLAIMED = 10.0
"""The paper: jerk and MTF make the 3-D position RMSE more than so many times smaller than the baseline's."""

CLAIM = {"filter": "jerk", "adaptation": "mtf"}
"""The combination of which that is said."""

AGAINST = ("baseline", "baseline_untuned")
"""What it is said against, without adaptation: with a tuned process noise, and with one that was never tuned."""

HOLDS, FAILS, OPEN = "holds", "does not hold", "stays open"
NO_INTERVAL, NO_PAIR = "has no interval", "has no pair of runs"

NOTHING_SHOWN = "So few seeds show no difference between any two methods, so they say nothing about the claim."

WORDS = {Verdict.BETTER: HOLDS, Verdict.WORSE: FAILS, Verdict.MORE_FAILED: FAILS}
"""What a verdict against the claim says of it; other verdicts leave it open."""


def claimed(rows: pd.DataFrame) -> list[Comparison]:
    """Return the comparisons that the claim is about; none without its filters."""
    if "position_rmse_m" not in rows or not _has(rows, CLAIM):
        return []
    against = [{"filter": name, "adaptation": "none"} for name in AGAINST]
    compared = [
        comparison
        for b in against
        if _has(rows, b)
        for comparison in study_verdicts(_only(rows, b), "position_rmse_m").against(b)
    ]
    kept = [comparison for comparison in compared if comparison.subject._replace(**CLAIM) == comparison.subject]
    return _against_the_claim(kept)


def _against_the_claim(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Judge all as one family: the ratio, times what is claimed, against 1; phases of one recording have no test."""
    tested = [comparison for comparison in comparisons if not comparison.phases]
    ratios = [comparison.ratios for comparison in tested]
    shifted = [LogRatios(of.d + math.log(CLAIMED), of.failed) for of in ratios]
    judgements = iter(judged(shifted, 0.0, min((of.rule.level for of in tested), default=LEVEL)))
    return [of._replace(judgement=_unshifted(next(judgements))) if not of.phases else of for of in comparisons]


def _unshifted(judgement: Judgement) -> Judgement:
    """Return the judgement on the claim with ratio and interval of the errors themselves."""
    ratio, low, high = (value / CLAIMED for value in (judgement.ratio, judgement.low, judgement.high))
    return judgement._replace(ratio=ratio, low=low, high=high)


def _only(rows: pd.DataFrame, against: Mapping[str, str]) -> pd.DataFrame:
    """The rows of both sides: the claim needs intervals, and no test of a family."""
    return rows[_are(rows, CLAIM) | _are(rows, against)]


def claim_word(comparison: Comparison) -> str:
    """Say whether the claim holds."""
    if comparison.judgement.n == 0:
        return NO_PAIR
    unknown = NO_INTERVAL if math.isnan(comparison.judgement.low) or comparison.phases else OPEN
    return WORDS.get(comparison.verdict, unknown)


def better(comparison: Comparison) -> tuple[float, float, float]:
    """Return how many times better the subject is, with the ends of the interval."""
    judgement = comparison.judgement
    ratio, low, high = (
        1 / value if value > 0 else math.inf for value in (judgement.ratio, judgement.high, judgement.low)
    )
    return ratio, low, high


def claims(rows: pd.DataFrame) -> list[str]:
    """Return what the rows say about the claim in each scenario, in sentences."""
    return claim_sentences(rows, claimed(rows))


def claim_sentences(rows: pd.DataFrame, comparisons: Sequence[Comparison]) -> list[str]:
    """Return a sentence for each of the claim's ``comparisons``."""
    varying = varying_factors(rows)
    return [_sentence(comparison, varying) for comparison in comparisons]


def headlines(rows: pd.DataFrame, comparisons: Sequence[Comparison]) -> list[str]:
    """Return one sentence for each opponent: in how many scenarios the claim holds."""
    varying = varying_factors(rows)
    counts: dict[str, Counter[str]] = {}
    for comparison in comparisons:
        counts.setdefault(_head(comparison, varying), Counter())[claim_word(comparison)] += 1
    return [f"{head} {_counted(words)}" for head, words in counts.items()]


def _counted(words: Counter[str]) -> str:
    parts = ", ".join(
        f"it {word} in {words[word]}" for word in (HOLDS, FAILS, OPEN, NO_INTERVAL, NO_PAIR) if words[word]
    )
    return f"Of {words.total()} cases {parts}."


def _head(comparison: Comparison, varying: Sequence[str]) -> str:
    subject, baseline, _ = method_names(comparison, varying)
    return f"The paper says that {subject} is more than {CLAIMED:g} times better than {baseline}."


def _sentence(comparison: Comparison, varying: Sequence[str]) -> str:
    head, word = _head(comparison, varying), claim_word(comparison)
    _, _, where = method_names(comparison, varying)
    lost = "" if comparison.phases else f"; {comparison.judgement.failure_rates}"
    if (n := comparison.judgement.n) == 0:
        return f"{head} Nothing can be said{where}: no run of both has a value."
    times, low, high = map(number, better(comparison))
    if word == NO_INTERVAL:
        return f"{head} Seen: {times} times{where}, over {n} runs, without an interval{lost}."
    return f"{head} It {word}: {times} times{where} (95 % {low} to {high}, {n} seeds){lost}."


def _has(rows: pd.DataFrame, values: Mapping[str, str]) -> bool:
    return bool(_are(rows, values).any())


def _are(rows: pd.DataFrame, values: Mapping[str, str]) -> pd.Series:
    """Which rows have these values."""
    return (rows[list(values)].astype(str) == list(values.values())).all(axis=1)


def said(rows: pd.DataFrame) -> list[str]:
    """Return all that a study says of the claim: of each opponent, then case by case; empty without its filters."""
    comparisons = claimed(rows)
    standings = study_verdicts(rows, "position_rmse_m").standings
    if comparisons and all(pair.verdict is Verdict.UNDECIDED for one in standings for pair in one.tested):
        return [NOTHING_SHOWN]
    return [*headlines(rows, comparisons), *claim_sentences(rows, comparisons)]


if __name__ == "__main__":
    print(*said(load_study(Path(sys.argv[1])).rows), sep="\n")
