"""Maximum correntropy, the measurement alone."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, BANDWIDTH, SOME_PASSES
from jerkbench.adaptation.common import inverse_kernel
from jerkbench.adaptation.linalg import MIN_RESIDUAL_WEIGHT, residuals_of, update_residuals, weighted
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "maximum_correntropy_r")
@dataclass(frozen=True)
class MaximumCorrentropyR(Limited):
    """Weighs each measurement by a Gaussian kernel of its residual.

    With R = L L' (Cholesky), y the innovation, and R_0 = R::

        e = L^-1 R_k (H P- H' + R_k)^-1 y                      the standardised residual after an update with R_k
        R_(k+1) = L diag(1 / max(G_i, 1e-9)) L',   G_i = exp(-e_i^2 / (2 sigma^2))

    A residual of several sigma loses its weight altogether: large outliers vanish, where Huber's weight lets them pull.
    sigma is in standard deviations of the measurement, so a measurement noise that is reported too small is taken for
    outliers. With sigma -> infinity it is `none`.

    Source: B. Chen, X. Liu, H. Zhao, J. C. Principe, "Maximum correntropy Kalman filter", Automatica 76, 70-77, 2017,
    doi:10.1016/j.automatica.2016.10.004. Simplified: the kernel weighs the measurement alone, the prior keeps its
    covariance; a fixed number of passes; and the fixed point starts from the Kalman update with the reported R instead
    of the prior, because after an outage (h much larger than r) every good measurement is far from the prior and would
    be rejected.

    Attributes:
        bandwidth: sigma, of the kernel, in standard deviations of the measurement [-].
        passes: fixed-point passes of an update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1016/j.automatica.2016.10.004", "The measurement alone, in a few passes."
    )

    bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("literature: the source uses 2 to 10")] = 5.0
    passes: Annotated[int, SOME_PASSES, DefaultOrigin("ours")] = 5

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, reweighted."""
        of = residuals_of(innovation, HPHt, R)
        for _ in range(self.passes):
            update_residuals(of)
            for i in range(len(rows)):
                of.D[i] = inverse_kernel(of.e[i], self.bandwidth, MIN_RESIDUAL_WEIGHT)
        return weighted(of.U, of.D)
