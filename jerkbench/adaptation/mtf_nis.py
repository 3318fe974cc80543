"""Multiple tuning factors with a chi-square test of the whole innovation."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import HITS, ONE_OR_MORE, PROBABILITY, SHORT_WINDOW, WITHIN_0_AND_1
from jerkbench.adaptation.common import chi2_tail, inflated, innovation_distance, window_memory
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "mtf_nis")
@dataclass(frozen=True)
class MtfNis(Limited):
    """Multiple tuning factors with a chi-square test of the whole innovation.

    `mtf`, but the test has no units and the false alarms that it is asked for. With y the innovation of m rows,
    S = H P- H' + R, h_i = (H P- H')_ii, r_i = R_ii and w_i the mean of the last mu values of y_i^2::

        if y' S^-1 y >= chi2(p, m):    r_i = r_i + max(0, w_i - h_i - r_i)

    With p = 0.99 a consistent filter inflates at one update in a hundred, `mtf` at one in three: good where the noise
    is as reported most of the time. An overconfident filter triggers more often, a cautious one never.

    Source: multiple tuning factors (H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust
    unscented Kalman filter in the presence of measurement faults", ISA Transactions 49, 249-256, 2010,
    doi:10.1016/j.isatra.2010.04.001); the test by NIS is ours.

    Attributes:
        probability: p, of the chi-square test: how often a consistent filter passes it [-].
        window: mu, number of squared innovations in the mean, this one included [updates].
        guard: N, number of hits in a sequence that inflate; 0: no limit [updates].
    """

    provenance = Provenance(
        "own", "doi:10.1016/j.isatra.2010.04.001", "`mtf` with a chi-square test of the whole innovation."
    )

    probability: Annotated[float, WITHIN_0_AND_1, PROBABILITY, DefaultOrigin("convention of such tests")] = 0.99
    window: Annotated[int, ONE_OR_MORE, SHORT_WINDOW, DefaultOrigin("as mtf")] = 1
    guard: Annotated[int, HITS, DefaultOrigin("off, as mtf")] = 0

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window", "guard")

    def memory_size(self) -> int:
        """Return the length of what `inflated` remembers of six rows."""
        return window_memory(self.window)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of the rows in question inflated."""
        nis = innovation_distance(innovation, HPHt, R)
        triggered = chosen(chi2_tail(nis, len(rows)), 1.0 - self.probability, 0.0, 1.0)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, (triggered, triggered))
