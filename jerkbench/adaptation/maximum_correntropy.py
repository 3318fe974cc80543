"""Maximum correntropy weights, for prior and measurement or for R only, and centred error entropy weights."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, BANDWIDTH, ONE_OF_SIDES, PASSES, one_of
from jerkbench.adaptation.common import (
    MAX_ITERATIONS,
    MIN_WEIGHT,
    UnchangedR,
    gain_of,
    gaussian_kernel,
    inverse_kernel,
    solve_stack,
    stack_of,
)
from jerkbench.adaptation.linalg import MIN_RESIDUAL_WEIGHT, residuals_of, update_residuals, weighted, whiten
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, select
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register

STARTS = ("prediction", "update")
"""Values of ``start``: the first weights are computed from the residuals of the prediction, as in the source, or from
the residuals after the Kalman update."""


@register("adaptation", "maximum_correntropy")
@dataclass(frozen=True)
class MaximumCorrentropy(UnchangedR, Limited):
    """Iterates the update with Gaussian kernel weights for every component of prior and measurement.

    In the following equations of a pass, x is the state of the previous pass (at first x-), and P- = B_p B_p' and R =
    B_r B_r' (Cholesky)::

        C_p, C_r = diag(exp(-r_i^2 / (2 sigma^2))),  r_p = B_p^-1 (x - x-),  r_r = B_r^-1 (z - H x)
        P~ = B_p C_p^-1 B_p',  R~ = B_r C_r^-1 B_r',  K = P~ H' (H P~ H' + R~)^-1,  x = x- + K (z - H x-)

    The iteration ends if x changes by less than 1e-6 |x|, or after 50 passes. Only the gain K depends on the weights.
    The update of the covariance, P = (I - K H) P- (I - K H)' + K R K', uses the original P- and R. A residual of
    several standard deviations has a weight of nearly zero. The filter may reject all measurements and diverge, because
    the weights at x- treat a correct measurement far from the prior as an outlier. The filter may diverge after an
    outage, with a large Q or a small sigma, and without an IMU (experiments/journeys). With ``start=update``, the
    weights of the first pass are 1, so the first pass is the Kalman update. With ``start=update``, the filter rejects
    fewer correct measurements, but also fewer outliers. The option ``sides=measurement`` sets C_p = I. The adaptation
    `maximum_correntropy_r` weights only the measurement, in a few passes.

    Source: B. Chen, X. Liu, H. Zhao, J. C. Principe, "Maximum correntropy Kalman filter", Automatica 76, 70-77, 2017,
    doi:10.1016/j.automatica.2016.10.004. The source uses sigma from 2 to 10; the default here is 5. Additions to the
    published method are ``start=update``, ``sides``, and a lower bound of 1e-8 for the weights.

    Attributes:
        bandwidth: sigma, bandwidth of the kernel, in standard deviations of the whitened residual [-].
        sides: "both" to weight prior and measurement, or "measurement" to weight only the measurement.
        start: residuals from which the first weights are computed, either the residuals of the "prediction" or the
            residuals after the Kalman "update".
    """

    provenance = Provenance("published", "doi:10.1016/j.automatica.2016.10.004")

    bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("literature: 2 to 10 in the paper")] = 5.0
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weights both")] = "both"
    start: Annotated[str, one_of(STARTS), DefaultOrigin("literature: the paper starts at the prediction")] = (
        "prediction"
    )

    lanes: ClassVar[bool] = True

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the Kalman gain K of the last pass."""
        stack = stack_of(P, R, rows, innovation)
        p, changed = len(stack.Up), 1.0
        if self.start == "prediction":
            for c in range(p):
                stack.residual[c] = 0.0
            whiten(stack.Jt[p:], innovation, stack.residual[p:])
        for k in range(MAX_ITERATIONS):
            if k > 0 or self.start == "prediction":
                for i in range(0 if self.sides == "both" else p, len(stack.inverses)):
                    inverse = inverse_kernel(stack.residual[i], self.bandwidth, MIN_WEIGHT)
                    stack.inverses[i] = select(changed, 0.0, inverse, stack.inverses[i])
            changed = solve_stack(stack, x)
            if not anywhere(changed):
                break
        return gain_of(stack)


