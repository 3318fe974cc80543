"""A common factor on the whole of R."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.adaptation.linalg import dot, scaled, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("adaptation", "scalar_r")
@dataclass(frozen=True)
class ScalarR:
    """Scales the whole of R by one factor when the innovation is larger than expected.

    With y the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        if y'y >= sum h + sum r:    R = R (y'y - sum h) / sum r

    After it tr S = y'y. One bad axis makes all the others worse: the "all or nothing" that multiple factors avoid.

    Source: single-factor innovation adaptation (A. H. Mohamed and K. P. Schwarz, 1999, doi:10.1007/s001900050236,
    reduced to one scalar), the scalar scheme that the paper compares with.
    """

    provenance = Provenance(
        "simplified", "doi:10.1007/s001900050236", "One factor for all of R, from one innovation, behind a trace test."
    )

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, scaled as a whole where the test triggers."""
        energy, h, r = dot(innovation, innovation), trace(HPHt), trace(R)
        return scaled(R, chosen(h + r, energy, 1.0, (energy - h) / r))
