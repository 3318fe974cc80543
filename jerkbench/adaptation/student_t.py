"""Scaling by Student's t distributions, for prior and measurement, or for R only in one pass."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, FREEDOM, ONE_OF_SIDES, PASSES
from jerkbench.adaptation.common import (
    fill_mixture,
    fill_solution,
    fill_square,
    full_covariance,
    initial_trace,
    innovation_distance,
    measured_update,
    whitened_traces,
)
from jerkbench.adaptation.linalg import scaled
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "student_t")
@dataclass(frozen=True)
class StudentT(Limited):
    """Models prior and measurement by Student's t distributions, and estimates their scales by variational Bayes.

    The initial values of the iteration are E = P-, x = x- and P = P-. In the following equations of a pass, x and P are
    the results of the previous pass, for n states and m measured rows::

        D_x = P + (x - x-)(x - x-)',    D_z = H P H' + (z - H x)(z - H x)'
        xi = (nu + n) / (nu + tr(D_x E^-1)),    lambda = (nu + m) / (nu + tr(D_z R^-1))
        E = (tau P- + xi D_x) / (tau + 1)
        P~ = E / xi,  R~ = R / lambda,  then the Kalman update for x and P

    All measured rows have the same weight, so one faulty axis reduces the weight of the other axes. The option
    ``sides=measurement`` sets xi = 1 and E = P-. The adaptation `student_t_r` changes only R, in one pass.

    Source: Y. Huang, Y. Zhang, N. Li, Z. Wu, J. A. Chambers, "A novel robust Student's t-based Kalman filter", IEEE
    Trans. Aerospace and Electronic Systems 53(3), 1545-1554, 2017, doi:10.1109/TAES.2017.2651684. The defaults nu =
    tau = 5 and N = 10 are from the source. The parameter ``sides`` is an addition to the published method.

    Attributes:
        nu: degrees of freedom of both distributions. Smaller values give heavier tails [-].
        tau: weight of P- in the scale matrix E, relative to the weight 1 of the term xi D_x [-].
        passes: N, number of passes in each update [-].
        sides: "both" to weight prior and measurement, or "measurement" to weight only the measurement.
    """

    provenance = Provenance("published", "doi:10.1109/TAES.2017.2651684")

    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("literature: 5 in the paper")] = 5.0
    tau: Annotated[
        float,
        ABOVE_0,
        Range(1.0, 100.0, log=True, source="ours: from a weight of one half to a nearly fixed scale"),
        DefaultOrigin("literature: 5 in the paper"),
    ] = 5.0
    passes: Annotated[int, PASSES, DefaultOrigin("literature: 10 in the paper")] = 10
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weights both")] = "both"

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 1, because the memory passes the weight lambda from `adapt_prior` to `adapt`."""
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
        """Return the scaled prior covariance P~, and store lambda in the memory."""
        n, m, update = len(x), len(rows), measured_update(P, R, rows)
        N, f, xi = update.W.copy(), 1.0, 1.0
        weight = (self.nu + m) / (self.nu + initial_trace(update, innovation))
        for _ in range(1, self.passes):  # the first pass has xi = 1 and E = P-
            fill_solution(update, innovation, xi, weight)
            g_x, g_z = whitened_traces(update, n, xi, weight)
            weight = (self.nu + m) / (self.nu + g_z)
            if self.sides == "both":
                fill_square(update, xi)
                f /= xi
                xi = (self.nu + n) / (self.nu + g_x)
                fill_mixture(update.W, N, self.tau, update.D, xi)
                f = (self.tau + xi * f) / (self.tau + 1.0)
        memory[0] = weight
        return full_covariance(P, rows, N, scaled(update.W, 1.0 / xi), f / xi) if self.sides == "both" else P

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the scaled measurement covariance R~ of the last pass."""
        return scaled(R, 1.0 / memory[0])


@register("adaptation", "student_t_r")
@dataclass(frozen=True)
class StudentTR(Limited):
    """Scales R by the inverse weight of Student's t distribution.

    In the following equations, y is the innovation of m rows and S = H P- H' + R::

        w = (nu + m) / (nu + y' S^-1 y),    R = R / w

    If the innovation is smaller than expected, w exceeds 1 and R decreases. The adapted R is at least nu/(nu + m) times
    the reported R. The method works well on noise with heavy tails and needs no threshold. All measured rows have the
    same weight, so one faulty axis reduces the weight of the other axes. For nu -> infinity, the method is equivalent
    to `none`.

    Source: the expected scale of a multivariate t noise, as in G. Agamennoni, J. I. Nieto, E. M. Nebot, "An
    outlier-robust Kalman filter", IEEE International Conference on Robotics and Automation, 2011,
    doi:10.1109/ICRA.2011.5979605. Simplifications: the method makes one pass with the reported R, uses the innovation
    instead of the expected residual, and scales R instead of estimating R.

    Attributes:
        nu: degrees of freedom of the distribution. Smaller values give heavier tails [-].
    """

    provenance = Provenance("simplified", "doi:10.1109/ICRA.2011.5979605", "R is scaled, not estimated, in one pass.")

    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("literature: 3 to 5")] = 4.0

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, divided by the weight w."""
        nis = innovation_distance(innovation, HPHt, R)
        return scaled(R, (self.nu + nis) / (self.nu + len(rows)))
