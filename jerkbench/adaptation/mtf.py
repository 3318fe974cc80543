"""Multiple tuning factors: each axis has its own."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError
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
    H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust unscented Kalman filter in the presence of
    measurement faults", ISA Transactions 49, 249-256, 2010.

    Attributes:
        window: mu, number of squared innovations in the mean, this one included [updates].
        guard: N, number of hits in a sequence that inflate; 0: no limit [updates].
    """

    window: int = 1
    guard: int = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.window < 1:
            raise PluginError(f"mtf.window is {self.window}; it must be at least 1.")
        if self.guard < 0:
            raise PluginError(f"mtf.guard is {self.guard}; it must be 0 (off) or the number of hits that inflate.")

    def memory_size(self) -> int:
        """Return the length of the ring of squared innovations, the update count and the hit count, of six rows."""
        return 6 * (self.window + 2)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of the rows in question inflated."""
        ring, counts = memory[: 6 * self.window].reshape(6, self.window), memory[6 * self.window :]
        triggered = np.sum(innovation**2) >= np.trace(HPHt) + np.trace(R)
        adapted = R.copy()
        for i, row in enumerate(rows):
            seen = int(counts[row])
            ring[row, seen % self.window] = innovation[i] ** 2
            counts[row] = seen + 1
            excess = np.mean(ring[row, : min(seen + 1, self.window)]) - HPHt[i, i] - R[i, i]
            hit = triggered and excess > 0.0
            counts[6 + row] = counts[6 + row] + 1.0 if hit else 0.0
            if hit and (self.guard == 0 or counts[6 + row] <= self.guard):
                adapted[i, i] += excess
        return adapted
