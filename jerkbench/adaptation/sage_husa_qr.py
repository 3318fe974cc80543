"""Sage and Husa on both noises: recursive estimates of R and of Q."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.adaptation._ranges import FORGETTING, SHRINKING
from jerkbench.adaptation.linalg import factorise, forward_rows, solve, submatrix
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError
from jerkbench.parameters import DefaultOrigin, Provenance, Range
from jerkbench.plugins import register

GROWING = Range(10.0, 1e6, log=True, source="ours: from 3 to 1000 times the reported sigma")
COUNT, FADED, RATIOS = 6, 12, 20
"""Where in the memory are k and b^k of each row; 18 and 19 are those of Q; then come its ratios."""


@register("adaptation", "sage_husa_qr")
@dataclass(frozen=True)
class SageHusaBoth:
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

    forgetting: Annotated[float, FORGETTING, DefaultOrigin("literature: 0.95 to 0.99 is usual")] = 0.97
    low: Annotated[float, SHRINKING, DefaultOrigin("ours: keeps R and Q positive")] = 0.1
    high: Annotated[float, GROWING, DefaultOrigin("ours: a hundred times the reported sigma")] = 1e4
    high_process: Annotated[float, GROWING, DefaultOrigin("ours: ten times the sigma of the model")] = 1e2

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.forgetting < 1:
            raise PluginError(f"sage_husa_qr.forgetting is {self.forgetting}; it must lie between 0 and 1.")
        if not 0 < self.low <= min(self.high, self.high_process):
            raise PluginError(
                f"sage_husa_qr needs 0 < low <= high and high_process; they are {self.low}, {self.high} and"
                f" {self.high_process}."
            )

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
        if memory[18] == 0:
            memory[RATIOS:] = 1.0
        root, prior = np.sqrt(memory[RATIOS:]), np.empty(P.shape)
        for s in range(len(P)):
            for t in range(len(P)):
                prior[s, t] = P[s, t] - Q[s, t] + Q[s, t] * (root[s] * root[t])
        for i, row in enumerate(rows):
            r, d = R[i, i], _share(memory, COUNT + row, FADED + row, self.forgetting)
            estimate = (1.0 - d) * memory[row] + d * (innovation[i] ** 2 - prior[row, row])
            memory[row] = r if d == 1.0 else min(max(estimate, self.low * r), self.high * r)
        step, posterior = _update_of(prior, innovation, memory[rows], rows)
        d = _share(memory, 18, 19, self.forgetting)
        for s in range(len(x)):
            if d < 1.0 and Q[s, s] > 0:
                seen = (step[s] ** 2 + posterior[s] - P[s, s] + Q[s, s]) / Q[s, s]
                ratio = (1.0 - d) * memory[RATIOS + s] + d * seen
                memory[RATIOS + s] = min(max(ratio, self.low), self.high_process)
        return prior

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal R of the estimated variances."""
        return np.diag(memory[rows])


def _share(memory: FloatArray, count: int, faded: int, forgetting: float) -> float:
    """Return d of the k-th update, 1 at the first, and count it; b^k is faster to remember than to raise."""
    k, power = memory[count], memory[faded] if memory[count] > 0 else 1.0
    memory[count], memory[faded] = k + 1.0, power * forgetting
    return float((1.0 - forgetting) / (1.0 - power * forgetting))


def _update_of(P: FloatArray, innovation: FloatArray, r: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return d (n,) and the variances (n,) of P - P H' (H P H' + R)^-1 H P, R = diag(``r``)."""
    m, n = len(rows), len(P)
    S, M, W, v = submatrix(P, rows), np.empty((m, m)), np.empty((m, n)), np.empty(m)
    step, posterior = np.zeros(n), np.empty(n)
    for i in range(m):
        S[i, i] += r[i]
        for s in range(n):
            W[i, s] = P[rows[i], s]
    factorise(S, M)
    solve(M, innovation, v)
    for i in range(m):
        for s in range(n):
            step[s] += W[i, s] * v[i]
    forward_rows(M, W, W)  # P H' S^-1 H P = (L^-1 H P)' D^-1 L^-1 H P
    for s in range(n):
        posterior[s] = P[s, s]
        for i in range(m):
            posterior[s] -= W[i, s] * M[i, i] * W[i, s]
    return step, posterior
