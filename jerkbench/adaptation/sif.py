"""The sliding innovation filter."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0
from jerkbench.adaptation.common import UnchangedR
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "sif")
@dataclass(frozen=True)
class SlidingInnovation(UnchangedR, Limited):
    """Computes the gain only from the size of the innovation; the gain is 1 for large innovations.

    The gain depends on the innovation y and on the width delta_i = k sqrt(R_ii) of the sliding layer::

        K = H^+ diag(min(1, |y_i| / delta_i)),   P = (I - K H) P- (I - K H)' + K R K'

    H^+ is the pseudo-inverse of H. The gain of unmeasured states is zero, so the filters `bias` and `jerk` cannot
    estimate bias and jerk with this adaptation. The gain does not depend on the prior covariance. The method is
    intended for errors of the process model. The method is not robust to outliers, because the gain of an outlier is 1.

    Source: S. A. Gadsden, M. Al-Shabi, "The sliding innovation filter", IEEE Access 8, 96129-96138, 2020,
    doi:10.1109/ACCESS.2020.2995345. In the source delta has the unit of each measurement and is tuned by trial. Here
    delta is a multiple of the reported standard deviation, so one value of k can be used for different receivers.

    Attributes:
        width: k, width of the sliding layer in standard deviations of the measurement [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/ACCESS.2020.2995345", "The width of the sliding layer is a multiple of sigma."
    )

    width: Annotated[
        float,
        ABOVE_0,
        Range(1.0, 100.0, log=True, source="ours: from a gain of about 1 to 0.01 without a fault"),
        DefaultOrigin("ours: a gain of about 0.1 without a fault"),
    ] = 10.0

    lanes: ClassVar[bool] = True

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the gain K (n, m), which is zero for unmeasured states."""
        gain = np.zeros((len(x), len(rows)), P.dtype)
        for i, row in enumerate(rows):
            gain[row, i] = min(1.0, abs(innovation[i]) / (self.width * math.sqrt(R[i, i])))
        return gain
