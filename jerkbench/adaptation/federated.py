"""The federated filter with two locals."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import WITHIN_0_AND_1
from jerkbench.adaptation.common import position_rows
from jerkbench.adaptation.linalg import dot, trace
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "federated")
@dataclass(frozen=True)
class Federated(Limited):
    """A federated filter: position and velocity each in a local filter that scales its own R.

    The locals share the prior, P_i = P- / beta_i with beta_p = beta, beta_v = 1 - beta, and are fused and reset after
    each update: P^-1 = sum P_i^-1, x = P sum P_i^-1 x_i. Each adapts like `scalar_r`, with y, h_i = (H P- H')_ii and
    r_i = R_ii of its own block::

        if y'y >= sum h / beta_i + sum r:    lambda_i = (y'y - sum h / beta_i) / sum r,  else 1
        R_block = lambda_i R_block

    This is what is computed: the fusion of such locals is the central filter with these R, exactly, so that without
    a trigger it is the central filter for any beta. Covariances between position and velocity, which the locals could
    not use, are scaled by sqrt(lambda_p lambda_v). beta stays as it is where a block is absent.

    Good on a fault of one of the two sensors, whose block alone is made worse; inside a block it is all or nothing. A
    small beta makes a local more tolerant.

    Source: N. A. Carlson, "Federated square root filter for decentralized parallel processes", IEEE Trans. Aerospace
    and Electronic Systems 26(3), 517-525, 1990, doi:10.1109/7.106130, with `scalar_r` in the locals.

    Attributes:
        beta: share of the prior's information that goes to the position's filter [-].
    """

    provenance = Provenance(
        "own", "doi:10.1109/7.106130", "Carlson's federated filter, in whose locals `scalar_r` adapts R."
    )

    beta: Annotated[
        float, WITHIN_0_AND_1, Range(0.05, 0.95, source="any share but nothing"), DefaultOrigin("equal shares")
    ] = 0.5

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R with each block scaled by its own factor."""
        adapted, factors, split = R.copy(), np.empty(len(rows), R.dtype), position_rows(rows)
        for begin, end, share in ((0, split, self.beta), (split, len(rows), 1.0 - self.beta)):
            if begin < end:
                of, y = slice(begin, end), innovation[begin:end]
                energy, h, r = dot(y, y), trace(HPHt[of, of]) / share, trace(R[of, of])
                for i in range(begin, end):
                    factors[i] = chosen(h + r, energy, 1.0, (energy - h) / r)
        for i in range(len(rows)):
            for j in range(len(rows)):
                adapted[i, j] *= math.sqrt(factors[i] * factors[j])
        return adapted
