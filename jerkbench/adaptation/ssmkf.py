"""The statistical similarity measure on prior and measurement."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, ONE_OF_SIDES, one_of
from jerkbench.adaptation.common import MIN_WEIGHT, PASSES, still_moves
from jerkbench.adaptation.linalg import AXES, diagonal_blocks, explained_sums, scaled, submatrix
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, chosen
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register

FUNCTIONS = ("log", "sqrt", "exp")


@register("adaptation", "ssmkf")
@dataclass(frozen=True)
class StatisticalSimilarity(Limited):
    """Scales prior and measurement, each as a whole, until the state is as similar to both as can be.

    With x and P the state and covariance of the pass before, n states and m rows, the first pass with weights of 1::

        g_x = tr(D_x (P-)^-1),  D_x = P + (x - x-)(x - x-)'
        g_z = tr(D_z R^-1),     D_z = H P H' + (z - H x)(z - H x)'
        xi = w(n, g_x),  lambda = w(m, g_z);    P~ = P- / xi,  R~ = R / lambda,  then the usual update for x and P

        w(d, g) = (nu + d) / (nu + g)           log
                  its square root               sqrt
                  exp((d - g) / (2 sigma^2))    exp

    It ends where x moves by less than 1e-6 |x|, or after 50 passes. g is d on average where the covariance is right;
    a weight may exceed 1. One factor for all rows: one bad axis makes the others worse. Where P- is larger than R
    (after an outage, with a large Q) an outlier moves the state and the prior takes the blame: ``sides=measurement``
    leaves xi = 1. R alone, a fixed number of passes, by the square root: `ssmkf_r`.

    Source: Y. Huang, Y. Zhang, Y. Zhao, P. Shi, J. A. Chambers, "A novel outlier-robust Kalman filtering framework
    based on statistical similarity measure", IEEE Trans. Automatic Control 66(6), 2677-2692, 2021,
    doi:10.1109/TAC.2020.3011443. Of their similarity functions three; weights stay above 1e-8; the switch of sides is
    ours.

    Attributes:
        function: of the similarity, "log", "sqrt" or "exp".
        nu: offset of log and sqrt; with nu -> infinity it is `none` [-].
        sigma: width of exp [-].
        sides: whom the weights doubt, "both" or "measurement".
    """

    provenance = Provenance("published", "doi:10.1109/TAC.2020.3011443")

    function: Annotated[
        str, one_of(FUNCTIONS), DefaultOrigin("ours: of the paper's, the one nearest to Student's t")
    ] = "log"
    nu: Annotated[
        float,
        ABOVE_0,
        Range(1.0, 100.0, log=True, source="ours: from Cauchy's tails to all but Gaussian ones"),
        DefaultOrigin("literature: 5 in the paper"),
    ] = 5.0
    sigma: Annotated[
        float,
        ABOVE_0,
        Range(
            1.0, 50.0, log=True, source="ours: from a kernel that rejects good measurements to one that rejects none"
        ),
        DefaultOrigin("literature: 5 in the paper"),
    ] = 5.0
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weighs both")] = "both"

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 1: lambda, from the prior's turn to that of R."""
        return 1

    def adapt_prior(
        self,
        x: FloatArray,
        P: FloatArray,
        F: FloatArray,
        Q: FloatArray,
        innovation: FloatArray,
        R: FloatArray,
        rows: IntArray,
        memory: FloatArray,
    ) -> FloatArray:
        """Return P~, and leave lambda in the memory."""
        n, m = len(x), len(rows)
        own = n // AXES
        w, steps, B = np.empty(m, P.dtype), np.zeros((2, n), P.dtype), np.empty((m, own + 1), P.dtype)
        for i in range(m):  # [H P-, y], of P- the states of the row's block
            for s in range(own):
                B[i, s] = P[rows[i], i % AXES + AXES * s]
            B[i, own] = innovation[i]
        d, X = diagonal_blocks(submatrix(P, rows), R, B)
        xi = weight = r = moves = 1.0
        explained = prior = measured = 0.0
        for k in range(PASSES):
            if k > 0:
                g_x, g_z = n - explained + xi * prior, explained + xi * r * measured
                if self.sides == "both":
                    xi = chosen(moves, 0.0, _weight(self.function, n, g_x, xi, self.nu, self.sigma), xi)
                weight = chosen(moves, 0.0, _weight(self.function, m, g_z, weight, self.nu, self.sigma), weight)
                r = xi / weight
            explained, prior, measured = explained_sums(d, X[:, own], r, w)
            _take_step(X, w, steps)
            moves = still_moves(steps[0], steps[1], x)
            if not anywhere(moves):
                break
        memory[0] = weight
        return scaled(P, 1.0 / xi)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R~."""
        return scaled(R, 1.0 / memory[0])


def _take_step(X: FloatArray, w: FloatArray, steps: FloatArray) -> None:
    """Note x - x- = P- H' L^-T V w, and the step before it."""
    step, before, n = steps[0], steps[1], len(w) // AXES
    for s in range(len(step)):
        moved, first = 0.0, s % AXES * n
        for i in range(first, first + n):
            moved += w[i] * X[i, s // AXES]
        before[s], step[s] = step[s], moved


def _weight(function: str, dimension: int, product: float, before: float, nu: float, sigma: float) -> float:
    """Return w(d, g) of the ``product`` of g and the weight ``before``."""
    if function == "exp":
        weight = math.exp(0.5 * (dimension - product / before) / (sigma * sigma))
    else:
        weight = (nu + dimension) * before / (nu * before + product)
        if function == "sqrt":
            weight = math.sqrt(weight)
    return max(weight, MIN_WEIGHT)
