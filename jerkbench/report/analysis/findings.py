"""The comparisons with a study's baselines in sentences."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench.evaluation.statistics.intervals import up_to
from jerkbench.evaluation.statistics.judgement import BY_LOSSES, Verdict
from jerkbench.report.analysis.answer import certain_size, duel_sentence, duels
from jerkbench.report.analysis.columns import FACTORS
from jerkbench.report.analysis.standings import Comparison, Standing
from jerkbench.report.analysis.study_verdicts import StudyVerdicts
from jerkbench.report.tables.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


def findings(rows: "pd.DataFrame", verdicts: StudyVerdicts, baseline: Mapping[str, str] | None = None) -> list[str]:
    """Return a sentence for each comparison with ``baseline``, the largest certain difference first.

    Without one, with ``adaptation=none`` and ``filter=baseline``, where these are there. Of a metric whose lowest is
    not the best there is none.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    varying = varying_factors(rows)
    return [sentence(comparison, varying) for comparison in sorted(compared(rows, verdicts, baseline), key=_order)]


def _order(comparison: Comparison) -> float:
    """Sort by what is certain of a difference; of phases, by that end of their range that is nearest to none."""
    low, high = comparison.judgement.low, comparison.judgement.high
    if not comparison.phases:
        return -certain_size(comparison.judgement)
    return -max(math.log(low) if low > 1 else 0.0, -math.log(high) if 0 < high < 1 else 0.0)


def compared(
    rows: "pd.DataFrame", verdicts: StudyVerdicts, baseline: Mapping[str, str] | None = None
) -> list[Comparison]:
    """Return every comparison of which `findings` has a sentence."""
    if not verdicts.standings:
        return []
    baselines = [baseline] if baseline else study_baselines(rows)
    return [comparison for values in baselines for comparison in verdicts.against(values)]


def sentence(comparison: Comparison, varying: Sequence[str]) -> str:
    """Say what a comparison shows, with the factors that vary in the study."""
    subject, baseline, where = method_names(comparison, varying)
    judgement, lost = comparison.judgement, losses_clause(comparison, subject, baseline)
    n, ratio, known = judgement.n, judgement.ratio, 0 < judgement.ratio < math.inf
    noun = "phases" if comparison.phases else "seeds"
    # a recording in which nothing is withheld has one run, and no phases
    count = f"{n} {noun}" if n != 1 else "one run" if comparison.phases else "1 seed"
    if n == 0:
        return f"{subject} cannot be compared with {baseline}{where}: no run of both has a value."
    if all(count == comparison.runs for count in comparison.lost):
        return f"{subject} cannot be compared with {baseline}{where}: both lost all {comparison.runs} runs."
    if not (comparison.ratios.d.any() or any(judgement.failures)):
        return f"{subject} gives the same as {baseline}{where} ({count}){lost}."
    if comparison.phases:
        over = f"{f'range {_range(comparison)} over ' if known else ''}{count}" if n > 1 else count
        return f"{subject} {_times(ratio)} {baseline}{where} ({over} of one recording; no test){lost}."
    if comparison.verdict in BY_LOSSES:
        (ours, theirs), p = judgement.failures, number(judgement.p_lost)
        bounds = f"{up_to(ours, n)} against {up_to(theirs, n)}; McNemar, p {p}"
        counts = f"{ours} of {n} lost or locked out against {theirs} of {n} ({bounds})"
        return f"{subject} {comparison.verdict.value} than {baseline}{where}: {counts}."
    median = "median, " if judgement.median else ""
    interval = "" if math.isnan(judgement.low) else f"95 % {_range(comparison)}, "
    detail = f"({median}{interval}{count})" if known else f"(median: that run of the one is lost, {count})"
    factor = f"{number(ratio)} times " if known else ""
    said = f"{subject} {_times(ratio)} {baseline}{where} {detail}"
    if comparison.verdict is Verdict.EQUAL:
        said = f"{subject} and {baseline} are {comparison.rule.equal}{where}: {factor}{detail}"
    elif comparison.verdict is Verdict.UNDECIDED:
        more = f"; {comparison.needed} seeds would decide" if comparison.needed else ""
        more += f", as {judgement.reason}" if judgement.reason else ""
        said = f"Undecided between {subject} and {baseline}{where}: {factor}{detail}{more}"
    return f"{said}{lost}."


def varying_factors(rows: "pd.DataFrame") -> tuple[str, ...]:
    """Return the factors that tell the combinations apart."""
    return tuple(key for key in FACTORS if len(rows[key].astype(str).unique()) > 1)


def study_baselines(rows: "pd.DataFrame", factors: Sequence[str] = ("adaptation", "filter")) -> list[dict[str, str]]:
    """Return the baselines among a study's ``factors``: the plain value of each that has others beside it."""
    values = {factor: set(rows[factor].astype(str)) for factor in factors}
    return [{factor: REFERENCES[factor]} for factor in factors if {REFERENCES[factor]} < values[factor]]


