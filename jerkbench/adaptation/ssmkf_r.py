"""The statistical similarity measure, R alone."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, FREEDOM, SOME_PASSES
from jerkbench.adaptation.linalg import diagonal_blocks, explained_sums, scaled
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register


@register("adaptation", "ssmkf_r")
@dataclass(frozen=True)
class StatisticalSimilarityR(Limited):
    """Scales the whole of R so that the measurement is as similar to its prediction as can be.

    The statistical similarity measure with the square-root function. With y the innovation of m rows, HPH' = H P- H'
    and lambda = 1 at the start, several passes of::

        S = HPH' + R / lambda,  res = (R / lambda) S^-1 y
        B = res res' + HPH' - HPH' S^-1 HPH'                   the expected square of z - H x after the update
        lambda = sqrt((nu + m) / (nu + tr(B R^-1)))

    then R = R / lambda; tr(B R^-1) is (y' S^-1 res + tr(S^-1 HPH')) / lambda, nothing large taken from anything
    large. It is m on average where R is right; lambda may exceed 1, and R shrink, where it is smaller. The weight falls
    with the first power of the residual, gently like Huber's, and is found with the residual after the update, so that
    a large h is not taken for an outlier. One factor for all rows.

    Source: Y. Huang, Y. Zhang, Y. Zhao, P. Shi, J. A. Chambers, "A novel outlier-robust Kalman filtering framework
    based on statistical similarity measure", IEEE Trans. Automatic Control 66(6), 2677-2692, 2021,
    doi:10.1109/TAC.2020.3011443. Simplified: R alone, their factor xi on P- stays 1; a fixed number of passes; of their
    similarity functions the square root.

    Attributes:
        nu: offset in the square root; with nu -> infinity it is `none` [-].
        passes: fixed-point passes of an update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TAC.2020.3011443", "R alone, by the square root, in a fixed number of passes."
    )

    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("literature: the source uses 5; ours for R alone")] = 3.0
    passes: Annotated[int, SOME_PASSES, DefaultOrigin("ours")] = 10

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, scaled as a whole."""
        m, weight = len(rows), 1.0  # lambda
        w, y = np.empty(m, R.dtype), np.empty((m, 1), R.dtype)
        for i in range(m):
            y[i, 0] = innovation[i]
        d, X = diagonal_blocks(HPHt, R, y)
        for _ in range(self.passes):
            before, scale = weight, 1.0 / weight
            explained, _prior, measured = explained_sums(d, X[:, 0], scale, w)
            weight = math.sqrt((self.nu + m) / (self.nu + scale * (explained + scale * measured)))
            if not anywhere(abs(weight - before)):
                break
        return scaled(R, 1.0 / weight)
