"""The federated filter with one local filter for position and one for velocity."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation.common import position_rows
from jerkbench.adaptation.linalg import dot, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import select
from jerkbench.parameters import BETWEEN_0_AND_1, DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "federated")
@dataclass(frozen=True)
class Federated(Limited):
    """A federated filter with one local filter for position and one for velocity, each of which scales its R.

    The two local filters divide the information of the prior. The prior of the position filter is P- / beta, and the
    prior of the velocity filter is P- / (1 - beta). After each update, the local filters are fused and reset, with P^-1
    = sum P_i^-1 and x = P sum P_i^-1 x_i. Each local filter adapts its block of R (position or velocity) as in
    `scalar_r`. In the following equations of one block, y is the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        if y'y >= sum h / beta_i + sum r:    lambda_i = (y'y - sum h / beta_i) / sum r,  else 1
        R_block = lambda_i R_block

    The fusion of the local filters is exactly equal to the central filter with the scaled R, so this adaptation
    computes only R. If no lambda exceeds 1, the result does not depend on beta. The elements of R between position and
    velocity are multiplied by sqrt(lambda_p lambda_v), so that R remains positive definite. If position or velocity is
    not measured, beta does not change.

    The method works well on a fault of only position or only velocity, because only the R of the faulty measurement is
    inflated. All three axes of a block have the same factor lambda. A small beta increases the threshold of the
    position test.

    Source: N. A. Carlson, "Federated square root filter for decentralized parallel processes", IEEE Trans. Aerospace
    and Electronic Systems 26(3), 517-525, 1990, doi:10.1109/7.106130, with `scalar_r` in the local filters.

    Attributes:
        beta: fraction of the prior information that is assigned to the local filter of the position, from 0 to 1 [-].
    """

    provenance = Provenance(
        "own", "doi:10.1109/7.106130", "Carlson's federated filter with `scalar_r` in the local filters."
    )

    beta: Annotated[
        float, BETWEEN_0_AND_1, Range(0.05, 0.95, source="any fraction above 0"), DefaultOrigin("equal fractions")
    ] = 0.5

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, in which the blocks of position and velocity are scaled by their factors."""
        adapted, factors, split = R.copy(), np.empty(len(rows), R.dtype), position_rows(rows)
        for start, end, fraction in ((0, split, self.beta), (split, len(rows), 1.0 - self.beta)):
            if start < end:
                part, y = slice(start, end), innovation[start:end]
                energy, h, r = dot(y, y), trace(HPHt[part, part]) / fraction, trace(R[part, part])
                for i in range(start, end):
                    factors[i] = select(h + r, energy, 1.0, (energy - h) / r)
        for i in range(len(rows)):
            for j in range(len(rows)):
                adapted[i, j] *= math.sqrt(factors[i] * factors[j])
        return adapted