def method_names(comparison: Comparison, varying: Sequence[str]) -> tuple[str, str, str]:
    """The names of both (what differs between them, filter and adaptation always), and where they are compared."""
    differ = [key for key, a, b in zip(FACTORS, comparison.subject, comparison.baseline, strict=True) if a != b]
    named = [key for key in FACTORS if key in differ or (key in ("filter", "adaptation") and key in varying)]
    places = [key for key in varying if key not in named]
    where = ", ".join(getattr(comparison.subject, key) for key in places)
    subject, baseline = (
        "+".join(getattr(of, key) for key in named) for of in (comparison.subject, comparison.baseline)
    )
    return subject, baseline, f" on {where}" if where else ""


def _times(ratio: float) -> str:
    if not 0 < ratio < math.inf:
        return f"is {'worse' if ratio else 'better'} than"
    times, word = (1 / ratio, "better") if 0 < ratio < 1 else (ratio, "worse")
    return f"is {factor_number(times)} times {word} than"


def _range(comparison: Comparison) -> str:
    """The interval of the factor that the sentence states: of better, the inverse."""
    low, high = comparison.judgement.low, comparison.judgement.high
    inverse = (comparison.shown or comparison.phases) and 0 < comparison.judgement.ratio < 1
    ends = (1 / high if high else math.inf, 1 / low if low else math.inf) if inverse else (low, high)
    written = factor_number if comparison.shown or comparison.phases else number
    if math.isinf(ends[1]):
        return f"from {written(ends[0])} up, since a run was lost"
    return f"{written(ends[0])} to {written(ends[1])}"


def losses_clause(comparison: Comparison, subject: str, baseline: str) -> str:
    """Say how many runs either lost, or locked out in, and how many may be; of phases nothing where all went well."""
    told, runs, phases = [], comparison.runs, comparison.phases
    for name, lost, failed in zip((subject, baseline), comparison.lost, comparison.judgement.failures, strict=True):
        words = [f"lost {lost}"] * (lost > 0) + [f"locked out in {failed - lost}"] * (failed > lost)
        bound = "" if phases else f" ({up_to(failed, runs)})"
        told += [f"{name} {' and '.join(words)} of {runs} runs{bound}"] * bool(words)
    if told:
        return f"; {' and '.join(told)}, which counts as worse than any error"
    return "" if phases else f"; {comparison.judgement.losses}"


# The findings of a study by size and certainty: every method against what it changes, over all scenarios.

REFERENCES = {"filter": "baseline", "adaptation": "none"}
"""What the other values of a factor are held against in a study that has it."""


def strongest(standings: Sequence[Standing]) -> list[str]:
    """Return a sentence for every two methods that differ in one factor, over all scenarios, strongest first.

    Of a factor that has its reference (`REFERENCES`) in the study the others are held against that, else every two.
    The order is that of `Duel.certain_size`: the mean over the scenarios of what is certain of the difference.
    """
    references = _references(standings)
    told = [_told(standing, references) for standing in standings]
    if len(told) == 1:  # the comparisons' own sentences
        varying = [factor for k, factor in enumerate(FACTORS) if len({rival[k] for rival in told[0].rivals}) > 1]
        ranked = sorted(told[0].comparisons, key=lambda pair: -certain_size(pair.judgement))
        return [sentence(pair, varying) for pair in ranked]
    return [duel_sentence(duel) for duel in sorted(duels(told), key=lambda duel: -duel.certain_size)]


def largest(standings: Sequence[Standing]) -> list[tuple[float, Comparison]]:
    """Return each comparison of `strongest` that shows a difference, with what is certain of it, the largest first."""
    references = _references(standings)
    pairs = [pair for standing in standings for pair in _told(standing, references).tested]
    weighed = [(certain_size(pair.judgement), pair) for pair in pairs]
    return sorted(((weight, pair) for weight, pair in weighed if weight > 0), key=lambda one: -one[0])


def _references(standings: Iterable[Standing]) -> dict[str, str]:
    rivals = {rival for standing in standings for rival in standing.rivals}
    values = {factor: {rival[k] for rival in rivals} for k, factor in enumerate(FACTORS)}
    return {factor: name for factor, name in REFERENCES.items() if name in values[factor]}


def _told(standing: Standing, references: Mapping[str, str]) -> Standing:
    """Return the standing with those comparisons alone that say something about one factor."""
    telling = []
    for pair in standing.comparisons:
        values = zip(FACTORS, pair.subject, pair.baseline, strict=True)
        differ = [(factor, both) for factor, *both in values if both[0] != both[1]]
        if len(differ) == 1 and all(references.get(factor, both[0]) in both for factor, both in differ):
            telling.append(pair)
    return standing._replace(comparisons=tuple(telling))
