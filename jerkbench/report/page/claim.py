"""The paper's claim, case by case, for the report of the study that asks for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.report.analysis.comparison import Comparison
from jerkbench.report.analysis.findings import names, varying_factors
from jerkbench.report.analysis.paper_claim import (
    CLAIMED,
    FAILS,
    HOLDS,
    OPEN,
    better,
    claim_sentences,
    claimed,
    headlines,
    verdicts,
)
from jerkbench.report.tables.table_model import number

if TYPE_CHECKING:
    import pandas as pd

CLASSES = {HOLDS: "passed", FAILS: "failed", OPEN: "open"}

NOTHING_SHOWN = "So few seeds show no difference between any two methods, so they say nothing about the claim."


@dataclass(frozen=True)
class Judged:
    """The claim in one case.

    Attributes:
        times: how many times better; empty without a pair of runs.
        interval: of that.
        word: whether the claim holds.
        style: class of that word.
        lost: how many runs were lost, in words.
    """

    times: str
    interval: str
    word: str
    style: str
    lost: str


@dataclass(frozen=True)
class Claim:
    """What a study says of the paper's claim.

    Attributes:
        title: the claim.
        headlines: one for each opponent.
        opponents: their names.
        cases: name of each, with the claim against each opponent.
        sentences: the same, case by case.
    """

    title: str
    headlines: list[str]
    opponents: list[str]
    cases: Mapping[str, list[Judged | None]]
    sentences: list[str]


def claim(rows: "pd.DataFrame", *, shown: bool) -> Claim | None:
    """Return what the rows say of the claim; None without its filters.

    Args:
        rows: one row a cell and seed.
        shown: whether they show anything at all.
    """
    comparisons = claimed(rows)
    if not comparisons:
        return None
    title = f"The paper's claim: more than {CLAIMED:g} times better"
    if not shown:
        return Claim(title, [NOTHING_SHOWN], [], {}, [])
    varying = varying_factors(rows)
    opponents = list(dict.fromkeys(names(comparison, varying)[1] for comparison in comparisons))
    cases = _cases(comparisons, varying, opponents)
    return Claim(title, headlines(rows, comparisons), opponents, cases, claim_sentences(rows, comparisons))


def _cases(
    comparisons: Sequence[Comparison], varying: Sequence[str], opponents: Sequence[str]
) -> dict[str, list[Judged | None]]:
    cases: dict[str, dict[str, Judged]] = {}
    for comparison, word in zip(comparisons, verdicts(comparisons), strict=True):
        _, opponent, where = names(comparison, varying)
        cases.setdefault(where.removeprefix(" on "), {})[opponent] = _judged(comparison, word)
    return {case: [of.get(name) for name in opponents] for case, of in cases.items()}


def _judged(comparison: Comparison, word: str) -> Judged:
    lost = f"{sum(comparison.pair.lost)} lost" if any(comparison.pair.lost) else ""
    style = CLASSES.get(word, "muted")
    if comparison.judgement.n == 0:
        return Judged("", "", word, style, lost)
    times, low, high = map(number, better(comparison))
    return Judged(times, f"[{low}, {high}]" if word in CLASSES else "", word, style, lost)
