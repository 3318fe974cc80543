"""Shapley's shares of a gain: what each factor adds, mean over all orders in which they can be added; as a table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.ranks import OverScenarios, over_scenarios

MODEL, ADAPTATION, Q, R, ATTITUDE = "model", "adaptation", "tuning of Q", "tuning of R", "attitude"
FACTORS = (MODEL, ADAPTATION, Q, R, ATTITUDE)

WHOLE = "the whole"

Corner = frozenset[str]
"""The factors that are on."""


def corners(factors: Sequence[str]) -> Iterator[Corner]:
    """Yield every subset of the factors, the empty one first and the whole last."""
    for size in range(len(factors) + 1):
        yield from map(frozenset, combinations(factors, size))


def shapley(values: Mapping[Corner, FloatArray], factors: Sequence[str]) -> dict[str, FloatArray]:
    """Return the share of each factor; they add up to the value of the whole less that of the empty corner.

    With v(S) the value where the factors S are on, of n factors::

        phi_i = sum over S without i of |S|! (n - |S| - 1)! / n! (v(S + i) - v(S))

    Args:
        values: of every corner, of any shape: a share of each element is taken by itself.
        factors: their names.

    Source: L. S. Shapley, "A value for n-person games", Contributions to the Theory of Games II, Princeton (1953).
    """
    return {factor: _part(values, factor, [f for f in factors if f != factor]) for factor in factors}


def _part(values: Mapping[Corner, FloatArray], factor: str, rest: Sequence[str]) -> FloatArray:
    n = len(rest) + 1
    parts = [
        factorial(len(corner)) * factorial(n - len(corner) - 1) / factorial(n) * step(values, corner, factor)
        for corner in corners(rest)
    ]
    return np.asarray(np.sum(parts, axis=0))


def step(values: Mapping[Corner, FloatArray], corner: Corner, factor: str) -> FloatArray:
    """Return what a factor adds at a corner where it is off."""
    return np.asarray(values[corner | {factor}] - values[corner])


@dataclass(frozen=True)
class Share:
    """What one factor is worth; ratios of the position RMSE, below 1 is better.

    Attributes:
        factor: its name, or `WHOLE`.
        ratio: by which it multiplies the RMSE, mean over all orders, with its 95 % interval over families and seeds.
        share: of the logarithm of the whole.
        alone: its ratio where it is added first.
        last: its ratio where it is added last.
    """

    factor: str
    ratio: OverScenarios
    share: float
    alone: float
    last: float


def shares(values: Mapping[Corner, FloatArray], families: Sequence[str]) -> list[Share]:
    """Return the share of each factor, the one with the largest gain first, and at last the whole.

    Args:
        values: (S, n) loss of each corner.
        families: (S,) family of each scenario; families count alike.
    """
    by_family = {corner: of_families(own, families) for corner, own in values.items()}
    whole = by_family[frozenset(FACTORS)] - by_family[frozenset()]
    parts = shapley(by_family, FACTORS)
    rows = [_share(factor, parts[factor], by_family, float(whole.mean())) for factor in FACTORS]
    total = over_scenarios(whole)
    return [*sorted(rows, key=lambda row: row.ratio.ratio), Share(WHOLE, total, 1.0, total.ratio, total.ratio)]


def of_families(values: FloatArray, families: Sequence[str]) -> FloatArray:
    """Return (F, n) means over the scenarios of each family."""
    names = np.array(families)
    return np.array([values[names == family].mean(axis=0) for family in dict.fromkeys(families)])


def _share(factor: str, part: FloatArray, values: Mapping[Corner, FloatArray], whole: float) -> Share:
    rest = frozenset(FACTORS) - {factor}
    alone, last = (float(np.exp(step(values, corner, factor).mean())) for corner in (frozenset(), rest))
    return Share(factor, over_scenarios(part), float(part.mean()) / whole, alone, last)


def share_frame(rows: Sequence[Share]) -> pd.DataFrame:
    """Return the numbers of every share, one a row."""
    return pd.DataFrame(
        [
            {
                "factor": row.factor,
                "ratio": row.ratio.ratio,
                "low": row.ratio.low,
                "high": row.ratio.high,
                "share": row.share,
                "alone": row.alone,
                "last": row.last,
            }
            for row in rows
        ]
    )


def share_table(rows: Sequence[Share]) -> str:
    """Return the table as Markdown, rounded."""
    lines = ["| factor | multiplies the RMSE by [95 %] | share | added first | added last |", "|---|---|---|---|---|"]
    lines += [
        f"| {row.factor} | {row.ratio.ratio:.2f} [{row.ratio.low:.2f}, {row.ratio.high:.2f}] | {100 * row.share:.0f} %"
        f" | {row.alone:.2f} | {row.last:.2f} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def family_table(corners: Mapping[Corner, FloatArray], families: Sequence[str]) -> str:
    """Return what each factor multiplies the RMSE by under each family of faults, as Markdown.

    Args:
        corners: (F, n) loss of each corner.
        families: (F,) their names.
    """
    parts = shapley(corners, FACTORS)
    ratios = np.exp([parts[factor].mean(axis=1) for factor in FACTORS]).T
    lines = [f"| {' | '.join(['family', *FACTORS])} |", "|---" * (len(FACTORS) + 1) + "|"]
    lines += [
        f"| {family} | {' | '.join(f'{ratio:.2f}' for ratio in row)} |"
        for family, row in zip(families, ratios.tolist(), strict=True)
    ]
    return "\n".join(lines) + "\n"
