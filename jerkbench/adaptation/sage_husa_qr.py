"""Sage and Husa on both noises: recursive estimates of R and of Q."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import FORGETTING, SHRINKING, WITHIN_0_AND_1, check_order
from jerkbench.adaptation.linalg import AXES, diagonal, factorise, forward_rows, solve
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register

GROWING = Range(10.0, 1e6, log=True, source="ours: from 3 to 1000 times the reported sigma")
COUNT, FADED, RATIOS = 6, 12, 20
"""Where in the memory are k and b^k of each row; 18 and 19 are those of Q; then come its ratios."""


@register("adaptation", "sage_husa_qr")
@dataclass(frozen=True)
class SageHusaBoth(Limited):
    """Estimates the variances of R and of Q recursively, with fading memory.

    At the k-th update, with y the innovation and d = (1 - b) / (1 - b^(k+1))::

        P~ = F P+ F' + G^1/2 Q G^1/2,   G = diag(g)                   Q of the model, P+ of the update before
        rh_i = clip((1 - d) rh_i + d (y_i^2 - (H P~ H')_ii), lo r_i, hi r_i),   R = diag(rh)
        K, P+ of the usual update with both
        g_s = clip((1 - d) g_s + d ((K y)_s^2 + (P+ - F P+ F')_ss) / Q_ss, lo, hi)    for the next update

    with g = 1 and rh = r at the start, k = 0, which changes nothing. Where a row is not there its rh waits. The two
    estimates see the same innovation: which of them grows is decided by H P~ H' against R, and a slow error of the one
    is easily taken for the other. With lo = hi = 1 it is `none` but for off-diagonals of R. R alone: `sage_husa`.

    Source: A. P. Sage and G. W. Husa, "Adaptive filtering with unknown prior statistics", Joint Automatic Control
    Conference 1969, 760-769 (no DOI). Theirs estimates the means too, and a full Q, which soon is no covariance; ours
    is one factor for each state, because the steps between updates are not equally long; the bounds keep both positive.

    Attributes:
        forgetting: b, between 0 and 1 [-].
        low: lo, lower bound as a multiple of the reported variance, and of Q [-].
        high: hi, upper bound of R as a multiple of the reported variance [-].
        high_process: hi of Q [-].
    """

    provenance = Provenance(
        "own", "Sage and Husa, 1969", "Their recursion for the diagonal of R; for Q, one factor for each state."
    )

    forgetting: Annotated[float, WITHIN_0_AND_1, FORGETTING, DefaultOrigin("literature: 0.95 to 0.99 is usual")] = 0.97
    low: Annotated[float, SHRINKING, DefaultOrigin("ours: keeps R and Q positive")] = 0.1
    high: Annotated[float, GROWING, DefaultOrigin("ours: a hundred times the reported sigma")] = 1e4
    high_process: Annotated[float, GROWING, DefaultOrigin("ours: ten times the sigma of the model")] = 1e2

    lanes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_order(self, "low", "high")
        check_order(self, "low", "high_process")

    def memory_size_of(self, states: int) -> int:
        """Return the length of rh, k and b^k of each row, k and b^k of Q, and g of each state."""
        return RATIOS + states

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
        """Return P~; estimate R for `adapt`, and Q for the next update."""
        n, m = len(P), len(rows)
        prior, root, r = np.zeros(P.shape, P.dtype), np.empty(n, P.dtype), np.empty(m, P.dtype)
        for s in range(n):
            memory[RATIOS + s] = chosen(memory[18], 0.0, memory[RATIOS + s], 1.0)
            root[s] = math.sqrt(memory[RATIOS + s])
        for s in range(n):
            for t in range(s % AXES, n, AXES):
                prior[s, t] = P[s, t] - Q[s, t] + Q[s, t] * (root[s] * root[t])
        for i in range(m):
            row, reported = rows[i], R[i, i]
            d = _share(memory, COUNT + row, FADED + row, self.forgetting)
            estimate = (1.0 - d) * memory[row] + d * (innovation[i] * innovation[i] - prior[row, row])
            clipped = min(max(estimate, self.low * reported), self.high * reported)
            r[i] = chosen(1.0, d, clipped, reported)
            memory[row] = r[i]
        step, posterior = _update_of(prior, innovation, r, rows)
        d = _share(memory, 18, 19, self.forgetting)
        for s in range(n):
            noise = chosen(Q[s, s], 0.0, Q[s, s], 1.0)
            seen = (step[s] * step[s] + posterior[s] - P[s, s] + Q[s, s]) / noise
            ratio = min(max((1.0 - d) * memory[RATIOS + s] + d * seen, self.low), self.high_process)
            memory[RATIOS + s] = chosen(min(1.0 - d, Q[s, s]), 0.0, ratio, memory[RATIOS + s])
        return prior

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal R of the estimated variances."""
        r = np.empty(len(rows), R.dtype)
        for i in range(len(rows)):
            r[i] = memory[rows[i]]
        return diagonal(r)


def _share(memory: FloatArray, count: int, faded: int, forgetting: float) -> float:
    """Return d of the k-th update, 1 at the first, and count it; b^k is faster to remember than to raise."""
    k, power = memory[count], chosen(memory[count], 0.0, memory[faded], 1.0)
    memory[count], memory[faded] = k + 1.0, power * forgetting
    return (1.0 - forgetting) / (1.0 - power * forgetting)


def _update_of(P: FloatArray, innovation: FloatArray, r: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return d (n,) and the variances (n,) of P - P H' (H P H' + R)^-1 H P, R = diag(``r``)."""
    m, n = len(rows) // AXES, len(P) // AXES
    matrices, vectors, W = np.empty((2, m, m), P.dtype), np.empty((2, m), P.dtype), np.empty((m, n), P.dtype)
    S, M, y, v = matrices[0], matrices[1], vectors[0], vectors[1]
    step, posterior = np.zeros(len(P), P.dtype), np.empty(len(P), P.dtype)
    for a in range(AXES):
        for i in range(m):
            row = a + AXES * i
            for j in range(m):
                S[i, j] = P[rows[row], rows[a + AXES * j]]
            S[i, i] += r[row]
            y[i] = innovation[row]
            for s in range(n):
                W[i, s] = P[rows[row], a + AXES * s]
        factorise(S, M)
        solve(M, y, v)
        for s in range(n):
            for i in range(m):
                step[a + AXES * s] += W[i, s] * v[i]
        forward_rows(M, W, W)  # P H' S^-1 H P = (L^-1 H P)' D^-1 L^-1 H P
        for s in range(n):
            left = P[a + AXES * s, a + AXES * s]
            for i in range(m):
                left -= W[i, s] * M[i, i] * W[i, s]
            posterior[a + AXES * s] = left
    return step, posterior
