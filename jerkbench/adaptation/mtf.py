"""Multiple tuning factors: each axis has its own."""

from dataclasses import dataclass

import numpy as np

from jerkbench.adaptation._windows import check_window, inflated, inflation_memory, squared_length
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.plugins import register


@register("adaptation", "mtf")
@dataclass(frozen=True)
class Mtf:
    """Inflates the variance of just those rows whose innovation is larger than expected.

    With y the innovation, h_i = (H P- H')_ii, r_i = R_ii and w_i the mean of the last mu values of y_i^2::

        if y'y >= sum h + sum r:    r_i = r_i + max(0, w_i - h_i - r_i)

    With mu = 1, y_i^2 <= S_ii afterwards. The test is instantaneous and mixes metres with metres per second; in the
    nominal case it triggers on about a third of the updates. Good on a fault of single axes of the sensor; harmful
    where the process is at fault (a bias, wheel slip): the filter then rejects the measurements that would have put it
    right, and may lock out. The guard limits that: of a row's hits (triggered, and w_i > h_i + r_i) only the first N in
    a sequence inflate; an update of the row without a hit starts anew.

    Source: the paper's equations for S_t and s_i, transferred from its tilt filter to the GNSS update; the method is by
    H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust unscented Kalman filter in the presence
    of measurement faults", ISA Transactions 49, 249-256, 2010, doi:10.1016/j.isatra.2010.04.001.

    Attributes:
        window: mu, number of squared innovations in the mean, this one included [updates].
        guard: N, number of hits in a sequence that inflate; 0: no limit [updates].
    """

    window: int = 1
    guard: int = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_window("mtf", self.window, self.guard)

    def memory_size(self) -> int:
        """Return the length of the ring of squared innovations, the update count and the hit count, of six rows."""
        return inflation_memory(self.window)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of the rows in question inflated."""
        triggered = squared_length(innovation) >= np.trace(HPHt) + np.trace(R)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, (triggered, triggered))
