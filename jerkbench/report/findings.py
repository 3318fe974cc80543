"""Comparisons -> sentences: what was shown, what was not, and what speaks against the paper."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench.report.comparison import Combination, Comparison, compare_to, with_values
from jerkbench.report.factors import FACTORS
from jerkbench.report.quantities import quantity
from jerkbench.report.table import number

if TYPE_CHECKING:
    import pandas as pd

CLAIMED = 10.0
"""The paper: jerk and MTF make the 3-D position RMSE more than so many times smaller than the baseline's."""

CLAIM = {"filter": "jerk", "adaptation": "mtf"}
"""The combination of which that is said."""

AGAINST = ("baseline", "baseline_naive")
"""What it is said against, without adaptation: with a tuned process noise, and with one that was never tuned."""


def findings(rows: "pd.DataFrame", metric: str) -> list[str]:
    """Return a sentence for each comparison with ``adaptation=none`` and ``filter=baseline``, where these are there.

    Those of one scenario with one of the two are a family for Holm. There is none of a metric whose lowest is not the
    best.

    Raises:
        JerkbenchError: no such metric.
    """
    if not quantity(metric).lowest_is_best:
        return []
    varying = varying_factors(rows)
    compared = (one for baseline in _baselines(rows) for one in compare_to(rows, metric, baseline))
    return [sentence(one, varying) for one in compared]


def claims(rows: "pd.DataFrame") -> list[str]:
    """Return what the rows say about the paper's "more than ten times" in each scenario; empty without its filters."""
    if "position_rmse_m" not in rows or not _has(rows, CLAIM):
        return []
    against = [{"filter": name, "adaptation": "none"} for name in AGAINST]
    compared = [one for b in against if _has(rows, b) for one in compare_to(rows, "position_rmse_m", b)]
    varying = varying_factors(rows)
    return [_claim(one, varying) for one in compared if _is(one.subject, CLAIM)]


def _has(rows: "pd.DataFrame", values: Mapping[str, str]) -> bool:
    return all(value in set(rows[key].astype(str)) for key, value in values.items())


def _is(combination: Combination, values: Mapping[str, str]) -> bool:
    return with_values(combination, values) == combination


def sentence(one: Comparison, varying: Sequence[str]) -> str:
    """Say one comparison, with the factors that vary in the study."""
    who, whom, where = _names(one, varying)
    lost = _lost(one, who, whom)
    if one.paired.n == 0:
        return f"{who} cannot be compared with {whom}{where}: {lost or 'no run of both has a value'}."
    if one.paired.low == one.paired.high == 1.0:
        return f"{who} gives the same as {whom}{where} ({one.paired.n} {one.replicate}s){_and(lost)}."
    factor = one.paired.ratio
    if one.replicate == "phase":
        detail = f"(range {_range(one)} over {one.paired.n} phases of one recording; no test)"
        return f"{who} {_times(factor)} {whom}{where} {detail}{_and(lost)}."
    detail = f"(95 % {_range(one)}, {one.paired.n} seeds)" if math.isfinite(one.paired.low) else "(1 seed)"
    if not one.shown:
        return f"No difference was shown between {who} and {whom}{where}: {number(factor)} times {detail}{_and(lost)}."
    return f"{who} {_times(factor)} {whom}{where} {detail}{_and(lost)}."


def varying_factors(rows: "pd.DataFrame") -> tuple[str, ...]:
    """Return the factors that tell the combinations apart."""
    return tuple(key for key in FACTORS if len(rows[key].astype(str).unique()) > 1)


def _baselines(rows: "pd.DataFrame") -> Iterator[dict[str, str]]:
    for key, value in (("adaptation", "none"), ("filter", "baseline")):
        values = set(rows[key].astype(str))
        if value in values and len(values) > 1:
            yield {key: value}


def _names(one: Comparison, varying: Sequence[str]) -> tuple[str, str, str]:
    """The names of both (what differs between them, filter and adaptation always), and where they are compared."""
    differ = [key for key, a, b in zip(FACTORS, one.subject, one.baseline, strict=True) if a != b]
    named = [key for key in FACTORS if key in differ or (key in ("filter", "adaptation") and key in varying)]
    places = [key for key in varying if key not in named]
    where = ", ".join(dict(zip(FACTORS, one.subject, strict=True))[key] for key in places)
    return _joined(one.subject, named), _joined(one.baseline, named), f" on {where}" if where else ""


def _joined(combination: Combination, keys: Sequence[str]) -> str:
    return "+".join(dict(zip(FACTORS, combination, strict=True))[key] for key in keys)


def _times(ratio: float) -> str:
    return f"is {number(1 / ratio)} times better than" if ratio < 1 else f"is {number(ratio)} times worse than"


def _range(one: Comparison) -> str:
    """The interval of the factor that the sentence states: of better, the inverse."""
    low, high = one.paired.low, one.paired.high
    shown = one.shown or one.replicate == "phase"
    ends = (1 / high, 1 / low) if shown and one.paired.ratio < 1 and low > 0 else (low, high)
    return f"{number(ends[0])} to {number(ends[1])}"


def _lost(one: Comparison, who: str, whom: str) -> str:
    pairs = ((who, one.lost), (whom, one.lost_baseline))
    return " and ".join(f"{name} lost {lost} of {one.runs} runs" for name, lost in pairs if lost)


def _and(lost: str) -> str:
    return f"; {lost}, which this leaves out" if lost else ""


def _claim(one: Comparison, varying: Sequence[str]) -> str:
    who, whom, where = _names(one, varying)
    head = f"The paper says that {who} is more than {CLAIMED:g} times better than {whom}."
    lost = _lost(one, who, whom)
    if one.paired.n == 0:
        return f"{head} Nothing can be said{where}: {lost or 'no run of both has a value'}."
    better, ends = 1 / one.paired.ratio, (1 / one.paired.high, 1 / one.paired.low)
    seen = (
        f"{number(better)} times{where} (95 % {number(ends[0])} to {number(ends[1])}, {one.paired.n} seeds){_and(lost)}"
    )
    if one.replicate == "phase" or math.isnan(ends[0]):
        return f"{head} Seen: {number(better)} times{where}, over {one.paired.n} runs, without an interval{_and(lost)}."
    word = "It holds" if ends[0] > CLAIMED else "It does not hold" if ends[1] < CLAIMED else "It stays open"
    return f"{head} {word}: {seen}."
