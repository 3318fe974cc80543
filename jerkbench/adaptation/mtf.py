"""Multiple tuning factors (MTF), which inflate the variance of each axis separately, after a test of the innovation."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Self

import numpy as np

from jerkbench.adaptation._ranges import HITS, PROBABILITY, SHORT_WINDOW, ZERO_OR_MORE
from jerkbench.adaptation.common import Windowed, chi2_tail, inflated, innovation_distance
from jerkbench.adaptation.linalg import dot, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import select
from jerkbench.parameters import AT_LEAST_ONE, BETWEEN_0_AND_1, DefaultOrigin, Provenance
from jerkbench.plugins import register


@register("adaptation", "mtf")
@dataclass(frozen=True)
class Mtf(Windowed):
    """Inflates the variance of each row whose squared innovation is larger than expected.

    In the following equation, y is the innovation, h_i = (H P- H')_ii, r_i = R_ii, and w_i is the mean of the last mu
    values of y_i^2::

        if y'y >= sum h + sum r:    r_i = r_i + max(0, w_i - h_i - r_i)

    With mu = 1, the adapted R satisfies y_i^2 <= S_ii if the test triggers. The test y'y >= sum h + sum r uses only the
    current update, and adds squares of metres to squares of metres per second. Without a fault, the test triggers at
    about a third of the updates. The method works well on faults of single axes of a sensor. The method is harmful if
    the process model is wrong, for example due to a bias or wheel slip: the filter down-weights the measurements that
    would correct the state, and may diverge. The parameter ``guard`` limits the number of consecutive updates with an
    inflated variance. An update is a hit of a row if the test triggers and w_i > h_i + r_i. Only the first N
    consecutive hits inflate the variance of the row, and an update of the row without a hit resets the counter of hits.

    A longer window avoids most of the harm under a wrong process model, and retains most of the benefit under faults.
    The following table lists the position RMSE [m] of the filter `jerk` on `field_white` (geometric mean of 5 seeds)::

        mu                         1       4      10      25
        no fault              0.0181  0.0172  0.0169  0.0168
        multipath_single_axis 0.0307  0.0281  0.0287  0.0344
        noise_step             0.181  0.0605  0.0433  0.0422
        wheel_slip            0.0802  0.0255  0.0257  0.0459

    Source: the equations for S_t and s_i of the paper of `jerk`, transferred from its tilt filter to the GNSS update;
    the method is by H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust unscented Kalman filter
    in the presence of measurement faults", ISA Transactions 49, 249-256, 2010, doi:10.1016/j.isatra.2010.04.001.

    Attributes:
        window: mu, number of squared innovations in the mean w_i, including the current innovation [updates].
        guard: N, maximum number of consecutive hits that inflate the variance, or 0 for no limit [updates].
        after: number of updates before the adaptation starts. In the paper, the adaptation starts in the steady state
            [updates].
        after_s: time before the adaptation starts. The adaptation starts after both ``after`` updates and ``after_s``
            seconds [s].
    """

    provenance = Provenance(
        "simplified", "doi:10.1016/j.isatra.2010.04.001", "After a trace test, as in the paper of `jerk`."
    )

    window: Annotated[int, AT_LEAST_ONE, SHORT_WINDOW, DefaultOrigin("literature: the paper has mu = 1")] = 1
    guard: Annotated[int, HITS, DefaultOrigin("off, as in the paper")] = 0
    after: Annotated[int, ZERO_OR_MORE, DefaultOrigin("off; the paper does not quantify the steady state")] = 0
    after_s: Annotated[float, ZERO_OR_MORE, DefaultOrigin("off, as after")] = 0.0

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window", "guard", "after")

    def memory_size(self) -> int:
        """Return the length of the memory of `inflated`, plus one element for the number of updates."""
        return super().memory_size() + 1

    def at_updates(self, since_start_s: FloatArray) -> Self:
        """Return a copy in which ``after_s`` is converted into a number of updates, at the given update times."""
        if self.after_s == 0.0:
            return self
        return replace(self, after=max(self.after, int(np.sum(since_start_s < self.after_s))), after_s=0.0)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with inflated variances if the test triggers."""
        waits = select(self.after, memory[-1], 1.0, 0.0)
        memory[-1] += waits
        triggered = select(trace(HPHt) + trace(R), dot(innovation, innovation), 0.0, 1.0 - waits)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, (triggered, triggered))