@register("adaptation", "maximum_correntropy_r")
@dataclass(frozen=True)
class MaximumCorrentropyR(Limited):
    """Weights each measurement by a Gaussian kernel of its residual.

    In the following equations of a pass, y is the innovation, R = L L' (Cholesky), and the initial value is R_0 = R::

        e = L^-1 R_k (H P- H' + R_k)^-1 y                      the standardised residual after an update with R_k
        R_(k+1) = L diag(1 / max(G_i, 1e-9)) L',   G_i = exp(-e_i^2 / (2 sigma^2))

    A residual of several standard deviations has a weight of nearly zero. Unlike with Huber weights, large outliers
    have no influence. The bandwidth sigma is a multiple of the reported standard deviation. If the reported R is too
    small, the method treats correct measurements as outliers. For sigma -> infinity, the method is equivalent to
    `none`.

    Source: B. Chen, X. Liu, H. Zhao, J. C. Principe, "Maximum correntropy Kalman filter", Automatica 76, 70-77, 2017,
    doi:10.1016/j.automatica.2016.10.004. Simplifications: the kernel weights only the measurement, and the prior
    covariance does not change; the number of passes is fixed; and the first pass is the Kalman update with the reported
    R and not the prediction, because after an outage (h much larger than r) every correct measurement is far from the
    prior and would be rejected.

    Attributes:
        bandwidth: sigma, bandwidth of the kernel, in standard deviations of the measurement [-].
        passes: number of fixed-point passes in each update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1016/j.automatica.2016.10.004", "Weights only the measurement, in a few passes."
    )

    bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("literature: the source uses 2 to 10")] = 5.0
    passes: Annotated[int, PASSES, DefaultOrigin("ours")] = 5

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, adapted with the inverse weights of the last pass."""
        update = residuals_of(innovation, HPHt, R)
        for _ in range(self.passes):
            update_residuals(update)
            for i in range(len(rows)):
                update.D[i] = inverse_kernel(update.e[i], self.bandwidth, MIN_RESIDUAL_WEIGHT)
        return weighted(update.U, update.D)


@register("adaptation", "cerkf_r")
@dataclass(frozen=True)
class CentredErrorEntropyR(Limited):
    """Weights each measurement by the distance of its residual from zero and from the other residuals.

    The method derives the weights from the centred error entropy. In the following equations of a pass, y is the
    innovation of m rows, R = L L' (Cholesky), R_0 = R, and G_s(e) = exp(-e^2 / (2 s^2)) is the kernel::

        e = L^-1 R_k (H P- H' + R_k)^-1 y                      the standardised residual after an update with R_k
        w_i = eta G_s1(e_i) + (1 - eta) mean_(j != i) G_s2(e_i - e_j)
        R_(k+1) = L diag(1 / max(w_i, 1e-9)) L'

    The first term of the weight w_i is the correntropy, and the second term is the pairwise error entropy. If only one
    row is an outlier, both terms of its weight are small. If all rows have a similar error, the second term remains
    large, so R increases by a factor of at most 1/(1 - eta), and the method has little effect on a fault of several
    axes. If only one row is measured, there are no pairs, and eta is set to 1. With very wide kernels, the method is
    equivalent to `none`.

    Source: centred error entropy in B. Yang, H. Huang, L. Cao, "Centered error entropy-based sigma-point Kalman filter
    for spacecraft state estimation with non-Gaussian noise", Space: Science & Technology 2022, 9854601,
    doi:10.34133/2022/9854601; error entropy in B. Chen, L. Dang, Y. Gu, N. Zheng, J. C. Principe, "Minimum error
    entropy Kalman filter", arXiv:1904.06617. Simplifications: only errors of the measurement are weighted (the prior
    covariance does not change); the matrix of the pair term is replaced by its normalised row sums on the diagonal,
    without couplings between rows; the number of passes is fixed; and the first pass is the Kalman update with the
    reported R.

    Attributes:
        eta: weight of the correntropy term, which centres the errors at zero, from 0 to 1 [-].
        centre_bandwidth: s1, kernel bandwidth of the correntropy term, in standard deviations of the measurement [-].
        pair_bandwidth: s2, kernel bandwidth of the pairwise term, in standard deviations of the measurement [-].
        passes: number of fixed-point passes in each update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.34133/2022/9854601", "Changes only R, rows are not coupled, a fixed number of passes."
    )

    eta: Annotated[
        float,
        Limit(lambda eta: 0 <= eta <= 1, "it must be from 0 to 1."),
        Range(0.1, 1.0, source="literature: a weight; below 0.1 the errors are hardly centred"),
        DefaultOrigin("ours"),
    ] = 0.8
    centre_bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("ours, as maximum_correntropy")] = 5.0
    pair_bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("ours, as maximum_correntropy")] = 5.0
    passes: Annotated[int, PASSES, DefaultOrigin("ours")] = 5

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, adapted with the inverse weights of the last pass."""
        update = residuals_of(innovation, HPHt, R)
        pairs, eta = np.empty(len(rows), R.dtype), self.eta if len(rows) > 1 else 1.0
        for _ in range(self.passes):
            update_residuals(update)
            _fill_pairs(update.e, self.pair_bandwidth, pairs)
            for i in range(len(rows)):
                weight = eta * gaussian_kernel(update.e[i], self.centre_bandwidth) + (1.0 - eta) * pairs[i]
                update.D[i] = 1.0 / max(weight, MIN_RESIDUAL_WEIGHT)
        return weighted(update.U, update.D)


def _fill_pairs(e: FloatArray, bandwidth: float, pairs: FloatArray) -> None:
    """Compute the mean kernel of the differences between a row and all other rows, or zero if there is only one row."""
    m = len(e)
    for i in range(m):
        pairs[i] = 0.0
        for j in range(i):
            near = gaussian_kernel(e[i] - e[j], bandwidth) / (m - 1)
            pairs[i] += near
            pairs[j] += near
