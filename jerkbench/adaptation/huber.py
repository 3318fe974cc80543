"""Huber's weights on prior and measurement."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, ONE_OF_SIDES
from jerkbench.adaptation.common import MIN_WEIGHT, PASSES, settle, stack_of, weighed_prior
from jerkbench.adaptation.linalg import AXES, block_roots, weighted
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "huber")
@dataclass(frozen=True)
class Huber(Limited):
    """Weighs every component of prior and measurement by Huber's function, until the state stands still.

    With P- = B_p B_p' and R = B_r B_r' (Cholesky) and x the state of the pass before, from x = x- with weights of 1::

        r_p = B_p^-1 (x - x-),  r_r = B_r^-1 (z - H x)                the whitened stack
        C_p, C_r = diag(min(1, gamma / |r_i|))
        P~ = B_p C_p^-1 B_p',  R~ = B_r C_r^-1 B_r',  x = x- + P~ H' (H P~ H' + R~)^-1 (z - H x-)

    It ends where x moves by less than 1e-6 |x|, or after 50 passes; P~ and R~ of the last one are used, for P too. A
    residual beyond gamma sigma costs linearly, so the pull of an outlier is bounded. Where P- is larger than R (after
    an outage, with a large Q) an outlier of the measurement moves the state, and the prior takes the blame:
    ``sides=measurement`` leaves C_p = I. Row by row without iterations: `huber_r`.

    Source: C. D. Karlgaard, "Nonlinear regression Huber-Kalman filtering and fixed-interval smoothing", Journal of
    Guidance, Control, and Dynamics 38(2), 2015, doi:10.2514/1.G000799. Left out: the nonlinear measurement and the
    smoother; ours are linear, and a switch of sides is ours.

    Attributes:
        threshold: gamma, in standard deviations of the whitened residual [-].
        sides: whom the weights doubt, "both" or "measurement".
    """

    provenance = Provenance("published", "doi:10.2514/1.G000799")

    threshold: Annotated[
        float,
        ABOVE_0,
        Range(0.5, 10.0, log=True, source="ours: from all but the median to all but the mean"),
        DefaultOrigin("literature: 1.345, 95 % as efficient as the plain filter on Gaussian noise"),
    ] = 1.345
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weighs both")] = "both"

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 6: the inverse weights of the rows, from the prior's turn to that of R."""
        return 6

    def adapt_prior(
        self,
        x: FloatArray,
        P: FloatArray,
        F: FloatArray,
        Q: FloatArray,
        innovation: FloatArray,
        R: FloatArray,
        rows: IntArray,
        memory: FloatArray,
    ) -> FloatArray:
        """Return P~, and leave the inverse weights of the rows in the memory."""
        stack = stack_of(P, R, rows, innovation)
        first = 0 if self.sides == "both" else stack.Up.shape[1]
        by_threshold, moves = 1.0 / self.threshold, 1.0
        for k in range(PASSES):
            if k > 0:
                for a in range(AXES):
                    for i in range(first, stack.inverses.shape[1]):
                        inverse = min(max(abs(stack.residual[a, i]) * by_threshold, 1.0), 1.0 / MIN_WEIGHT)
                        stack.inverses[a, i] = chosen(moves, 0.0, inverse, stack.inverses[a, i])
            moves = settle(stack, x)
            if not anywhere(moves):
                break
        for i in range(len(rows)):
            memory[i] = stack.inverses[i % AXES, stack.Up.shape[1] + i // AXES]
        return weighed_prior(P, stack.Up, stack.inverses)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R~."""
        return weighted(block_roots(R, len(R)), memory[: len(rows)])
