"""Strong tracking with several fading factors."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, FORGETTING, ONE_OR_MORE, WITHIN_0_AND_1
from jerkbench.adaptation.linalg import AXES
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register

SHARE = Range(0.01, 100.0, log=True, source="ours: a hundredth and a hundred times the share of the position")


@register("adaptation", "strong_tracking")
@dataclass(frozen=True)
class StrongTracking(Limited):
    """Fades each state by a factor of its own, so that the innovations become white again.

    With y the innovation of the rows i that are there and M = F P F' (P the posterior before)::

        v_i = (rho v_i + y_i^2) / (1 + rho),  at the first update of the row y_i^2
        c = sum_i (v_i - beta R_ii - (H Q H')_ii) / sum_i alpha_i (H M H')_ii
        lambda_s = max(1, alpha_s c) of every state s
        P- = Lambda^1/2 M Lambda^1/2 + Q,   Lambda = diag(lambda)

    The shares alpha say beforehand which states are likely to jump. Good where the process is at fault: slips, an
    unmodelled manoeuvre. An outlier of the sensor looks the same to it, and is followed with a gain near 1.

    Source: D. H. Zhou, P. M. Frank, "Strong tracking filtering of nonlinear time-varying stochastic systems with
    coloured noise: application to parameter estimation and empirical robustness analysis", International Journal of
    Control 65(2), 295-307, 1996, doi:10.1080/00207179608921698. Theirs is Lambda F P F' + Q, which is not symmetric; of
    y y' we keep the diagonal. rho = 0.95 is theirs. Their model is nonlinear, ours is not.

    Attributes:
        forgetting: rho, between 0 and 1 [-].
        softening: beta, 1 or more: how much of R the innovations must exceed before anything is faded [-].
        position: alpha of the positions [-].
        velocity: alpha of the velocities [-].
        other: alpha of all states that are not measured [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1080/00207179608921698", "The faded covariance is symmetric; a linear model."
    )

    forgetting: Annotated[float, WITHIN_0_AND_1, FORGETTING, DefaultOrigin("literature: 0.95 in the paper")] = 0.95
    softening: Annotated[
        float,
        ONE_OR_MORE,
        Range(1.0, 20.0, log=True, source="ours: from no softening to innovations of four sigma"),
        DefaultOrigin("ours: no softening"),
    ] = 1.0
    position: Annotated[float, ABOVE_0, SHARE, DefaultOrigin("ours: all states alike")] = 1.0
    velocity: Annotated[float, ABOVE_0, SHARE, DefaultOrigin("ours: all states alike")] = 1.0
    other: Annotated[float, ABOVE_0, SHARE, DefaultOrigin("ours: all states alike")] = 1.0

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 12: v of each row, and whether there is one."""
        return 12

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
        """Return the faded prior covariance."""
        n, excess, scale = len(x), 0.0, 0.0
        for i, row in enumerate(rows):
            square = innovation[i] * innovation[i]
            smooth = (self.forgetting * memory[row] + square) / (1.0 + self.forgetting)
            v = chosen(memory[6 + row], 0.0, smooth, square)
            memory[row], memory[6 + row] = v, 1.0
            excess += v - self.softening * R[i, i] - Q[row, row]
            scale += (self.position if row < 3 else self.velocity) * (P[row, row] - Q[row, row])
        root, faded = np.empty(n, P.dtype), np.zeros((n, n), P.dtype)
        for s in range(n):
            share = self.position if s < 3 else self.velocity if s < 6 else self.other
            root[s] = math.sqrt(max(1.0, share * (excess / scale)))
            for t in range(s % AXES, s + 1, AXES):
                faded[s, t] = faded[t, s] = (P[s, t] - Q[s, t]) * (root[s] * root[t]) + Q[s, t]
        return faded

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged."""
        return R
