"""The gate that opens again after a streak of rejections."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, NONE_OR_MORE
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, chosen, each_run
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "relaxing_gate")
@dataclass(frozen=True)
class RelaxingGate(Limited):
    """Drops a row beyond k sigma; after a streak of rejections k grows until an update is accepted again.

    With S = H P- H' + R and c the rejections of this row in sequence so far::

        dropped if |y_i| > k f^max(0, c - N) sqrt(S_ii)

    A rejection adds one to c, an accepted update sets it to 0. A gate of fixed width locks out: a filter that has
    drifted rejects what would bring it back. This one comes back by itself, at the price of a streak of false fixes
    being believed in the end.

    Source: common practice of receivers and flight controllers; the numbers are ours, from no tuning.

    Attributes:
        width: k, in standard deviations of the innovation [-].
        patience: N, rejections of a row in sequence before the gate widens [updates].
        growth: f, factor by which each further rejection widens it [-].
    """

    provenance = Provenance("own", "", "A gate as receivers and flight controllers have it, with our numbers.")

    width: Annotated[
        float,
        ABOVE_0,
        Range(1.5, 10.0, log=True, source="ours: from a gate that drops one good row in seven to one for gross errors"),
        DefaultOrigin("ours, from no tuning: the usual three sigma"),
    ] = 3.0
    patience: Annotated[
        int,
        NONE_OR_MORE,
        Range(1, 100, log=True, source="ours: up to 20 s of fixes at 5 Hz"),
        DefaultOrigin("ours, from no tuning"),
    ] = 5
    growth: Annotated[
        float,
        Limit(lambda k: k > 1, "it must be above 1, or the gate never opens."),
        Range(1.05, 3.0, source="ours: a gate that hardly opens to one that opens at once"),
        DefaultOrigin("ours, from no tuning"),
    ] = 1.5

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("patience",)

    def memory_size(self) -> int:
        """Return 6: rejections in sequence of each row."""
        return 6

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with infinite variances in the rows that are dropped."""
        adapted = R.copy()
        for i, row in enumerate(rows):
            limit, late = self.width * math.sqrt(HPHt[i, i] + R[i, i]), memory[row] - self.patience
            if anywhere(late):  # a power takes its time
                limit *= each_run(_power, self.growth, min(max(late, 0.0), 100.0))
            dropped = chosen(abs(innovation[i]), limit, 1.0, 0.0)
            memory[row] = chosen(dropped, 0.0, memory[row] + 1.0, 0.0)
            adapted[i, i] = chosen(dropped, 0.0, np.inf, R[i, i])
        return adapted


def _power(base: float, exponent: float) -> float:
    power: float = base**exponent
    return power
