"""The first screen of a report: the answer, methods x scenarios in one picture, settings, the findings."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from jerkbench.evaluation.statistics.judgement import WINS, Verdict
from jerkbench.report.analysis.answer import Answer, against, answer, mean_log_ratio, reference_method, size_text
from jerkbench.report.analysis.columns import SCENARIO_FACTORS
from jerkbench.report.analysis.findings import compared, sentence, strongest, varying_factors
from jerkbench.report.analysis.standings import Comparison, Standing, verdict_sentences
from jerkbench.report.analysis.study_verdicts import StudyVerdicts, across
from jerkbench.report.tables.table_model import number

if TYPE_CHECKING:
    import pandas as pd

MOST = 10
"""So many findings are read; the others are behind a fold."""

PARTS = ("filter", "adaptation")
"""Parts of a method; the noise is among the parameters of the filter."""


@dataclass(frozen=True)
class ShownSettings:
    """The parameters of one method in a study.

    Attributes:
        method: filter and adaptation.
        tried: how many settings it ran with in a scenario, the most.
        parameters: each with its value, or with its values where there are several.
    """

    method: str
    tried: int
    parameters: str


@dataclass(frozen=True)
class FirstScreen:
    """What a reader sees first.

    Attributes:
        answer: who won and by how much, and what that rests on.
        matrix: methods x scenarios; None where nothing was compared.
        settings: values of each method's parameters.
        summary: who leads how often, how many pairs of methods are what.
        findings: sentences by size and certainty.
        more: further ones.
        across: sentences about all scenarios together.
        every: heading and sentences of each scenario's comparisons with the baselines.
    """

    answer: Answer
    matrix: "Matrix | None"
    settings: list[ShownSettings]
    summary: list[str]
    findings: list[str]
    more: list[str]
    across: list[str]
    every: list[tuple[str, list[str]]]


def first_screen(
    rows: "pd.DataFrame", verdicts: StudyVerdicts, metric: str, about: Mapping[str, Mapping[str, Any]]
) -> FirstScreen:
    """Return what a reader sees first.

    Args:
        rows: one row a cell and seed.
        verdicts: of the study, in the leading metric.
        metric: that.
        about: what is stored beside each cell's rows, by key.
    """
    standings = verdicts.standings
    findings = strongest(standings)
    return FirstScreen(
        answer=answer(standings),
        matrix=matrix(standings),
        settings=settings(about.values()),
        summary=verdict_sentences(standings),
        findings=findings[:MOST],
        more=findings[MOST:],
        across=across(rows, verdicts, metric),
        every=_every(compared(rows, verdicts), varying_factors(rows)),
    )


def settings(about: Iterable[Mapping[str, Any]]) -> list[ShownSettings]:
    """Return each method's parameters, of the filter and the adaptation."""
    values: dict[str, dict[str, dict[str, None]]] = {}
    tried: dict[str, dict[tuple[str, str], set[str]]] = {}
    for cell in about:
        spec, labels = cell["spec"], cell["labels"]
        method = " + ".join(str(labels[factor]) for factor in ("filter", "adaptation"))
        own = {f"{kind}.{name}": value for kind in PARTS for name, value in spec[kind].items() if name != "name"}
        for name, value in own.items():
            values.setdefault(method, {}).setdefault(name, {})[_short(value)] = None
        scenario = (str(labels["dataset"]), str(labels["disturbance"]))
        tried.setdefault(method, {}).setdefault(scenario, set()).add(json.dumps(own, sort_keys=True, default=str))
    return [
        ShownSettings(
            method,
            max(map(len, tried[method].values())),
            ", ".join(f"{name} {' or '.join(list(of)[:MOST])}" for name, of in values.get(method, {}).items())
            or "none",
        )
        for method in tried
    ]


def _short(value: object) -> str:
    return number(value) if isinstance(value, float) else str(value)


