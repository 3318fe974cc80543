"""Comparisons -> sentences: what was shown, what was not, and what speaks against the paper."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from jerkbench.report.analysis.comparison import Combination, Comparison, compare_to
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.tables.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


def findings(rows: "pd.DataFrame", metric: str) -> list[str]:
    """Return a sentence for each comparison with ``adaptation=none`` and ``filter=baseline``, where these are there.

    Those of one scenario with one of the two are a family for Holm. There is none of a metric whose lowest is not the
    best.

    Raises:
        JerkbenchError: no such metric.
    """
    varying = varying_factors(rows)
    return [sentence(one, varying) for one in compared(rows, metric)]


def compared(rows: "pd.DataFrame", metric: str) -> list[Comparison]:
    """Return every comparison with ``adaptation=none`` and ``filter=baseline``; none of a metric without a best.

    Raises:
        JerkbenchError: no such metric.
    """
    if not quantity(metric).lowest_is_best:
        return []
    return [one for baseline in _baselines(rows) for one in compare_to(rows, metric, baseline)]


def sentence(one: Comparison, varying: Sequence[str]) -> str:
    """Say one comparison, with the factors that vary in the study."""
    who, whom, where = names(one, varying)
    lost = losses(one, who, whom)
    if one.paired.n == 0:
        return f"{who} cannot be compared with {whom}{where}: {lost or 'no run of both has a value'}."
    if one.paired.low == one.paired.high == 1.0:
        return f"{who} gives the same as {whom}{where} ({_count(one)}){and_lost(lost)}."
    factor = one.paired.ratio
    if one.replicate == "phase":
        over = f"range {_range(one)} over {one.paired.n} phases" if one.paired.n > 1 else "one run"
        detail = f"({over} of one recording; no test)"
        return f"{who} {_times(factor)} {whom}{where} {detail}{and_lost(lost)}."
    detail = f"(95 % {_range(one)}, {one.paired.n} seeds)" if math.isfinite(one.paired.low) else "(1 seed)"
    if not one.shown:
        return f"{_not_shown(one, f'{who} and {whom}{where}')}: {number(factor)} times {detail}{and_lost(lost)}."
    return f"{who} {_times(factor)} {whom}{where} {detail}{and_lost(lost)}."


def _count(one: Comparison) -> str:
    """How many seeds or phases; a recording in which nothing is withheld has one run, and no phases."""
    if one.paired.n == 1:
        return "one run" if one.replicate == "phase" else "1 seed"
    return f"{one.paired.n} {one.replicate}s"


def _not_shown(one: Comparison, between: str) -> str:
    """Say that nothing was shown; or that nothing could be, lest the interval beside it seems to say otherwise."""
    if not one.needed:
        return f"No difference was shown between {between}"
    n = one.paired.n
    return f"{n} seed{'s' * (n > 1)} cannot show any difference between {between} ({one.needed} could)"


def varying_factors(rows: "pd.DataFrame") -> tuple[str, ...]:
    """Return the factors that tell the combinations apart."""
    return tuple(key for key in FACTORS if len(rows[key].astype(str).unique()) > 1)


def _baselines(rows: "pd.DataFrame") -> Iterator[dict[str, str]]:
    for key, value in (("adaptation", "none"), ("filter", "baseline")):
        values = set(rows[key].astype(str))
        if value in values and len(values) > 1:
            yield {key: value}


def names(one: Comparison, varying: Sequence[str]) -> tuple[str, str, str]:
    """The names of both (what differs between them, filter and adaptation always), and where they are compared."""
    differ = [key for key, a, b in zip(FACTORS, one.subject, one.baseline, strict=True) if a != b]
    named = [key for key in FACTORS if key in differ or (key in ("filter", "adaptation") and key in varying)]
    places = [key for key in varying if key not in named]
    where = ", ".join(dict(zip(FACTORS, one.subject, strict=True))[key] for key in places)
    return _joined(one.subject, named), _joined(one.baseline, named), f" on {where}" if where else ""


def _joined(combination: Combination, keys: Sequence[str]) -> str:
    return "+".join(dict(zip(FACTORS, combination, strict=True))[key] for key in keys)


def _times(ratio: float) -> str:
    times, word = (1 / ratio, "better") if ratio < 1 else (ratio, "worse")
    return f"is {factor_number(times)} times {word} than"


def _range(one: Comparison) -> str:
    """The interval of the factor that the sentence states: of better, the inverse."""
    low, high = one.paired.low, one.paired.high
    shown = one.shown or one.replicate == "phase"
    ends = (1 / high, 1 / low) if shown and one.paired.ratio < 1 and low > 0 else (low, high)
    written = factor_number if shown else number
    return f"{written(ends[0])} to {written(ends[1])}"


def losses(one: Comparison, who: str, whom: str) -> str:
    """Say how many runs either lost; nothing where all went well."""
    pairs = ((who, one.lost), (whom, one.lost_baseline))
    return " and ".join(f"{name} lost {lost} of {one.runs} runs" for name, lost in pairs if lost)


def and_lost(lost: str) -> str:
    """Say what a sentence leaves out."""
    return f"; {lost}, which this leaves out" if lost else ""