@register("adaptation", "mtf_block")
@dataclass(frozen=True)
class MtfBlock(Windowed):
    """Multiple tuning factors with one test for position and one for velocity.

    Unlike the test of `mtf`, the two tests do not add squares of metres to squares of metres per second. In the
    following equation, B is the block of position or velocity, y is the innovation, h_i = (H P- H')_ii, r_i = R_ii, and
    w_i is the mean of the last mu values of y_i^2::

        if sum_B y_i^2 >= sum_B (h_i + r_i):    r_i = r_i + max(0, w_i - h_i - r_i),  i in B

    A fault of the position does not inflate the variance of the velocity, and a large variance of the position does not
    hide a fault of the velocity. All other properties of `mtf_block` are the same as in `mtf`, including the window and
    the guard.

    Source: multiple tuning factors (H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust
    unscented Kalman filter in the presence of measurement faults", ISA Transactions 49, 249-256, 2010,
    doi:10.1016/j.isatra.2010.04.001); the separate tests are an addition.

    Attributes:
        window: mu, number of squared innovations in the mean w_i, including the current innovation [updates].
        guard: N, maximum number of consecutive hits that inflate the variance, or 0 for no limit [updates].
    """

    provenance = Provenance(
        "own", "doi:10.1016/j.isatra.2010.04.001", "`mtf` with one test for position and one for velocity."
    )

    window: Annotated[int, AT_LEAST_ONE, SHORT_WINDOW, DefaultOrigin("literature: the paper has mu = 1")] = 1
    guard: Annotated[int, HITS, DefaultOrigin("off, as in the paper")] = 0

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window", "guard")

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with inflated variances of position or velocity if their test triggers."""
        triggered = _exceeds(innovation, HPHt, R, rows, 0), _exceeds(innovation, HPHt, R, rows, 1)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, triggered)


def _exceeds(innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, block: int) -> float:
    """Return 1 if the innovation of position (block 0) or velocity (block 1) is larger than expected, otherwise 0."""
    energy = expected = 0.0
    for i, row in enumerate(rows):
        if row // 3 == block:
            energy += innovation[i] * innovation[i]
            expected += HPHt[i, i] + R[i, i]
    return select(expected, energy, 0.0, 1.0)


@register("adaptation", "mtf_nis")
@dataclass(frozen=True)
class MtfNis(Windowed):
    """Multiple tuning factors with a chi-square test of the innovation.

    Unlike in `mtf`, the test statistic is dimensionless, and the false alarm rate of the test is a parameter. In the
    following equation, y is the innovation of m rows, S = H P- H' + R, h_i = (H P- H')_ii, r_i = R_ii, and w_i is the
    mean of the last mu values of y_i^2::

        if y' S^-1 y >= chi2(p, m):    r_i = r_i + max(0, w_i - h_i - r_i)

    In a consistent filter with p = 0.99, the test triggers at 1 % of the updates, whereas the test of `mtf` triggers at
    about 33 %. The method works well if the noise agrees with the reported R most of the time. In an overconfident
    filter, the test triggers more often, and in a conservative filter, the test hardly ever triggers.

    Source: multiple tuning factors (H. E. Soken and C. Hajiyev, "Pico satellite attitude estimation via robust
    unscented Kalman filter in the presence of measurement faults", ISA Transactions 49, 249-256, 2010,
    doi:10.1016/j.isatra.2010.04.001); the chi-square test is an addition.

    Attributes:
        probability: p, probability that the test does not trigger at an update of a consistent filter [-].
        window: mu, number of squared innovations in the mean w_i, including the current innovation [updates].
        guard: N, maximum number of consecutive hits that inflate the variance, or 0 for no limit [updates].
    """

    provenance = Provenance(
        "own", "doi:10.1016/j.isatra.2010.04.001", "`mtf` with a chi-square test of the innovation."
    )

    probability: Annotated[float, BETWEEN_0_AND_1, PROBABILITY, DefaultOrigin("convention of such tests")] = 0.99
    window: Annotated[int, AT_LEAST_ONE, SHORT_WINDOW, DefaultOrigin("as mtf")] = 1
    guard: Annotated[int, HITS, DefaultOrigin("off, as mtf")] = 0

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window", "guard")

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with inflated variances if the chi-square test triggers."""
        nis = innovation_distance(innovation, HPHt, R)
        triggered = select(chi2_tail(nis, len(rows)), 1.0 - self.probability, 0.0, 1.0)
        return inflated(innovation, HPHt, R, rows, memory, self.window, self.guard, (triggered, triggered))
