"""Scaling of R by fuzzy rules."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0
from jerkbench.adaptation.linalg import dot, scaled, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "fuzzy")
@dataclass(frozen=True)
class Fuzzy(Limited):
    """Scales R by fuzzy rules on the smoothed ratio of the squared innovation to its expected value.

    In the following equations of an update, y is the innovation, h_i = (H P- H')_ii, r_i = R_ii, and rho starts at 1::

        rho = s rho + (1 - s) y'y / (sum h + sum r)
        small = clip(2 - rho, 0, 1),  large = clip((rho - 2) / 4, 0, 1)
        R = R (small + medium (1 - small - large) + large_factor large)

    With the default factors, R does not change for rho <= 1. R is multiplied by 4 at rho = 2 and by 25 for rho >= 6.
    The factor is a continuous function of rho. With the default smoothing, each update halves the effect of previous
    innovations on rho. All measured axes have the same factor, so one faulty axis reduces the weight of the other axes.
    The sums add squares of metres (position) to squares of metres per second (velocity). The adaptation has a single
    rho, even if different updates measure different quantities.

    Source: fuzzy adaptation of R by the degree of mismatch, after P. J. Escamilla-Ambrosio, N. Mort, "Multisensor data
    fusion architecture based on adaptive Kalman filters and fuzzy logic performance assessment", Fusion 2002.
    Simplification: the method has only three rules, for one ratio.

    Attributes:
        smoothing: s, weight of the previous value of rho, at least 0 and below 1 [-].
        medium: factor by which the rule "medium" multiplies R [-].
        large: factor by which the rule "large" multiplies R [-].
    """

    provenance = Provenance(
        "simplified", "Escamilla-Ambrosio and Mort, 2002", "Three rules on one ratio, and one factor for all of R."
    )

    smoothing: Annotated[
        float,
        Limit(lambda share: 0 <= share < 1, "it must be from 0 to below 1."),
        Range(0.0, 0.95, source="ours: from no memory to one of 20 updates"),
        DefaultOrigin("ours"),
    ] = 0.5
    medium: Annotated[
        float,
        ABOVE_0,
        Range(1.0, 20.0, log=True, source="ours: from no inflation to 4.5 sigma"),
        DefaultOrigin("ours: twice the sigma"),
    ] = 4.0
    large: Annotated[
        float,
        ABOVE_0,
        Range(2.0, 1000.0, log=True, source="ours: from 1.4 to 30 sigma"),
        DefaultOrigin("ours: five times the sigma"),
    ] = 25.0

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 1, because the memory stores rho - 1, which is zero at the start."""
        return 1

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, multiplied by one factor that depends on rho."""
        ratio = dot(innovation, innovation) / (trace(HPHt) + trace(R))
        rho = self.smoothing * (memory[0] + 1.0) + (1.0 - self.smoothing) * ratio
        memory[0] = rho - 1.0
        small = min(max(2.0 - rho, 0.0), 1.0)
        large = min(max((rho - 2.0) / 4.0, 0.0), 1.0)
        factor = small + self.medium * (1.0 - small - large) + self.large * large
        return scaled(R, factor)
