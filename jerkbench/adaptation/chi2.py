"""Gates, which drop measurements that fail a test of the innovation."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, PROBABILITY, ZERO_OR_MORE
from jerkbench.adaptation.common import chi2_tail, innovation_distance, position_rows
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, each_run, select
from jerkbench.parameters import BETWEEN_0_AND_1, DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "chi2")
@dataclass(frozen=True)
class Chi2Gate(Limited):
    """Drops a position or a velocity that fails a chi-square test of its innovation.

    Position and velocity are tested separately, each with the innovation y of its m measured rows and the covariance S
    = H P- H' + R::

        dropped if y' S^-1 y > chi2(p, m), but at most N consecutive times

    After N consecutive rejections, the next update is always accepted. Each accepted update resets the counter of
    rejections. The classical gate removes single outliers, but has no effect on errors just below the threshold. If the
    process model is wrong, the gate rejects the measurements that would correct the state, for up to N updates at a
    time.

    Source: the validation gate, e.g. Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking
    and Navigation", Wiley, 2001, doi:10.1002/0471221279; the limit on consecutive rejections is common practice.

    Attributes:
        probability: p, probability that a measurement passes the test in a consistent filter [-].
        longest: N, maximum number of consecutive rejections [updates].
    """

    provenance = Provenance(
        "simplified", "doi:10.1002/0471221279", "Position and velocity separately; at most 25 consecutive rejections."
    )

    probability: Annotated[float, BETWEEN_0_AND_1, PROBABILITY, DefaultOrigin("convention of such tests")] = 0.99
    longest: Annotated[
        int,
        ZERO_OR_MORE,
        Range(1, 200, log=True, source="ours: from 0.2 s to 40 s of fixes at 5 Hz"),
        DefaultOrigin("ours: 5 s of fixes at 5 Hz"),
    ] = 25

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("longest",)

    def memory_size(self) -> int:
        """Return 2, because the memory stores the number of consecutive rejections of position and of velocity."""
        return 2

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with infinite variances in the position or velocity rows that are dropped."""
        adapted, split = R.copy(), position_rows(rows)
        for block, start, end in ((0, 0, split), (1, split, len(rows))):
            if start < end:
                part = slice(start, end)
                nis = innovation_distance(innovation[part], HPHt[part, part], R[part, part])
                fails = select(1.0 - self.probability, chi2_tail(nis, end - start), 1.0, 0.0)
                dropped = select(self.longest, memory[block], fails, 0.0)
                memory[block] = select(dropped, 0.0, memory[block] + 1.0, 0.0)
                for i in range(start, end):
                    adapted[i, i] = select(dropped, 0.0, np.inf, R[i, i])
        return adapted


@register("adaptation", "relaxing_gate")
@dataclass(frozen=True)
class RelaxingGate(Limited):
    """Drops a row whose innovation exceeds a gate of k sigma, which widens after consecutive rejections.

    The test of row i uses the innovation y, S = H P- H' + R, and the number c of consecutive rejections of the row::

        dropped if |y_i| > k f^max(0, c - N) sqrt(S_ii)

    A rejection increments c, and an accepted update resets c to 0. With a gate of fixed width, a filter with a large
    error rejects all measurements and never recovers. With the widening gate, the filter recovers, but it also accepts
    wrong position fixes that last long enough.

    Source: common practice of receivers and flight controllers; the default values are not tuned.

    Attributes:
        width: k, width of the gate in standard deviations of the innovation [-].
        patience: N, number of consecutive rejections of a row before the gate widens [updates].
        growth: f, factor by which each further rejection widens the gate [-].
    """

    provenance = Provenance("own", "", "A gate as in receivers and flight controllers, with untuned values.")

    width: Annotated[
        float,
        ABOVE_0,
        Range(1.5, 10.0, log=True, source="ours: from a gate that drops 13 % of correct rows to one for gross errors"),
        DefaultOrigin("ours, not tuned: the common three sigma"),
    ] = 3.0
    patience: Annotated[
        int,
        ZERO_OR_MORE,
        Range(1, 100, log=True, source="ours: up to 20 s of fixes at 5 Hz"),
        DefaultOrigin("ours, not tuned"),
    ] = 5
    growth: Annotated[
        float,
        Limit(lambda k: k > 1, "it must be above 1, because otherwise the gate never widens."),
        Range(1.05, 3.0, source="ours: from a gate that hardly widens to one that opens immediately"),
        DefaultOrigin("ours, not tuned"),
    ] = 1.5

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("patience",)

    def memory_size(self) -> int:
        """Return 6, because the memory stores the number of consecutive rejections of each of the six rows."""
        return 6

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with infinite variances in the rows that are dropped."""
        adapted = R.copy()
        for i, row in enumerate(rows):
            limit, late = self.width * math.sqrt(HPHt[i, i] + R[i, i]), memory[row] - self.patience
            if anywhere(late):  # a power is slow, so it is computed only if a gate widens
                limit *= each_run(math.pow, self.growth, min(max(late, 0.0), 100.0))
            dropped = select(abs(innovation[i]), limit, 1.0, 0.0)
            memory[row] = select(dropped, 0.0, memory[row] + 1.0, 0.0)
            adapted[i, i] = select(dropped, 0.0, np.inf, R[i, i])
        return adapted
