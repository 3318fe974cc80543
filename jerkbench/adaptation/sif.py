"""The sliding innovation filter."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0
from jerkbench.adaptation.linalg import AXES
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "sif")
@dataclass(frozen=True)
class SlidingInnovation(Limited):
    """Takes a gain from the size of the innovation alone: small ones in part, large ones whole.

    With y the innovation and delta_i = k sqrt(R_ii) the width of the sliding layer::

        K = H^+ diag(min(1, |y_i| / delta_i)),   P = (I - K H) P- (I - K H)' + K R K'

    H^+ is the pseudo-inverse of H: states that are not measured get no gain, and wander with their model; a filter with
    a bias or a jerk to be found does not find it. The gain does not ask how good the prior is. Made for models that are
    wrong, not for outliers: these are the large innovations that it takes whole.

    Source: S. A. Gadsden, M. Al-Shabi, "The sliding innovation filter", IEEE Access 8, 96129-96138, 2020,
    doi:10.1109/ACCESS.2020.2995345. Their delta is a length of each measurement, tuned by trial; ours is in standard
    deviations of the reported R, which need not be tuned anew for each receiver.

    Attributes:
        width: k, of the sliding layer, in standard deviations of the measurement [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/ACCESS.2020.2995345", "The sliding layer is as wide as the reported sigma says."
    )

    width: Annotated[
        float,
        ABOVE_0,
        Range(1.0, 100.0, log=True, source="ours: from a gain of one to one of a hundredth"),
        DefaultOrigin("ours: a gain of about a tenth where nothing is wrong"),
    ] = 10.0

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged."""
        return R

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return K."""
        gain = np.zeros((len(x), len(rows)), P.dtype)
        for a in range(AXES):  # each axis by itself: K puts nothing between two
            for i in range(a, len(rows), AXES):
                gain[rows[i], i] = min(1.0, abs(innovation[i]) / (self.width * math.sqrt(R[i, i])))
        return gain
