"""The three-part weight IGG-III."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import check_order
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "igg3")
@dataclass(frozen=True)
class Igg3(Limited):
    """Keeps, weakens or drops each row by how large its innovation is.

    With v = |y_i| / sqrt(S_ii), S = H P- H' + R::

        w = 1                                    v <= k0
        w = (k0 / v) ((k1 - v) / (k1 - k0))^2    k0 < v <= k1
        w = 0                                    k1 < v

        R_ii = R_ii / w;  w = 0 drops the row

    Off-diagonals of R stay. The weight falls to zero, so that a gross outlier has no pull at all, unlike Huber's; a
    filter that is off by more than k1 sigma for another reason drops every measurement and finds no way back.

    Source: Y. Yang, L. Song, T. Xu, "Robust estimator for correlated observations based on bifactor equivalent
    weights", Journal of Geodesy 76, 353-358, 2002: the weight function. The innovation stands for the residual of an
    adjustment, row by row, without iterations. Ours, k0 = 2 and k1 = 6, are wider than the usual 1.5 and 4.

    Attributes:
        keep: k0, up to here a row keeps its weight, in standard deviations of the innovation [-].
        drop: k1, beyond it a row is dropped, in standard deviations of the innovation [-].
    """

    provenance = Provenance(
        "simplified",
        "Yang, Song and Xu, 2002",
        "The innovation in place of a residual, row by row, without iterations.",
    )

    keep: Annotated[
        float,
        Range(1.0, 3.5, source="literature: 1.5 to 3 is usual; a little more on either side"),
        DefaultOrigin("ours, wider than the usual 1.5, which cost 7 % where nothing is wrong"),
    ] = 2.0
    drop: Annotated[
        float,
        Range(4.0, 15.0, log=True, source="literature: 3 to 8 is usual; above the largest k0, and beyond"),
        DefaultOrigin("ours, wider than the usual 4"),
    ] = 6.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_order(self, "keep", "drop", equal=False)

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with the variances of doubtful rows inflated, and infinite ones in the rows that are dropped."""
        adapted = R.copy()
        for i in range(len(rows)):
            v = abs(innovation[i]) / math.sqrt(HPHt[i, i] + R[i, i])
            steep = (self.drop - self.keep) / chosen(self.drop, v, self.drop - v, 1.0)
            inflated = chosen(v, self.keep, R[i, i] * (v / self.keep) * (steep * steep), R[i, i])
            adapted[i, i] = chosen(self.drop, v, inflated, math.inf)
        return adapted
