"""Maximum correntropy of prior and measurement."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, BANDWIDTH, ONE_OF_SIDES, one_of
from jerkbench.adaptation.common import MIN_WEIGHT, PASSES, gain_of, inverse_kernel, settle, stack_of
from jerkbench.adaptation.linalg import AXES, whiten
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register

STARTS = ("prediction", "update")
"""Whose residuals the first weights are of: those of x-, as published, or those of the Kalman update."""


@register("adaptation", "maximum_correntropy")
@dataclass(frozen=True)
class MaximumCorrentropy(Limited):
    """Weighs every component of prior and measurement by a Gaussian kernel, until the state stands still.

    With P- = B_p B_p' and R = B_r B_r' (Cholesky) and x the state of the pass before, from x = x-::

        C_p, C_r = diag(exp(-r_i^2 / (2 sigma^2))),  r_p = B_p^-1 (x - x-),  r_r = B_r^-1 (z - H x)
        P~ = B_p C_p^-1 B_p',  R~ = B_r C_r^-1 B_r',  K = P~ H' (H P~ H' + R~)^-1,  x = x- + K (z - H x-)

    It ends where x moves by less than 1e-6 |x|, or after 50 passes. Only the gain comes from the weights, the
    covariance from P- and R as they were: P = (I - K H) P- (I - K H)' + K R K'. A residual of several sigma loses its
    weight altogether. It can lock out, for weights at x- take a good measurement that is far from the prior for an
    outlier: after an outage, where Q is large or sigma small, and without an IMU (experiments/journeys).
    ``start=update`` has weights of 1 in the first pass, the Kalman update: it locks out less and keeps outliers.
    ``sides=measurement`` leaves C_p = I. Of the measurement alone, in a few passes, it is `maximum_correntropy_r`.

    Source: B. Chen, X. Liu, H. Zhao, J. C. Principe, "Maximum correntropy Kalman filter", Automatica 76, 70-77, 2017,
    doi:10.1016/j.automatica.2016.10.004. They take sigma from 2 to 10 (ours 5). Ours are ``start=update``, the switch
    of sides, and that weights stay above 1e-8.

    Attributes:
        bandwidth: sigma, of the kernel, in standard deviations of the whitened residual [-].
        sides: whom the weights doubt, "both" or "measurement".
        start: whose residuals the first weights are of, "prediction" or "update" (the Kalman update).
    """

    provenance = Provenance("published", "doi:10.1016/j.automatica.2016.10.004")

    bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("literature: 2 to 10 in the paper")] = 5.0
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weighs both")] = "both"
    start: Annotated[str, one_of(STARTS), DefaultOrigin("literature: the paper starts at the prediction")] = (
        "prediction"
    )

    lanes: ClassVar[bool] = True

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
        p = stack.Up.shape[1]
        first = 0 if self.sides == "both" else p
        if self.start == "prediction":  # r_p = 0, r_r = B_r^-1 (z - H x-)
            for a in range(AXES):
                for c in range(p):
                    stack.residual[a, c] = 0.0
                whiten(stack.columns[a, p:], stack.y[a], stack.residual[a, p:])
        moves = 1.0
        for k in range(PASSES):
            if k > 0 or self.start == "prediction":
                for a in range(AXES):
                    for i in range(first, stack.inverses.shape[1]):
                        inverse = inverse_kernel(stack.residual[a, i], self.bandwidth, MIN_WEIGHT)
                        stack.inverses[a, i] = chosen(moves, 0.0, inverse, stack.inverses[a, i])
            moves = settle(stack, x)
            if not anywhere(moves):
                break
        return gain_of(stack)
