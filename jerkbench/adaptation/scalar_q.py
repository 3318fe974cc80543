"""A common factor on the whole of the prior covariance."""

from dataclasses import dataclass
from typing import Annotated

from jerkbench.adaptation._ranges import ONE_OR_MORE
from jerkbench.adaptation.linalg import dot, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "scalar_q")
@dataclass(frozen=True)
class ScalarQ(Limited):
    """Scales the whole prior covariance by one factor when the innovation is larger than expected.

    With y the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        if y'y >= sum h + sum r:    P- = P- min((y'y - sum r) / sum h, limit)

    Unless the limit acts, tr S = y'y afterwards, R as reported. It blames the process for what `scalar_r` blames the
    sensor for: good after a slip or an unmodelled manoeuvre, bad on outliers, which it lets in with a gain near 1. All
    states are inflated, also those that the innovation says nothing of, hence the limit.

    Source: fading memory with a suboptimal factor, as in D. H. Zhou, P. M. Frank, "Strong tracking filtering of
    nonlinear time-varying stochastic systems with coloured noise: application to parameter estimation and empirical
    robustness analysis", International Journal of Control 65(2), 295-307, 1996,
    doi:10.1080/00207179608921698; reduced to one scalar for all states.

    Attributes:
        limit: largest factor on the prior covariance [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1080/00207179608921698", "One factor for all states, on the whole prior covariance."
    )

    limit: Annotated[
        float,
        ONE_OR_MORE,
        Range(1.5, 1e5, log=True, source="ours: from 1.2 to 300 times the prior's sigma"),
        DefaultOrigin("ours: keeps unmeasured states within bounds"),
    ] = 1e3

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor on the prior covariance."""
        factor: float = (dot(innovation, innovation) - trace(R)) / trace(HPHt)
        return min(max(factor, 1.0), self.limit)  # 1 or more just where y'y >= sum h + sum r

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged."""
        return R
