"""Sage and Husa: a recursive estimate of R from the innovations."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import FORGETTING, SHRINKING, WITHIN_0_AND_1, check_order
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "sage_husa")
@dataclass(frozen=True)
class SageHusa(Limited):
    """Estimates each variance of R recursively, with fading memory.

    At the k-th update of row i, with y the innovation, h_i = (H P- H')_ii and r_i the reported variance::

        d = (1 - b) / (1 - b^(k+1))
        rh_i = clip((1 - d) rh_i + d (y_i^2 - h_i), lo r_i, hi r_i);    R = diag(rh)

    k = 0 takes the reported variance. It learns slowly (about 1/(1 - b) updates) and forgets as slowly: good on
    long-lasting changes of the noise, late on bursts, and misled where the process, not the sensor, is at fault.

    Source: A. P. Sage and G. W. Husa, "Adaptive filtering with unknown prior statistics", Joint Automatic Control
    Conference 1969, 760-769 (no DOI); the bounds keep R positive.

    Attributes:
        forgetting: b, between 0 and 1 [-].
        low: lo, lower bound as a multiple of the reported variance [-].
        high: hi, upper bound as a multiple of the reported variance [-].
    """

    provenance = Provenance(
        "simplified", "Sage and Husa, 1969", "The diagonal of R alone, within bounds; no means, and no Q."
    )

    forgetting: Annotated[float, WITHIN_0_AND_1, FORGETTING, DefaultOrigin("literature: 0.95 to 0.99 is usual")] = 0.97
    low: Annotated[float, SHRINKING, DefaultOrigin("ours: keeps R positive")] = 0.1
    high: Annotated[
        float,
        Range(10.0, 1e6, log=True, source="ours: from 3 to 1000 times the reported sigma"),
        DefaultOrigin("ours: a hundred times the reported sigma"),
    ] = 1e4

    lanes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_order(self, "low", "high")

    def memory_size(self) -> int:
        """Return 18: rh, k and b^k of each row."""
        return 18

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal R of the estimated variances."""
        adapted, b = np.zeros(R.shape, R.dtype), self.forgetting
        for i, row in enumerate(rows):
            r, k, power = R[i, i], memory[6 + row], memory[12 + row]  # power: b^k, faster than to raise it
            d = (1.0 - b) / (1.0 - power * b)
            estimate = (1.0 - d) * memory[row] + d * (innovation[i] * innovation[i] - HPHt[i, i])
            memory[row] = adapted[i, i] = chosen(k, 0.0, min(max(estimate, self.low * r), self.high * r), r)
            memory[6 + row] = k + 1.0
            memory[12 + row] = b * chosen(k, 0.0, power, 1.0)
        return adapted
