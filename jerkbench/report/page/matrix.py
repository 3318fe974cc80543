"""The picture of a study: methods x scenarios, each error relative to one reference, coloured where it was shown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from jerkbench.evaluation.statistics.judgement import WINS, Verdict
from jerkbench.report.analysis.answer import against, mean_log_ratio, reference_method, size_text
from jerkbench.report.analysis.standings import Comparison, Standing
from jerkbench.report.tables.table_model import factor_number, number

STEPS = (1.1, 1.5)
"""Factors from which on a shown difference has the second and the third shade."""

WIDE = 8
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


ABSENT = MatrixCell("-", "absent")


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
    if len(scenarios) > WIDE and len(scenarios) > len(names):
        turned = [list(cells) for cells in zip(*rows, strict=True)]
        return Matrix(reference, "scenario", tuple(names), list(zip(scenarios, turned, strict=True)), worst)
    return Matrix(reference, "method", tuple(scenarios), list(zip(names, rows, strict=True)), worst)


def _cell(standing: Standing, seen: Mapping[str, Comparison], name: str, reference: str) -> MatrixCell:
    leads = standing.decided and name in standing.leaders
    if name == reference and any(standing.name(rival) == name for rival in standing.rivals):
        return MatrixCell("1", "reference", "the reference", leads=leads)
    pair = seen.get(name)
    if pair is None:
        return ABSENT
    judgement = pair.judgement
    hint = size_text(judgement) if pair.shown else pair.verdict.value
    if 0 < judgement.low <= judgement.high < math.inf:
        hint += f"; ratio 95 % {number(judgement.low)} to {number(judgement.high)}"
    lost = f"{judgement.failures[0]} of {judgement.n} lost" if judgement.failures[0] else ""
    return MatrixCell(_ratio(pair), _style(pair), hint, lost, leads)


def _ratio(pair: Comparison) -> str:
    ratio = pair.judgement.ratio
    if not 0 < ratio < math.inf:
        return "lost" if ratio else "finishes"
    return factor_number(ratio) if pair.shown else number(ratio)


def _style(pair: Comparison) -> str:
    if pair.verdict is Verdict.EQUAL:
        return "equal"
    if not pair.shown:
        return "undecided"
    better = pair.verdict in WINS
    ratio = pair.judgement.ratio
    factor = max(ratio, 1 / ratio) if 0 < ratio < math.inf else math.inf
    return f"{'better' if better else 'worse'}{1 + sum(factor >= step for step in STEPS)}"


def _worst(name: str, seen: Sequence[Mapping[str, Comparison]], scenarios: Sequence[str]) -> tuple[str, str, str]:
    """Return the method's largest ratio, and the scenario of that."""
    pairs = [(of[name], scenario) for of, scenario in zip(seen, scenarios, strict=True) if name in of]
    pair, scenario = max(pairs, key=lambda one: one[0].judgement.ratio)
    return name, _ratio(pair), scenario
