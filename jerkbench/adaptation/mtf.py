"""Multiple tuning factors: each axis has its own."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Self

import numpy as np

from jerkbench.adaptation._ranges import HITS, NONE_OR_MORE, ONE_OR_MORE, SHORT_WINDOW
from jerkbench.adaptation.common import inflated, window_memory
from jerkbench.adaptation.linalg import dot, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "mtf")
@dataclass(frozen=True)
class Mtf(Limited):
    """Inflates the variance of just those rows whose innovation is larger than expected.

    With y the innovation, h_i = (H P- H')_ii, r_i = R_ii and w_i the mean of the last mu values of y_i^2::

        if y'y >= sum h + sum r:    r_i = r_i + max(0, w_i - h_i - r_i)

    With mu = 1, y_i^2 <= S_ii afterwards. The test is instantaneous and mixes metres with metres per second; in the
    nominal case it triggers on about a third of the updates. Good on a fault of single axes of the sensor; harmful
    where the process is at fault (a bias, wheel slip): the filter then rejects the measurements that would have put it
    right, and may lock out. The guard limits that: of a row's hits (triggered, and w_i > h_i + r_i) only the first N in
    a sequence inflate; an update of the row without a hit starts anew.

    A longer window takes most of that harm, and none of the good: position RMSE [m] of `jerk` on `field_white`,
    geometric means over 5 seeds::

        mu                         1       4      10      25
        nothing wrong         0.0181  0.0172  0.0169  0.0168
        multipath_single_axis 0.0307  0.0281  0.0287  0.0344
        noise_step             0.181  0.0605  0.0433  0.0422
        wheel_slip            0.0802  0.0255  0.0257  0.0459

    Source: the paper's equations for S_t and s_i, transferred from its tilt filter to the GNSS update; the method is by
    H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust unscented Kalman filter in the presence
    of measurement faults", ISA Transactions 49, 249-256, 2010, doi:10.1016/j.isatra.2010.04.001.

    Attributes:
        window: mu, number of squared innovations in the mean, this one included [updates].
        guard: N, number of hits in a sequence that inflate; 0: no limit [updates].
        after: so many updates of the run pass before it begins, because the paper starts in the steady state [updates].
        after_s: so much of the run passes before it begins; with ``after`` the later of the two [s].
    """

    provenance = Provenance(
        "simplified", "doi:10.1016/j.isatra.2010.04.001", "Behind a trace test, as in the paper of `jerk`."
    )

    window: Annotated[int, ONE_OR_MORE, SHORT_WINDOW, DefaultOrigin("literature: the paper has mu = 1")] = 1
    guard: Annotated[int, HITS, DefaultOrigin("off, as in the paper")] = 0
    after: Annotated[int, NONE_OR_MORE, DefaultOrigin("off; the paper's steady state has no number")] = 0
    after_s: Annotated[float, NONE_OR_MORE, DefaultOrigin("off, likewise")] = 0.0

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window", "guard", "after")

    def memory_size(self) -> int:
        """Return the length of what `inflated` remembers of six rows, and one for the updates that have passed."""
        return window_memory(self.window) + 1

    def at_updates(self, since_start_s: FloatArray) -> Self:
        """Return the same with the updates before ``after_s`` counted."""
        if self.after_s == 0.0:
            return self
        return replace(self, after=max(self.after, int(np.sum(since_start_s < self.after_s))), after_s=0.0)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of the rows in question inflated."""
        waits = chosen(self.after, memory[-1], 1.0, 0.0)
        memory[-1] += waits
        triggered = chosen(trace(HPHt) + trace(R), dot(innovation, innovation), 0.0, 1.0 - waits)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, (triggered, triggered))
