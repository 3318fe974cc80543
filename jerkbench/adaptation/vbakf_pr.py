"""Variational Bayes on the prior covariance and on R."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, FORGETTING, SOME_PASSES
from jerkbench.adaptation.common import Measured, fill_blend, fill_square, innovate, measured_of, spread_part
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register

SETS, SLOT = 64, 37
"""Sets of rows that may be there; numbers that are remembered of each: u, and U (36)."""

EVIDENCE = Range(1.0, 100.0, log=True, source="ours: from one update's worth of evidence to a hundred")


@register("adaptation", "vbakf_pr")
@dataclass(frozen=True)
class VariationalPriorAndNoise(Limited):
    """Estimates the prior covariance and R together by variational Bayes, both as inverse Wishart.

    With n states and m rows, t = n + tau + 1, T = tau P-, and for each set of rows that comes together u and U, at its
    first update u = m + 1 + tau_R and U = tau_R R as reported::

        u = rho (u - m - 1) + m + 1,  U = rho U
        N times, from x = x- and P = P-:
            A = P + (x - x-)(x - x-)',                  t' = t + 1,  T' = T + A
            B = (z - H x)(z - H x)' + H P H',           u' = u + 1,  U' = U + B
            P~ = T' / (t' - n - 1),  R~ = U' / (u' - m - 1),  then the usual update for x and P
        u = u',  U = U'

    R is full, and the reported one enters at the start only; 1/(1 - rho) is its memory in updates. P- is believed anew
    each time, with the weight tau: of Q nothing is learnt that lasts. Good on noise that is reported wrongly or changes
    slowly; single outliers are averaged, not rejected.

    Source: Y. Huang, Y. Zhang, Z. Wu, N. Li, J. A. Chambers, "A novel adaptive Kalman filter with inaccurate process
    and measurement noise covariance matrices", IEEE Trans. Automatic Control 63(2), 594-601, 2018,
    doi:10.1109/TAC.2017.2730480. Theirs are tau = 3, rho = 1 - exp(-4) and N = 10, as ours; a memory for each set of
    rows, because position and velocity come apart, and tau_R are ours.

    Attributes:
        tau: weight of P- [updates' worth of evidence].
        start: tau_R, weight of the reported R at the start, likewise.
        forgetting: rho, share of the old knowledge of R that an update keeps [-].
        passes: N, of an update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TAC.2017.2730480", "One memory of R for each set of rows that comes together."
    )

    tau: Annotated[float, ABOVE_0, EVIDENCE, DefaultOrigin("literature: 3 in the paper")] = 3.0
    start: Annotated[float, ABOVE_0, EVIDENCE, DefaultOrigin("ours: as much as the prior")] = 3.0
    forgetting: Annotated[
        float,
        Limit(lambda share: 0 < share <= 1, "it must be above 0 and at most 1."),
        FORGETTING,
        DefaultOrigin("literature: 1 - exp(-4) in the paper"),
    ] = 1.0 - math.exp(-4.0)
    passes: Annotated[int, SOME_PASSES, DefaultOrigin("literature: 10 in the paper")] = 10

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return the length of u and U of each set of rows."""
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
        """Return P~, and keep u and U in the memory."""
        m, slot = len(rows), SLOT * _set_of(rows)
        known = memory[slot : slot + SLOT]
        begun, U, part = known[0], np.empty((m, m), R.dtype), measured_of(P, R.copy(), rows)
        u = self.forgetting * chosen(begun, 0.0, begun - m - 1.0, self.start)  # less m + 1
        for i in range(m):
            for j in range(m):
                U[i, j] = self.forgetting * chosen(begun, 0.0, known[1 + m * i + j], self.start * R[i, j])
        N, gathered = part.W.copy(), np.empty((m, m), R.dtype)
        for k in range(self.passes):
            if k > 0:
                innovate(part, innovation, 1.0, 1.0)
                fill_square(part, 1.0)
            _gather(part, innovation, U, gathered)
            fill_blend(part.W, N, self.tau, part.D, 1.0)
            by_u = 1.0 / (u + 1.0)
            for i in range(m):
                for j in range(m):
                    part.R[i, j] = gathered[i, j] * by_u
        known[0] = u + m + 2.0
        for i in range(m):
            for j in range(m):
                known[1 + m * i + j] = gathered[i, j]
        return spread_part(P, rows, N, part.W, 1.0)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R~ of the last pass."""
        m, slot = len(rows), SLOT * _set_of(rows)
        Rt = np.empty((m, m), R.dtype)
        for i in range(m):
            for j in range(m):
                Rt[i, j] = memory[slot + 1 + m * i + j] / (memory[slot] - m - 1.0)
        return Rt


def _gather(part: Measured, innovation: FloatArray, U: FloatArray, gathered: FloatArray) -> None:
    """Fill U' = U + B, where H P H' is that of D_x less its step; symmetric to the bit, as an R has to be."""
    step = part.step
    for i in range(len(step)):
        for j in range(i + 1):
            square = (innovation[i] - step[i]) * (innovation[j] - step[j])
            gathered[i, j] = gathered[j, i] = U[i, j] + (part.D[i, j] - step[i] * step[j]) + square


def _set_of(rows: IntArray) -> int:
    """Return the number of a set of rows."""
    number = 0
    for row in rows:
        number += 2**row
    return number
