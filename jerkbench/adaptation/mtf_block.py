"""Multiple tuning factors with one test for position and one for velocity."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import HITS, ONE_OR_MORE, SHORT_WINDOW
from jerkbench.adaptation.common import inflated, window_memory
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "mtf_block")
@dataclass(frozen=True)
class MtfBlock(Limited):
    """Multiple tuning factors with one test for position and one for velocity.

    `mtf`, but metres are not added to metres per second. For each of the two blocks B, with y the innovation,
    h_i = (H P- H')_ii, r_i = R_ii and w_i the mean of the last mu values of y_i^2::

        if sum_B y_i^2 >= sum_B (h_i + r_i):    r_i = r_i + max(0, w_i - h_i - r_i),  i in B

    A fault of the position no longer opens the door for inflating the velocity, and a fault of the velocity is no
    longer hidden by a position of larger variance. The rest is as in `mtf`, good and bad; window and guard too.

    Source: multiple tuning factors (H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust
    unscented Kalman filter in the presence of measurement faults", ISA Transactions 49, 249-256, 2010,
    doi:10.1016/j.isatra.2010.04.001); the test by blocks is ours.

    Attributes:
        window: mu, number of squared innovations in the mean, this one included [updates].
        guard: N, number of hits in a sequence that inflate; 0: no limit [updates].
    """

    provenance = Provenance(
        "own", "doi:10.1016/j.isatra.2010.04.001", "`mtf` with one test for position and one for velocity."
    )

    window: Annotated[int, ONE_OR_MORE, SHORT_WINDOW, DefaultOrigin("literature: the paper has mu = 1")] = 1
    guard: Annotated[int, HITS, DefaultOrigin("off, as in the paper")] = 0

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window", "guard")

    def memory_size(self) -> int:
        """Return the length of what `inflated` remembers of six rows."""
        return window_memory(self.window)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of the rows in question inflated."""
        triggered = _exceeds(innovation, HPHt, R, rows, 0), _exceeds(innovation, HPHt, R, rows, 1)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, triggered)


def _exceeds(innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, block: int) -> float:
    """Return 1 where the innovation of position (0) or velocity (1) is larger than expected, else 0."""
    energy = expected = 0.0
    for i, row in enumerate(rows):
        if row // 3 == block:
            energy += innovation[i] * innovation[i]
            expected += HPHt[i, i] + R[i, i]
    return chosen(expected, energy, 0.0, 1.0)
