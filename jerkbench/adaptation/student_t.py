"""Student's t distributions of prior and measurement."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, FREEDOM, ONE_OF_SIDES, SOME_PASSES
from jerkbench.adaptation.common import (
    distances,
    fill_blend,
    fill_square,
    first_distance,
    innovate,
    measured_of,
    spread_part,
)
from jerkbench.adaptation.linalg import scaled
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "student_t")
@dataclass(frozen=True)
class StudentT(Limited):
    """Takes prior and measurement for Student's t, and the prior's scale for unknown, by variational Bayes.

    With n states and m rows, x and P those of the pass before, E = P-, from x = x- and P = P- in N passes::

        D_x = P + (x - x-)(x - x-)',    D_z = H P H' + (z - H x)(z - H x)'
        xi = (nu + n) / (nu + tr(D_x E^-1)),    lambda = (nu + m) / (nu + tr(D_z R^-1))
        E = (tau P- + xi D_x) / (tau + 1)
        P~ = E / xi,  R~ = R / lambda,  then the usual update for x and P

    One weight for the prior and one for the measurement: one bad axis makes the others worse. ``sides=measurement``
    leaves xi = 1 and E = P-. R alone, one pass, from the innovation: `student_t_r`.

    Source: Y. Huang, Y. Zhang, N. Li, Z. Wu, J. A. Chambers, "A novel robust Student's t-based Kalman filter", IEEE
    Trans. Aerospace and Electronic Systems 53(3), 1545-1554, 2017, doi:10.1109/TAES.2017.2651684. Theirs are nu =
    tau = 5 and N = 10, as ours; the switch of sides is ours.

    Attributes:
        nu: degrees of freedom of both; the smaller, the heavier the tails [-].
        tau: how much the scale of the prior is believed, in passes' worth of evidence [-].
        passes: N, of an update [-].
        sides: whom the weights doubt, "both" or "measurement".
    """

    provenance = Provenance("published", "doi:10.1109/TAES.2017.2651684")

    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("literature: 5 in the paper")] = 5.0
    tau: Annotated[
        float,
        ABOVE_0,
        Range(1.0, 100.0, log=True, source="ours: from a prior that counts half to one that is all but fixed"),
        DefaultOrigin("literature: 5 in the paper"),
    ] = 5.0
    passes: Annotated[int, SOME_PASSES, DefaultOrigin("literature: 10 in the paper")] = 10
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weighs both")] = "both"

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 1: lambda, from the prior's turn to that of R."""
        return 1

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
        """Return P~, and leave lambda in the memory."""
        n, m, part = len(x), len(rows), measured_of(P, R, rows)
        N, share, xi = part.W.copy(), 1.0, 1.0
        weight = (self.nu + m) / (self.nu + first_distance(part, innovation))
        for _ in range(1, self.passes):  # the first leaves xi = 1 and E = P-
            innovate(part, innovation, xi, weight)
            g_x, g_z = distances(part, n, xi, weight)
            weight = (self.nu + m) / (self.nu + g_z)
            if self.sides == "both":
                fill_square(part, xi)
                share /= xi
                xi = (self.nu + n) / (self.nu + g_x)
                fill_blend(part.W, N, self.tau, part.D, xi)
                share = (self.tau + xi * share) / (self.tau + 1.0)
        memory[0] = weight
        return spread_part(P, rows, N, scaled(part.W, 1.0 / xi), share / xi) if self.sides == "both" else P

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R~."""
        return scaled(R, 1.0 / memory[0])
