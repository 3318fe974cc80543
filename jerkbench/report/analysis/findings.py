"""Comparisons -> sentences: what was shown, what was not, and what speaks against the paper."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.comparison import RULE, Combination, Comparison, Rule, judged_pairs, pairs_to
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.tables.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


def findings(rows: "pd.DataFrame", metric: str, rule: Rule = RULE) -> list[str]:
    """Return a sentence for each comparison with ``adaptation=none`` and ``filter=baseline``, where these are there.

    All of them are one family. There is none of a metric whose lowest is not the best.

    Raises:
        JerkbenchError: no such metric.
    """
    varying = varying_factors(rows)
    return [sentence(one, varying) for one in compared(rows, metric, rule)]


def compared(rows: "pd.DataFrame", metric: str, rule: Rule = RULE) -> list[Comparison]:
    """Return every comparison with ``adaptation=none`` and ``filter=baseline``; none of a metric without a best.

    Raises:
        JerkbenchError: no such metric.
    """
    if not quantity(metric).lowest_is_best:
        return []
    return judged_pairs(
        [pair for baseline in _baselines(rows) for pair in pairs_to(rows, metric, baseline)], rule.of(rows)
    )


def sentence(one: Comparison, varying: Sequence[str]) -> str:
    """Say one comparison, with the factors that vary in the study."""
    who, whom, where = names(one, varying)
    found, lost = one.judgement, and_lost(losses(one, who, whom))
    if found.n == 0:
        return f"{who} cannot be compared with {whom}{where}: no run of both has a value."
    if all(count == one.pair.runs for count in one.pair.lost):
        return f"{who} cannot be compared with {whom}{where}: both lost all {one.pair.runs} runs."
    if found.low == found.high == 1.0 and not lost:
        return f"{who} gives the same as {whom}{where} ({_count(one)})."
    if one.replicate == "phase":
        return f"{who} {_times(found.ratio)} {whom}{where} ({_phases(one)}){lost}."
    if one.verdict in {Verdict.FEWER_LOST, Verdict.MORE_LOST}:
        return f"{who} {one.verdict.value} than {whom}{where}: {_against(one)}."
    return _tested(one, who, whom, where) + f"{lost}."


def _tested(one: Comparison, who: str, whom: str, where: str) -> str:
    """Say what the test of the errors says."""
    ratio = one.judgement.ratio
    if one.verdict is Verdict.EQUAL:
        equal = f"equal within {100 * one.rule.margin:g} %"
        return f"{who} and {whom} are {equal}{where}: {number(ratio)} times {_detail(one)}"
    if one.verdict is Verdict.UNDECIDED:
        more = f"; {one.needed} seeds would decide" if one.needed else ""
        return f"Undecided between {who} and {whom}{where}: {number(ratio)} times {_detail(one)}{more}"
    return f"{who} {_times(ratio)} {whom}{where} {_detail(one)}"


def _detail(one: Comparison) -> str:
    """The interval, what it is of, and how many seeds."""
    median = "median, " if one.judgement.median else ""
    interval = "" if math.isnan(one.judgement.low) else f"95 % {_range(one)}, "
    return f"({median}{interval}{_count(one)})"


def _phases(one: Comparison) -> str:
    n = one.judgement.n
    over = f"range {_range(one)} over {n} phases" if n > 1 else "one run"
    return f"{over} of one recording; no test"


def _against(one: Comparison) -> str:
    ours, theirs = one.judgement.failures
    runs = one.judgement.n
    return f"{ours} of {runs} lost or locked out against {theirs} of {runs} (McNemar, p {number(one.judgement.p_lost)})"


def _count(one: Comparison) -> str:
    """How many seeds or phases; a recording in which nothing is withheld has one run, and no phases."""
    n = one.judgement.n
    if n == 1:
        return "one run" if one.replicate == "phase" else "1 seed"
    return f"{n} {one.replicate}s"


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
    times, word = (1 / ratio, "better") if 0 < ratio < 1 else (ratio, "worse")
    return f"is {factor_number(times)} times {word} than"


def _range(one: Comparison) -> str:
    """The interval of the factor that the sentence states: of better, the inverse."""
    low, high = one.judgement.low, one.judgement.high
    inverse = (one.shown or one.replicate == "phase") and 0 < one.judgement.ratio < 1
    ends = (1 / high if high else math.inf, 1 / low if low else math.inf) if inverse else (low, high)
    written = factor_number if one.shown or one.replicate == "phase" else number
    return f"{written(ends[0])} to {written(ends[1])}"


def losses(one: Comparison, who: str, whom: str) -> str:
    """Say how many runs either lost, or locked out in; nothing where all went well."""
    told = []
    for name, lost, failed in zip((who, whom), one.pair.lost, one.judgement.failures, strict=True):
        words = [f"lost {lost}"] * (lost > 0) + [f"locked out in {failed - lost}"] * (failed > lost)
        told += [f"{name} {' and '.join(words)} of {one.pair.runs} runs"] * bool(words)
    return " and ".join(told)


def and_lost(lost: str) -> str:
    """Say which runs count as the worst."""
    return f"; {lost}, which counts as worse than any error" if lost else ""
