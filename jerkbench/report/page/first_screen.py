"""The first screen of a report: the answer, methods x scenarios in one picture, settings, the findings."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from jerkbench.evaluation.statistics.judgement import WINS, Verdict
from jerkbench.report.analysis.answer import against, mean_log_ratio, reference_method, size_text
from jerkbench.report.analysis.columns import SCENARIO_FACTORS
from jerkbench.report.analysis.findings import sentence
from jerkbench.report.analysis.standings import Comparison, Standing
from jerkbench.report.tables.table_model import number

MOST = 10
"""So many findings are read; the others are behind a fold."""

PARTS = ("filter", "adaptation")
"""Parts of a method; the noise is among the parameters of the filter."""


def settings(about: Iterable[Mapping[str, Any]]) -> list[tuple[str, int, str]]:
    """Return each method's parameters, of the filter and the adaptation.

    Of each there is its name, with how many settings it ran in a scenario (the most), and every parameter with its
    value, or with its values where there are several.
    """
    values: dict[str, dict[str, dict[str, None]]] = {}
    tried: dict[str, dict[tuple[str, str], set[str]]] = {}
    for cell in about:
        spec, labels = cell["spec"], cell["labels"]
        method = " + ".join(str(labels[factor]) for factor in PARTS)
        own = {f"{kind}.{name}": value for kind in PARTS for name, value in spec[kind].items() if name != "name"}
        seen = values.setdefault(method, {})
        for name, value in own.items():
            seen.setdefault(name, {})[number(value) if isinstance(value, float) else str(value)] = None
        scenario = (str(labels["dataset"]), str(labels["disturbance"]))
        tried.setdefault(method, {}).setdefault(scenario, set()).add(json.dumps(own, sort_keys=True, default=str))
    told = {
        method: ", ".join(f"{name} {' or '.join(list(of)[:MOST])}" for name, of in seen.items()) or "none"
        for method, seen in values.items()
    }
    return [(method, max(map(len, tried[method].values())), parameters) for method, parameters in told.items()]


def every_comparison(comparisons: Iterable[Comparison], varying: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return a heading for each scenario, and its comparisons in sentences, those that were shown first."""
    shown = [key for key in SCENARIO_FACTORS if key in varying]
    scenes: dict[str, list[Comparison]] = {}
    for comparison in comparisons:
        scenes.setdefault(", ".join(getattr(comparison.subject, key) for key in shown), []).append(comparison)
    told = []
    for name, of_scene in scenes.items():
        counts = Counter(comparison.verdict.value for comparison in of_scene)
        words = ", ".join(f"{count} {word}" for word, count in counts.items())
        tested = any(not math.isnan(comparison.judgement.p) for comparison in of_scene)
        result = f": {words}" if tested else ", without a test (no seeds)"
        ordered = sorted(of_scene, key=lambda comparison: not comparison.shown)
        heading = f"{f'{name}: ' if name else ''}{len(of_scene)} comparisons{result}"
        told.append((heading, [sentence(comparison, varying) for comparison in ordered]))
    return told


# The picture of a study: methods x scenarios, each error relative to one reference, coloured where it was shown.

SHADES = (1.1, 1.5)
"""Factors from which on a shown difference has the second and the third shade."""

MANY_SCENARIOS = 8
"""With more scenarios than this they stand in rows, if the methods are fewer."""


class MatrixCell(NamedTuple):
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


class Matrix(NamedTuple):
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
    worst = []
    for name in names:
        pairs = [(of[name], scenario) for of, scenario in zip(seen, scenarios, strict=True) if name in of]
        if pairs:
            pair, scenario = max(pairs, key=lambda one: one[0].judgement.ratio)
            worst.append((name, _ratio(pair), scenario))
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
    judgement, ratio = pair.judgement, pair.judgement.ratio
    style, hint = "equal" if pair.verdict is Verdict.EQUAL else "undecided", pair.verdict.value
    if pair.shown:
        factor = max(ratio, 1 / ratio) if 0 < ratio < math.inf else math.inf
        word = "better" if pair.verdict in WINS else "worse"
        style, hint = f"{word}{1 + sum(factor >= step for step in SHADES)}", size_text(judgement)
    if 0 < judgement.low <= judgement.high < math.inf:
        hint += f"; ratio 95 % {number(judgement.low)} to {number(judgement.high)}"
    lost = f"{judgement.failures[0]} of {judgement.n} lost" if judgement.failures[0] else ""
    return MatrixCell(_ratio(pair), style, hint, lost, leads)


def _ratio(pair: Comparison) -> str:
    return pair.ratio_text or ("lost" if pair.judgement.ratio else "finishes")
