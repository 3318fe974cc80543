"""Centred error entropy, the measurement alone."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, BANDWIDTH, SOME_PASSES
from jerkbench.adaptation.common import gaussian_kernel
from jerkbench.adaptation.linalg import MIN_RESIDUAL_WEIGHT, residuals_of, update_residuals, weighted
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "cerkf_r")
@dataclass(frozen=True)
class CentredErrorEntropyR(Limited):
    """Weighs each measurement by how near its residual is to zero and to the other residuals.

    The centred error entropy. With R = L L' (Cholesky), y the innovation of m rows, R_0 = R and
    G_s(e) = exp(-e^2 / (2 s^2)), several passes of::

        e = L^-1 R_k (H P- H' + R_k)^-1 y                      the standardised residual after an update with R_k
        w_i = eta G_s1(e_i) + (1 - eta) mean_(j != i) G_s2(e_i - e_j)
        R_(k+1) = L diag(1 / max(w_i, 1e-9)) L'

    The first term is correntropy, the second the pairs of error entropy: a row that stands apart from the others loses
    weight in both. Rows that err together keep the second, so that R grows by 1/(1 - eta) at the most: weak on a fault
    of several axes. One row alone has no pairs: eta counts as 1. With wide kernels it is `none`.

    Source: centred error entropy in B. Yang, H. Huang, L. Cao, "Centered error entropy-based sigma-point Kalman filter
    for spacecraft state estimation with non-Gaussian noise", Space: Science & Technology 2022, 9854601,
    doi:10.34133/2022/9854601; error entropy in B. Chen, L. Dang, Y. Gu, N. Zheng, J. C. Principe, "Minimum error
    entropy Kalman filter", arXiv:1904.06617. Simplified: the errors of the measurement alone (the prior keeps its
    covariance); of the pair term's matrix only the sums on the diagonal, normalised, without the couplings between
    rows; a fixed number of passes, started from the Kalman update with the reported R.

    Attributes:
        eta: share of the term that centres the errors at zero [-].
        centre_bandwidth: s1, kernel of that term, in standard deviations of the measurement [-].
        pair_bandwidth: s2, kernel of the pairs, in the same unit [-].
        passes: fixed-point passes of an update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.34133/2022/9854601", "R alone, rows not coupled, a fixed number of passes."
    )

    eta: Annotated[
        float,
        Limit(lambda eta: 0 <= eta <= 1, "it must be from 0 to 1."),
        Range(0.1, 1.0, source="literature: a share; below a tenth nothing centres the errors"),
        DefaultOrigin("ours"),
    ] = 0.8
    centre_bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("ours, as maximum_correntropy")] = 5.0
    pair_bandwidth: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("ours, as maximum_correntropy")] = 5.0
    passes: Annotated[int, SOME_PASSES, DefaultOrigin("ours")] = 5

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, reweighted."""
        of = residuals_of(innovation, HPHt, R)
        pairs, eta = np.empty(len(rows), R.dtype), self.eta if len(rows) > 1 else 1.0
        for _ in range(self.passes):
            update_residuals(of)
            _fill_pairs(of.e, self.pair_bandwidth, pairs)
            for i in range(len(rows)):
                weight = eta * gaussian_kernel(of.e[i], self.centre_bandwidth) + (1.0 - eta) * pairs[i]
                of.D[i] = 1.0 / max(weight, MIN_RESIDUAL_WEIGHT)
        return weighted(of.U, of.D)


def _fill_pairs(e: FloatArray, bandwidth: float, pairs: FloatArray) -> None:
    """Fill the mean of the kernel over the pairs of each row; zero for a row alone."""
    m = len(e)
    for i in range(m):
        pairs[i] = 0.0
        for j in range(i):
            near = gaussian_kernel(e[i] - e[j], bandwidth) / (m - 1)
            pairs[i] += near
            pairs[j] += near
