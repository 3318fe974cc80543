"""The recursive estimators by Sage and Husa, for R only or for R and Q."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import FORGETTING, SHRINKING, check_order
from jerkbench.adaptation.linalg import factorise, forward_rows, solve
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import select
from jerkbench.kalman import submatrix
from jerkbench.parameters import BETWEEN_0_AND_1, DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register

GROWING = Range(10.0, 1e6, log=True, source="ours: from 3 to 1000 times the reported sigma")

COUNT, FADED, Q_FACTORS = 6, 12, 20
"""Start indices in the memory: k of the rows, b^k of the rows, factors g of Q. Elements 18 and 19: k and b^k of Q."""


@register("adaptation", "sage_husa")
@dataclass(frozen=True)
class SageHusa(Limited):
    """Estimates each variance of R recursively from the innovations, with a fading memory.

    In the following equations of the k-th update of row i, y is the innovation, h_i = (H P- H')_ii, r_i is the reported
    variance and rh_i is the estimate::

        d = (1 - b) / (1 - b^(k+1))
        rh_i = clip((1 - d) rh_i + d (y_i^2 - h_i), lo r_i, hi r_i);    R = diag(rh)

    At the first update (k = 0), the estimate is the reported variance. The memory length of the estimate is about 1/(1
    - b) updates. The method works well on long-lasting changes of the noise, but reacts too late to short changes. If
    the process model is wrong, the estimated R is also wrong.

    Source: A. P. Sage and G. W. Husa, "Adaptive filtering with unknown prior statistics", Joint Automatic Control
    Conference 1969, 760-769 (no DOI). The bounds are an addition that ensures a positive R.

    Attributes:
        forgetting: b, forgetting factor of the estimated variance, between 0 and 1 [-].
        low: lo, lower bound of the estimated variance as a multiple of the reported variance [-].
        high: hi, upper bound of the estimated variance as a multiple of the reported variance [-].
    """

    provenance = Provenance(
        "simplified", "Sage and Husa, 1969", "Only the diagonal of R, within bounds; neither the means nor Q."
    )

    forgetting: Annotated[float, BETWEEN_0_AND_1, FORGETTING, DefaultOrigin("literature: 0.95 to 0.99")] = 0.97
    low: Annotated[float, SHRINKING, DefaultOrigin("ours: ensures a positive R")] = 0.1
    high: Annotated[float, GROWING, DefaultOrigin("ours: a hundred times the reported sigma")] = 1e4

    lanes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self, "low", "high")

    def memory_size(self) -> int:
        """Return 18, because the memory stores rh, k and b^k of each of the six rows."""
        return 18

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal matrix R of the estimated variances."""
        adapted = np.zeros(R.shape, R.dtype)
        for i, row in enumerate(rows):
            variance = innovation[i] * innovation[i] - HPHt[i, i]
            adapted[i, i] = _estimate(memory, row, variance, R[i, i], self.low, self.high, self.forgetting)
        return adapted


@register("adaptation", "sage_husa_qr")
@dataclass(frozen=True)
class SageHusaBoth(Limited):
    """Estimates the variances of R and Q recursively from the innovations, with a fading memory.

    In the following equations of the k-th update, y is the innovation and d = (1 - b) / (1 - b^(k+1))::

        P~ = F P+ F' + G^1/2 Q G^1/2,   G = diag(g)                   Q of the model, P+ of the previous update
        rh_i = clip((1 - d) rh_i + d (y_i^2 - (H P~ H')_ii), lo r_i, hi r_i),   R = diag(rh)
        K, P+ of the Kalman update with P~ and R
        g_s = clip((1 - d) g_s + d ((K y)_s^2 + (P+ - F P+ F')_ss) / Q_ss, lo, hi)    for the next update

    At the start (k = 0), the factors g are 1, and the estimates rh are equal to the reported variances r. If a row is
    not measured, the estimate rh of this row does not change. The estimates of R and Q use the same innovation, and the
    ratio of H P~ H' to R determines whether R or Q increases. The method cannot reliably distinguish slow errors of the
    process from slow errors of the measurement. With lo = hi = 1, the method is equivalent to `none`, except that R is
    diagonal. The adaptation `sage_husa` estimates only R.

    Source: A. P. Sage and G. W. Husa, "Adaptive filtering with unknown prior statistics", Joint Automatic Control
    Conference 1969, 760-769 (no DOI). The source also estimates the means, and a full Q, which often becomes
    indefinite. Here Q has one factor for each state, because the times between updates differ, and the bounds ensure
    positive variances.

    Attributes:
        forgetting: b, forgetting factor of the estimates of R and Q, between 0 and 1 [-].
        low: lo, lower bound of the estimates, as a multiple of the reported variance (for R) and of the Q of the model
            (for Q) [-].
        high: hi for R, upper bound of the estimated variance as a multiple of the reported variance [-].
        high_process: hi for Q, upper bound of the estimated Q as a multiple of the Q of the model [-].
    """

    provenance = Provenance(
        "own", "Sage and Husa, 1969", "The recursion of the source for the diagonal of R; for Q, one factor per state."
    )

    forgetting: Annotated[float, BETWEEN_0_AND_1, FORGETTING, DefaultOrigin("literature: 0.95 to 0.99")] = 0.97
    low: Annotated[float, SHRINKING, DefaultOrigin("ours: ensures a positive R and Q")] = 0.1
    high: Annotated[float, GROWING, DefaultOrigin("ours: a hundred times the reported sigma")] = 1e4
    high_process: Annotated[float, GROWING, DefaultOrigin("ours: ten times the sigma of the model")] = 1e2

    lanes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self, "low", "high")
        check_order(self, "low", "high_process")

    def memory_size_of(self, states: int) -> int:
        """Return the memory length for rh, k and b^k of each row, for k and b^k of Q, and for g of each state."""
        return Q_FACTORS + states

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
        """Return P~, store the estimate of R for `adapt`, and store the estimate of Q for the next update."""
        n, m = len(P), len(rows)
        prior, root, r = np.empty(P.shape, P.dtype), np.empty(n, P.dtype), np.empty(m, P.dtype)
        for s in range(n):
            memory[Q_FACTORS + s] = select(memory[18], 0.0, memory[Q_FACTORS + s], 1.0)
            root[s] = math.sqrt(memory[Q_FACTORS + s])
        for s in range(n):
            for t in range(n):
                prior[s, t] = P[s, t] - Q[s, t] + Q[s, t] * (root[s] * root[t])
        for i in range(m):
            variance = innovation[i] * innovation[i] - prior[rows[i], rows[i]]
            r[i] = _estimate(memory, rows[i], variance, R[i, i], self.low, self.high, self.forgetting)
        step, posterior = _update_of(prior, innovation, r, rows)
        d = _fraction(memory, 18, 19, self.forgetting)
        for s in range(n):
            noise = select(Q[s, s], 0.0, Q[s, s], 1.0)
            ratio = (step[s] * step[s] + posterior[s] - P[s, s] + Q[s, s]) / noise
            factor = min(max((1.0 - d) * memory[Q_FACTORS + s] + d * ratio, self.low), self.high_process)
            memory[Q_FACTORS + s] = select(min(1.0 - d, Q[s, s]), 0.0, factor, memory[Q_FACTORS + s])
        return prior

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal matrix R of the estimated variances."""
        adapted = np.zeros(R.shape, R.dtype)
        for i, row in enumerate(rows):
            adapted[i, i] = memory[row]
        return adapted


def _estimate(memory: FloatArray, row: int, variance: float, r: float, low: float, high: float, b: float) -> float:
    """Update and return the estimate rh of a row, where ``variance`` is y^2 - h and ``r`` is the reported variance."""
    d = _fraction(memory, COUNT + row, FADED + row, b)
    clipped = min(max((1.0 - d) * memory[row] + d * variance, low * r), high * r)
    memory[row] = estimate = select(1.0, d, clipped, r)  # at the first update, d = 1
    return estimate


def _fraction(memory: FloatArray, count: int, faded: int, forgetting: float) -> float:
    """Return the factor d of the k-th update, increment k, and store b^k, because a power is slow to compute."""
    k, power = memory[count], select(memory[count], 0.0, memory[faded], 1.0)
    memory[count], memory[faded] = k + 1.0, power * forgetting
    return (1.0 - forgetting) / (1.0 - power * forgetting)


def _update_of(P: FloatArray, innovation: FloatArray, r: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return K y (n,) and the diagonal (n,) of P - P H' (H P H' + R)^-1 H P, where R = diag(``r``)."""
    m, n = len(rows), len(P)
    S, M, W, v = submatrix(P, rows), np.empty((m, m), P.dtype), np.empty((m, n), P.dtype), np.empty(m, P.dtype)
    step, posterior = np.zeros(n, P.dtype), np.empty(n, P.dtype)
    for i in range(m):
        S[i, i] += r[i]
        for s in range(n):
            W[i, s] = P[rows[i], s]
    factorise(S, M)
    solve(M, innovation, v)
    for s in range(n):
        for i in range(m):
            step[s] += W[i, s] * v[i]
    forward_rows(M, W, W)
    for s in range(n):
        posterior[s] = P[s, s]
        for i in range(m):
            posterior[s] -= W[i, s] * M[i, i] * W[i, s]
    return step, posterior
