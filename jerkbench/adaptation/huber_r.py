"""Huber's weight as a rule on R alone, in one pass."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "huber_r")
@dataclass(frozen=True)
class HuberR(Limited):
    """Inflates the variance of a row in proportion to its innovation, beyond a threshold.

    With y the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        r_i = r_i max(1, |y_i| / (k sqrt(h_i + r_i)))

    Quadratic cost inside k sigma, linear outside: with k = 1.345 it is 95 % as efficient as the plain filter on
    Gaussian noise. An outlier is never dropped, its pull is bounded as long as h_i is small against r_i; a block of
    outliers in a row still moves the filter. Off-diagonals of R stay. One step of reweighting, from the prior.

    Source: P. J. Huber, "Robust estimation of a location parameter", Annals of Mathematical Statistics 35, 73-101,
    1964, doi:10.1214/aoms/1177703732; in Kalman filters e.g. C. D. Karlgaard, H. Schaub, "Huber-based divided
    difference filtering", Journal of Guidance, Control, and Dynamics 30(3), 885-891, 2007. Simplified: the measurement
    alone, row by row, without iterations.

    Attributes:
        threshold: k, in standard deviations of the innovation [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1214/aoms/1177703732", "Weighs the measurement alone, row by row, in one step."
    )

    threshold: Annotated[
        float,
        ABOVE_0,
        Range(0.5, 5.0, log=True, source="ours: from nearly the median to nearly the mean"),
        DefaultOrigin("literature: 95 % efficient on Gaussian noise"),
    ] = 1.345

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of the rows beyond the threshold inflated."""
        adapted = R.copy()
        for i in range(len(rows)):
            distance = abs(innovation[i]) / math.sqrt(HPHt[i, i] + R[i, i])
            adapted[i, i] = R[i, i] * max(1.0, distance / self.threshold)
        return adapted
