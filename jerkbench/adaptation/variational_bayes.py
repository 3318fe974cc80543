"""Variational Bayes on the diagonal of R."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, FORGETTING, SOME_PASSES, WITHIN_0_AND_1
from jerkbench.adaptation.linalg import diagonal, factorise, fill_inverse_diagonal, solve
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "variational_bayes")
@dataclass(frozen=True)
class VariationalBayes(Limited):
    """Estimates each variance of R by variational Bayes, as an inverse gamma that is forgotten slowly.

    For each row, alpha = a0 and beta = a0 r_i before its first update, r_i as reported. At each update, with y the
    innovation and HPH' = H P- H'::

        alpha = rho alpha + 1/2,  beta- = rho beta,  beta = beta-
        twice:  R = diag(beta / alpha),  S = HPH' + R,  res = R S^-1 y
                beta = beta- + (res_i^2 + (R - R S^-1 R)_ii) / 2

    R - R S^-1 R is the paper's HPH' - HPH' S^-1 HPH', without its rounding where R is the smaller (after a gap).
    The filter uses the R of the last pass. The reported R enters at the start only: a receiver that knows how good it
    is at each moment is not listened to any more. 1/(1 - rho) is the memory in updates, 55 with the default: good on
    noise that is reported wrongly or changes slowly, late on bursts, misled by a wrong process.

    Source: S. Sarkka, A. Nummenmaa, "Recursive noise adaptive Kalman filtering by variational Bayesian approximations",
    IEEE Trans. Automatic Control 54(3), 596-600, 2009, doi:10.1109/TAC.2008.2008348.

    Attributes:
        forgetting: rho, share of the old knowledge that an update keeps [-].
        start: a0, alpha at the start: the weight of the reported variance, in half updates [-].
        passes: fixed-point passes of an update [-].
    """

    provenance = Provenance("published", "doi:10.1109/TAC.2008.2008348")

    forgetting: Annotated[float, WITHIN_0_AND_1, FORGETTING, DefaultOrigin("literature: rho of the source")] = (
        1.0 - math.exp(-4.0)
    )
    start: Annotated[
        float,
        ABOVE_0,
        Range(0.5, 50.0, log=True, source="ours: the reported R counts from one update to 100"),
        DefaultOrigin("ours: the reported R counts six half updates"),
    ] = 3.0
    passes: Annotated[int, SOME_PASSES, DefaultOrigin("literature: the source finds two enough")] = 2

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 12: alpha and beta of each row."""
        return 12

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal R of the estimated variances."""
        m = len(rows)
        vectors, S, M, room = np.zeros((6, m), R.dtype), HPHt.copy(), np.empty((m, m), R.dtype), R.copy()
        alpha, kept, beta, r, v, inverse = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
        for i in range(m):
            begun, variance = memory[rows[i]], memory[rows[i] + 6]
            alpha[i] = self.forgetting * chosen(begun, 0.0, begun, self.start) + 0.5
            beta[i] = kept[i] = self.forgetting * chosen(begun, 0.0, variance, self.start * R[i, i])
            r[i] = beta[i] / alpha[i]
        for _ in range(self.passes):
            for i in range(m):
                r[i] = beta[i] / alpha[i]
                S[i, i] = HPHt[i, i] + r[i]
            factorise(S, M)
            solve(M, innovation, v)
            fill_inverse_diagonal(M, room, inverse)
            for i in range(m):
                residual = r[i] * v[i]
                beta[i] = kept[i] + 0.5 * (residual * residual + (r[i] - r[i] * r[i] * inverse[i]))
        for i in range(m):
            memory[rows[i]], memory[rows[i] + 6] = alpha[i], beta[i]
        return diagonal(r)
