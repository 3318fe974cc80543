"""The strong tracking filter with multiple fading factors."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, FORGETTING
from jerkbench.adaptation.common import UnchangedR
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import select
from jerkbench.parameters import AT_LEAST_ONE, BETWEEN_0_AND_1, DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register

ALPHA = Range(0.01, 100.0, log=True, source="ours: 0.01 to 100 times the alpha of the position")


@register("adaptation", "strong_tracking")
@dataclass(frozen=True)
class StrongTracking(UnchangedR, Limited):
    """Inflates the prior covariance of each state by a fading factor, so that the innovations become white.

    In the following equations, y is the innovation of the measured rows i, and M = F P F' is computed from the previous
    posterior P::

        v_i = (rho v_i + y_i^2) / (1 + rho),  at the first update of the row y_i^2
        c = sum_i (v_i - beta R_ii - (H Q H')_ii) / sum_i alpha_i (H M H')_ii
        lambda_s = max(1, alpha_s c) of every state s
        P- = Lambda^1/2 M Lambda^1/2 + Q,   Lambda = diag(lambda)

    The weights alpha specify which states are likely to change abruptly. The method works well on errors of the process
    model, such as a slip or an unmodelled manoeuvre. The method cannot distinguish errors of the process model from
    outliers of a sensor, and gives outliers a gain near 1.

    Source: D. H. Zhou, P. M. Frank, "Strong tracking filtering of nonlinear time-varying stochastic systems with
    coloured noise: application to parameter estimation and empirical robustness analysis", International Journal of
    Control 65(2), 295-307, 1996, doi:10.1080/00207179608921698. The source uses Lambda F P F' + Q, which is not
    symmetric, and a nonlinear model. Here the model is linear, and only the diagonal of y y' is used. rho = 0.95 is the
    value of the source.

    Attributes:
        forgetting: rho, forgetting factor of the mean v of the squared innovations, between 0 and 1 [-].
        softening: beta, softening factor of at least 1. Larger values of beta reduce the fading factors [-].
        position: weight alpha of the position states [-].
        velocity: weight alpha of the velocity states [-].
        other: weight alpha of all states that are not measured [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1080/00207179608921698", "The faded covariance is symmetric; a linear model."
    )

    forgetting: Annotated[float, BETWEEN_0_AND_1, FORGETTING, DefaultOrigin("literature: 0.95 in the paper")] = 0.95
    softening: Annotated[
        float,
        AT_LEAST_ONE,
        Range(1.0, 20.0, log=True, source="ours: from no softening to innovations of four sigma"),
        DefaultOrigin("ours: no softening"),
    ] = 1.0
    position: Annotated[float, ABOVE_0, ALPHA, DefaultOrigin("ours: equal for all states")] = 1.0
    velocity: Annotated[float, ABOVE_0, ALPHA, DefaultOrigin("ours: equal for all states")] = 1.0
    other: Annotated[float, ABOVE_0, ALPHA, DefaultOrigin("ours: equal for all states")] = 1.0

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 12, because the memory stores v of each row and whether the row has had an update."""
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
        """Return the prior covariance, multiplied by the fading factors."""
        n, excess, scale = len(x), 0.0, 0.0
        for i, row in enumerate(rows):
            square = innovation[i] * innovation[i]
            smooth = (self.forgetting * memory[row] + square) / (1.0 + self.forgetting)
            v = select(memory[6 + row], 0.0, smooth, square)
            memory[row], memory[6 + row] = v, 1.0
            excess += v - self.softening * R[i, i] - Q[row, row]
            scale += (self.position if row < 3 else self.velocity) * (P[row, row] - Q[row, row])
        root, faded = np.empty(n, P.dtype), np.empty((n, n), P.dtype)
        for s in range(n):
            alpha = self.position if s < 3 else self.velocity if s < 6 else self.other
            root[s] = math.sqrt(max(1.0, alpha * (excess / scale)))
            for t in range(s + 1):
                faded[s, t] = faded[t, s] = (P[s, t] - Q[s, t]) * (root[s] * root[t]) + Q[s, t]
        return faded
