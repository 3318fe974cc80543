"""Student's t as a rule on R alone, in one pass."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, FREEDOM
from jerkbench.adaptation.common import innovation_distance
from jerkbench.adaptation.linalg import scaled
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "student_t_r")
@dataclass(frozen=True)
class StudentTR(Limited):
    """Scales the whole of R by the weight of Student's t distribution.

    With y the innovation of m rows and S = H P- H' + R::

        w = (nu + m) / (nu + y' S^-1 y),    R = R / w

    w exceeds 1 where the innovation is smaller than expected: R then shrinks, to no less than nu/(nu + m) of itself.
    Good on heavy tails without a threshold; one weight for all rows, so one bad axis makes the others worse. With
    nu -> infinity it is `none`.

    Source: the expected scale of a multivariate t noise, as in G. Agamennoni, J. I. Nieto, E. M. Nebot, "An
    outlier-robust Kalman filter", IEEE International Conference on Robotics and Automation, 2011,
    doi:10.1109/ICRA.2011.5979605. Simplified: one pass with the reported R and the innovation in place of the expected
    residual; R is scaled, not estimated.

    Attributes:
        nu: degrees of freedom; the smaller, the heavier the tails [-].
    """

    provenance = Provenance("simplified", "doi:10.1109/ICRA.2011.5979605", "R is scaled, not estimated, in one pass.")

    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("literature: 3 to 5 is usual")] = 4.0

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, scaled as a whole."""
        nis = innovation_distance(innovation, HPHt, R)
        return scaled(R, (self.nu + nis) / (self.nu + len(rows)))
