"""The chi-square gate."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import NONE_OR_MORE, PROBABILITY, WITHIN_0_AND_1
from jerkbench.adaptation.common import chi2_tail, innovation_distance, position_rows
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "chi2")
@dataclass(frozen=True)
class Chi2Gate(Limited):
    """Drops a position or a velocity that fails the chi-square test.

    For each of the two blocks, with the y and S = H P- H' + R of its m rows that are there::

        dropped if y' S^-1 y > chi2(p, m), but at most N times in a row

    The update after N rejections in a row is accepted whatever it says, and the counter starts anew; it also does with
    each update that passes. The classical gate: good on single outliers, of no use on errors just below the threshold,
    and with a wrong process it shuts out the measurements that would help, for N updates at a time.

    Source: the validation gate, e.g. Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking
    and Navigation", Wiley, 2001, doi:10.1002/0471221279; the limit on rejections in a row is common practice.

    Attributes:
        probability: p, of the chi-square test: how often a consistent filter passes it [-].
        longest: N, largest number of rejections in a row [updates].
    """

    provenance = Provenance(
        "simplified", "doi:10.1002/0471221279", "Position and velocity apart; at most 25 in a row are dropped."
    )

    probability: Annotated[float, WITHIN_0_AND_1, PROBABILITY, DefaultOrigin("convention of such tests")] = 0.99
    longest: Annotated[
        int,
        NONE_OR_MORE,
        Range(1, 200, log=True, source="ours: from a fifth of a second to 40 s of fixes at 5 Hz"),
        DefaultOrigin("ours: five seconds of fixes at 5 Hz"),
    ] = 25

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("longest",)

    def memory_size(self) -> int:
        """Return 2: rejections in a row of each block."""
        return 2

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with infinite variances in the blocks that are dropped."""
        adapted, split = R.copy(), position_rows(rows)
        for block, begin, end in ((0, 0, split), (1, split, len(rows))):
            if begin < end:
                of = slice(begin, end)
                nis = innovation_distance(innovation[of], HPHt[of, of], R[of, of])
                fails = chosen(1.0 - self.probability, chi2_tail(nis, end - begin), 1.0, 0.0)
                dropped = chosen(self.longest, memory[block], fails, 0.0)
                memory[block] = chosen(dropped, 0.0, memory[block] + 1.0, 0.0)
                for i in range(begin, end):
                    adapted[i, i] = chosen(dropped, 0.0, np.inf, R[i, i])
        return adapted
