"""Variational Bayesian estimation of the diagonal of R, or of the prior covariance and R."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, FORGETTING, PASSES
from jerkbench.adaptation.common import (
    MeasuredUpdate,
    fill_mixture,
    fill_solution,
    fill_square,
    full_covariance,
    measured_update,
)
from jerkbench.adaptation.linalg import factorise, fill_inverse_diagonal, solve
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import select
from jerkbench.parameters import BETWEEN_0_AND_1, DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "variational_bayes")
@dataclass(frozen=True)
class VariationalBayes(Limited):
    """Estimates each variance of R by variational Bayes, as an inverse gamma distribution with forgetting.

    Before its first update, each row i has alpha = a0 and beta = a0 r_i, where r_i is the reported variance. In the
    following equations of an update, y is the innovation and HPH' = H P- H'::

        alpha = rho alpha + 1/2,  beta- = rho beta,  beta = beta-
        twice:  R = diag(beta / alpha),  S = HPH' + R,  res = R S^-1 y
                beta = beta- + (res_i^2 + (R - R S^-1 R)_ii) / 2

    R - R S^-1 R is equal to the term HPH' - HPH' S^-1 HPH' of the paper, but has smaller rounding errors if R is small
    compared with HPH' (after a gap). The filter uses the R of the last pass. The reported R is used only at the start,
    so later changes of the reported R have no effect. The memory length of the estimate is 1/(1 - rho) updates, which
    is 55 updates with the default. The method works well on noise that is reported incorrectly or changes slowly, but
    reacts too late to short changes. If the process model is wrong, the estimated R is also wrong.

    Source: S. Sarkka, A. Nummenmaa, "Recursive noise adaptive Kalman filtering by variational Bayesian approximations",
    IEEE Trans. Automatic Control 54(3), 596-600, 2009, doi:10.1109/TAC.2008.2008348.

    Attributes:
        forgetting: rho, forgetting factor of the estimated variance, between 0 and 1 [-].
        start: a0, initial value of alpha [-]. The reported variance has the same weight as 2 a0 updates.
        passes: number of fixed-point passes in each update [-].
    """

    provenance = Provenance("published", "doi:10.1109/TAC.2008.2008348")

    forgetting: Annotated[float, BETWEEN_0_AND_1, FORGETTING, DefaultOrigin("literature: rho of the source")] = (
        1.0 - math.exp(-4.0)
    )
    start: Annotated[
        float,
        ABOVE_0,
        Range(0.5, 50.0, log=True, source="ours: the reported R has the weight of 1 to 100 updates"),
        DefaultOrigin("ours: the reported R has the weight of six half updates"),
    ] = 3.0
    passes: Annotated[int, PASSES, DefaultOrigin("literature: two are sufficient in the source")] = 2

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 12, because the memory stores alpha and beta of each of the six rows."""
        return 12

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal matrix R of the estimated variances."""
        m = len(rows)
        vectors, S, M, buffer = np.zeros((6, m), R.dtype), HPHt.copy(), np.empty((m, m), R.dtype), R.copy()
        alpha, prior_beta, beta, r, v, inverse = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
        for i in range(m):
            stored, variance = memory[rows[i]], memory[rows[i] + 6]
            alpha[i] = self.forgetting * select(stored, 0.0, stored, self.start) + 0.5
            beta[i] = prior_beta[i] = self.forgetting * select(stored, 0.0, variance, self.start * R[i, i])
        for _ in range(self.passes):
            for i in range(m):
                r[i] = beta[i] / alpha[i]
                S[i, i] = HPHt[i, i] + r[i]
            factorise(S, M)
            solve(M, innovation, v)
            fill_inverse_diagonal(M, buffer, inverse)
            for i in range(m):
                residual = r[i] * v[i]
                beta[i] = prior_beta[i] + 0.5 * (residual * residual + (r[i] - r[i] * r[i] * inverse[i]))
        adapted = np.zeros((m, m), R.dtype)
        for i in range(m):
            adapted[i, i], memory[rows[i]], memory[rows[i] + 6] = r[i], alpha[i], beta[i]
        return adapted


SETS, SLOT = 64, 37
"""Number of possible sets of measured rows, and number of stored values for each set: u (1 value) and U (36 values)."""

EVIDENCE = Range(1.0, 100.0, log=True, source="ours: from the weight of 1 update to 100")


@register("adaptation", "vbakf_pr")
@dataclass(frozen=True)
class VariationalPriorAndNoise(Limited):
    """Estimates the prior covariance and R jointly by variational Bayes, as inverse Wishart distributions.

    For n states and m measured rows, the prior has the parameters t = n + tau + 1 and T = tau P-. Each set of measured
    rows has separate parameters u and U, with the initial values u = m + 1 + tau_R and U = tau_R R from the reported R.
    Each update computes new values u and U::

        u = rho (u - m - 1) + m + 1,  U = rho U
        N times, starting with x = x- and P = P-:
            A = P + (x - x-)(x - x-)',                  t' = t + 1,  T' = T + A
            B = (z - H x)(z - H x)' + H P H',           u' = u + 1,  U' = U + B
            P~ = T' / (t' - n - 1),  R~ = U' / (u' - m - 1),  then the Kalman update for x and P
        u = u',  U = U'

    The estimated R is a full matrix. The reported R is used only at the start, and the memory length of the estimated R
    is 1/(1 - rho) updates. At each update, the estimate of P- starts from the P- of the model with the weight tau, so
    the method does not estimate Q over several updates. The method works well on noise that is reported incorrectly or
    changes slowly. The method averages single outliers and does not reject them.

    Source: Y. Huang, Y. Zhang, Z. Wu, N. Li, J. A. Chambers, "A novel adaptive Kalman filter with inaccurate process
    and measurement noise covariance matrices", IEEE Trans. Automatic Control 63(2), 594-601, 2018,
    doi:10.1109/TAC.2017.2730480. The defaults tau = 3, rho = 1 - exp(-4) and N = 10 are from the source. Additions
    are tau_R, and the separate estimate for each set of rows, because position and velocity may be measured at
    different times.

    Attributes:
        tau: weight of P- in the estimate of the prior covariance [updates].
        start: tau_R, initial weight of the reported R in the estimate of R [updates].
        forgetting: rho, forgetting factor of the estimated R, above 0 and at most 1 [-].
        passes: N, number of passes in each update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TAC.2017.2730480", "A separate estimate of R for each set of rows of an update."
    )

    tau: Annotated[float, ABOVE_0, EVIDENCE, DefaultOrigin("literature: 3 in the paper")] = 3.0
    start: Annotated[float, ABOVE_0, EVIDENCE, DefaultOrigin("ours: the same weight as the prior")] = 3.0
    forgetting: Annotated[
        float,
        Limit(lambda share: 0 < share <= 1, "it must be above 0 and at most 1."),
        FORGETTING,
        DefaultOrigin("literature: 1 - exp(-4) in the paper"),
    ] = 1.0 - math.exp(-4.0)
    passes: Annotated[int, PASSES, DefaultOrigin("literature: 10 in the paper")] = 10

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return the memory length for u and U of each set of measured rows."""
        return SETS * SLOT

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
        """Return the estimated prior covariance P~, and store u and U in the memory."""
        m, slot, update = len(rows), SLOT * _index_of(rows), measured_update(P, R.copy(), rows)
        stored_u, stored_U = memory[slot], memory[slot + 1 : slot + 1 + m * m].reshape((m, m))
        u = self.forgetting * select(stored_u, 0.0, stored_u - m - 1.0, self.start)  # u - m - 1 in the equations
        N, U = update.W.copy(), np.empty((m, m), R.dtype)
        for i in range(m):
            for j in range(m):
                U[i, j] = self.forgetting * select(stored_u, 0.0, stored_U[i, j], self.start * R[i, j])
        for k in range(self.passes):
            if k > 0:
                fill_solution(update, innovation, 1.0, 1.0)
                fill_square(update, 1.0)
            _fill_scale(update, innovation, U, stored_U)
            fill_mixture(update.W, N, self.tau, update.D, 1.0)
            by_u = 1.0 / (u + 1.0)
            for i in range(m):
                for j in range(m):
                    update.R[i, j] = stored_U[i, j] * by_u
        memory[slot] = u + m + 2.0
        return full_covariance(P, rows, N, update.W, 1.0)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the estimated measurement covariance R~ of the last pass."""
        m, slot = len(rows), SLOT * _index_of(rows)
        Rt = np.empty((m, m), R.dtype)
        for i in range(m):
            for j in range(m):
                Rt[i, j] = memory[slot + 1 + m * i + j] / (memory[slot] - m - 1.0)
        return Rt


def _fill_scale(update: MeasuredUpdate, innovation: FloatArray, U: FloatArray, U_new: FloatArray) -> None:
    """Compute U' = U + B, exactly symmetric, where H P H' is H D_x H' minus H (x - x-)(x - x-)' H'."""
    step = update.step
    for i in range(len(step)):
        for j in range(i + 1):
            square = (innovation[i] - step[i]) * (innovation[j] - step[j])
            U_new[i, j] = U_new[j, i] = U[i, j] + (update.D[i, j] - step[i] * step[j]) + square


def _index_of(rows: IntArray) -> int:
    """Return an index that identifies a set of measured rows, the sum of 2^row."""
    number = 0
    for row in rows:
        number += 2**row
    return number
