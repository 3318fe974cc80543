"""Adaptations that scale R or the prior covariance by one factor."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation.common import UnchangedR
from jerkbench.adaptation.linalg import dot, scaled, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import select
from jerkbench.parameters import AT_LEAST_ONE, DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "scalar_r")
@dataclass(frozen=True)
class ScalarR:
    """Scales R by one factor if the innovation is larger than expected.

    In the following equation, y is the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        if y'y >= sum h + sum r:    R = R (y'y - sum h) / sum r

    If the test triggers, the adapted R satisfies tr S = y'y, with S = H P- H' + R. One faulty axis reduces the weight
    of all other axes. The adaptation `mtf` has a separate factor for each axis.

    Source: single-factor innovation adaptation (A. H. Mohamed and K. P. Schwarz, 1999, doi:10.1007/s001900050236,
    reduced to one scalar), the scalar scheme with which the paper of `jerk` compares its method.
    """

    provenance = Provenance(
        "simplified", "doi:10.1007/s001900050236", "One factor for R, from one innovation, after a trace test."
    )

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, multiplied by the factor if the test triggers."""
        energy, h, r = dot(innovation, innovation), trace(HPHt), trace(R)
        return scaled(R, select(h + r, energy, 1.0, (energy - h) / r))


@register("adaptation", "scalar_q")
@dataclass(frozen=True)
class ScalarQ(UnchangedR, Limited):
    """Scales the prior covariance by one factor if the innovation is larger than expected.

    In the following equation, y is the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        if y'y >= sum h + sum r:    P- = P- min((y'y - sum r) / sum h, limit)

    If the test triggers and the factor is below the limit, the scaled P- satisfies tr S = y'y, with S = H P- H' + R and
    the reported R. The method attributes a large innovation to the process, whereas `scalar_r` attributes a large
    innovation to the sensor. The method works well after a slip or an unmodelled manoeuvre. The method is harmful with
    outliers, because the gain of an outlier is near 1. The factor has a limit, because the factor also inflates the
    covariance of states on which the innovation does not depend.

    Source: fading memory with a suboptimal factor, as in D. H. Zhou, P. M. Frank, "Strong tracking filtering of
    nonlinear time-varying stochastic systems with coloured noise: application to parameter estimation and empirical
    robustness analysis", International Journal of Control 65(2), 295-307, 1996,
    doi:10.1080/00207179608921698. Simplification: one scalar for all states.

    Attributes:
        limit: maximum factor by which the prior covariance is multiplied [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1080/00207179608921698", "One factor for all states, on the prior covariance."
    )

    limit: Annotated[
        float,
        AT_LEAST_ONE,
        Range(1.5, 1e5, log=True, source="ours: from 1.2 to 300 times the sigma of the prior"),
        DefaultOrigin("ours: bounds the covariance of unmeasured states"),
    ] = 1e3

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor by which the prior covariance is multiplied."""
        factor: float = (dot(innovation, innovation) - trace(R)) / trace(HPHt)
        return min(max(factor, 1.0), self.limit)  # factor >= 1 if and only if y'y >= sum h + sum r
