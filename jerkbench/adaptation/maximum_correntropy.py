"""Maximum correntropy of prior and measurement."""

import math
from dataclasses import dataclass
from typing import Annotated

from jerkbench.adaptation._ranges import BANDWIDTH
from jerkbench.adaptation._stack import PASSES, SMALLEST_WEIGHT, check_sides, doubtable, gain_of, settle, stack_of
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError
from jerkbench.parameters import Origin
from jerkbench.plugins import register


@register("adaptation", "maximum_correntropy")
@dataclass(frozen=True)
class MaximumCorrentropy:
    """Weighs every component of prior and measurement by a Gaussian kernel, until the state stands still.

    With P- = B_p B_p' and R = B_r B_r' (Cholesky) and x the state of the pass before, from x = x- with weights of 1::

        C_p, C_r = diag(exp(-r_i^2 / (2 sigma^2))),  r_p = B_p^-1 (x - x-),  r_r = B_r^-1 (z - H x)
        P~ = B_p C_p^-1 B_p',  R~ = B_r C_r^-1 B_r',  K = P~ H' (H P~ H' + R~)^-1,  x = x- + K (z - H x-)

    It ends where x moves by less than 1e-6 |x|, or after 50 passes. Only the gain comes from the weights, the
    covariance from P- and R as they were: P = (I - K H) P- (I - K H)' + K R K'. A residual of several sigma loses its
    weight altogether. A small sigma locks out: where Q is large or after an outage the first good measurements are
    far from the prior. ``sides=measurement`` leaves C_p = I. Of the measurement alone, in a few passes, it is
    `maximum_correntropy_r`.

    Source: B. Chen, X. Liu, H. Zhao, J. C. Principe, "Maximum correntropy Kalman filter", Automatica 76, 70-77, 2017,
    doi:10.1016/j.automatica.2016.10.004. Theirs starts with the weights of x-; ours with weights of 1, the Kalman
    update; weights stay above 1e-8. They take sigma from 2 to 10 (ours 5); the switch of sides is ours.

    Attributes:
        bandwidth: sigma, of the kernel, in standard deviations of the whitened residual [-].
        sides: whom the weights doubt, "both" or "measurement".
    """

    bandwidth: Annotated[float, BANDWIDTH, Origin("literature: 2 to 10 in the paper")] = 5.0
    sides: Annotated[str, Origin("literature: the paper weighs both")] = "both"

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_sides("maximum_correntropy", self.sides)
        if not self.bandwidth > 0:
            raise PluginError(f"maximum_correntropy.bandwidth is {self.bandwidth}; it must be above 0.")

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged: only the gain is weighed."""
        return R

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return K of the last pass."""
        stack = stack_of(P, R, rows, innovation)
        first = 0 if self.sides == "both" else doubtable(stack)
        for k in range(PASSES):
            if k > 0:
                for i in range(first, len(stack.weights)):
                    stack.weights[i] = _kernel(stack.residual[i], self.bandwidth)
            if settle(stack, x):
                break
        return gain_of(stack)


def _kernel(residual: float, bandwidth: float) -> float:
    """Return exp(-residual^2 / (2 bandwidth^2))."""
    return max(math.exp(-0.5 * (residual / bandwidth) ** 2), SMALLEST_WEIGHT)