def _every(comparisons: Sequence[Comparison], varying: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return every comparison in a sentence, scenario by scenario."""
    shown = [key for key in SCENARIO_FACTORS if key in varying]
    scenes: dict[str, list[Comparison]] = {}
    for comparison in comparisons:
        scenes.setdefault(", ".join(getattr(comparison.subject, key) for key in shown), []).append(comparison)
    return [(_counted(name, of_scene), _ordered(of_scene, varying)) for name, of_scene in scenes.items()]


def _counted(name: str, comparisons: Sequence[Comparison]) -> str:
    where = f"{name}: " if name else ""
    if all(math.isnan(comparison.judgement.p) for comparison in comparisons):
        return f"{where}{len(comparisons)} comparisons, without a test (no seeds)"
    counts = Counter(comparison.verdict.value for comparison in comparisons)
    return f"{where}{len(comparisons)} comparisons: {', '.join(f'{count} {word}' for word, count in counts.items())}"


def _ordered(comparisons: Sequence[Comparison], varying: Sequence[str]) -> list[str]:
    """Those that were shown first."""
    return [
        sentence(comparison, varying) for comparison in sorted(comparisons, key=lambda comparison: not comparison.shown)
    ]


# The picture of a study: methods x scenarios, each error relative to one reference, coloured where it was shown.

SHADES = (1.1, 1.5)
"""Factors from which on a shown difference has the second and the third shade."""

MANY_SCENARIOS = 8
"""With more scenarios than this they stand in rows, if the methods are fewer."""


@dataclass(frozen=True)
class MatrixCell:
    """One method in one scenario.

    Attributes:
        text: ratio of its error to that of the reference.
        style: better1 to better3, worse1 to worse3, equal, undecided, reference or absent.
        hint: the comparison in words.
        lost: its lost or locked out runs, or nothing.
        leads: whether it is in the leading group of the scenario.
    """

    text: str
    style: str
    hint: str = ""
    lost: str = ""
    leads: bool = False


@dataclass(frozen=True)
class Matrix:
    """Methods x scenarios.

    Attributes:
        reference: name of the method with the ratio 1.
        corner: what stands in the rows.
        columns: heads of the columns.
        lines: label of each row, and its cells.
        worst: of each method, its largest ratio and the scenario of that.
    """

    reference: str
    corner: str
    columns: tuple[str, ...]
    lines: list[tuple[str, list[MatrixCell]]]
    worst: list[tuple[str, str, str]]


def matrix(standings: Sequence[Standing]) -> Matrix | None:
    """Return the picture of a study; None without two compared methods."""
    tested = [standing for standing in standings if standing.tested]
    if not tested:
        return None
    reference = reference_method(tested)
    names = list(dict.fromkeys(standing.name(rival) for standing in tested for rival in standing.rivals))
    scenarios = [", ".join(standing.scenario) or "the scenario" for standing in tested]
    seen = [against(standing, reference) for standing in tested]
    names.sort(key=lambda name: mean_log_ratio(seen, name))
    rows = [[_cell(standing, seen[k], name, reference) for k, standing in enumerate(tested)] for name in names]
    worst = [_worst(name, seen, scenarios) for name in names if any(name in of for of in seen)]
    if len(scenarios) > MANY_SCENARIOS and len(scenarios) > len(names):
        turned = [list(cells) for cells in zip(*rows, strict=True)]
        return Matrix(reference, "scenario", tuple(names), list(zip(scenarios, turned, strict=True)), worst)
    return Matrix(reference, "method", tuple(scenarios), list(zip(names, rows, strict=True)), worst)


def _cell(standing: Standing, seen: Mapping[str, Comparison], name: str, reference: str) -> MatrixCell:
    leads = standing.decided and name in standing.leaders
    if name == reference and any(standing.name(rival) == name for rival in standing.rivals):
        return MatrixCell("1", "reference", "the reference", leads=leads)
    pair = seen.get(name)
    if pair is None:
        return MatrixCell("-", "absent")
    judgement = pair.judgement
    hint = size_text(judgement) if pair.shown else pair.verdict.value
    if 0 < judgement.low <= judgement.high < math.inf:
        hint += f"; ratio 95 % {number(judgement.low)} to {number(judgement.high)}"
    lost = f"{judgement.failures[0]} of {judgement.n} lost" if judgement.failures[0] else ""
    return MatrixCell(_ratio(pair), _style(pair), hint, lost, leads)


def _ratio(pair: Comparison) -> str:
    return pair.ratio_text or ("lost" if pair.judgement.ratio else "finishes")


def _style(pair: Comparison) -> str:
    if pair.verdict is Verdict.EQUAL:
        return "equal"
    if not pair.shown:
        return "undecided"
    better = pair.verdict in WINS
    ratio = pair.judgement.ratio
    factor = max(ratio, 1 / ratio) if 0 < ratio < math.inf else math.inf
    return f"{'better' if better else 'worse'}{1 + sum(factor >= step for step in SHADES)}"


def _worst(name: str, seen: Sequence[Mapping[str, Comparison]], scenarios: Sequence[str]) -> tuple[str, str, str]:
    """Return the method's largest ratio, and the scenario of that."""
    pairs = [(of[name], scenario) for of, scenario in zip(seen, scenarios, strict=True) if name in of]
    pair, scenario = max(pairs, key=lambda one: one[0].judgement.ratio)
    return name, _ratio(pair), scenario
