"""Innovation-based adaptive estimation of R."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ONE_OR_MORE, SHRINKING, WINDOW
from jerkbench.adaptation.common import unfilled, window_memory, windowed_mean
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen, each_run
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "iae")
@dataclass(frozen=True)
class InnovationBased(Limited):
    """Innovation-based adaptive estimation: the variance that the last innovations had, less that of the prior.

    With w_i the mean of the last N values of y_i^2, this one included, and h_i = (H P- H')_ii of now::

        r_i = max(w_i - h_i, lo r_i),    R diagonal

    A row that has not seen N updates keeps its reported variance and its off-diagonals. Good on noise that changes
    slowly against the window; N values give the variance with a relative sigma of sqrt(2/N), so a short window is
    noise itself (45 % with ten). It cannot tell a wrong process from a wrong sensor.

    Source: A. H. Mohamed and K. P. Schwarz, "Adaptive Kalman filtering for INS/GPS", Journal of Geodesy 73, 193-203,
    1999, doi:10.1007/s001900050236; the diagonal of R alone, with the h of now instead of the window's.

    Attributes:
        window: N, number of squared innovations in the mean, this one included [updates].
        low: lo, lower bound as a multiple of the reported variance [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1007/s001900050236", "The diagonal of R alone, with the prior covariance of now."
    )

    window: Annotated[int, ONE_OR_MORE, WINDOW, DefaultOrigin("ours")] = 10
    low: Annotated[
        float,
        Limit(lambda low: low > 0, "it must be above 0, or R would not be positive."),
        SHRINKING,
        DefaultOrigin("ours, as sage_husa"),
    ] = 0.1

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window",)

    def memory_size(self) -> int:
        """Return the length of what `windowed_mean` remembers of six rows."""
        return window_memory(self.window)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the estimated variances of the rows whose window is full."""
        adapted = R.copy()
        for i, row in enumerate(rows):
            mean = each_run(windowed_mean, memory, self.window, row, innovation[i] * innovation[i])
            lacks = unfilled(memory, self.window, row)
            for j in range(len(rows)):
                adapted[i, j] = adapted[j, i] = chosen(lacks, 0.0, adapted[i, j], 0.0)
            adapted[i, i] = chosen(lacks, 0.0, R[i, i], max(mean - HPHt[i, i], self.low * R[i, i]))
        return adapted
