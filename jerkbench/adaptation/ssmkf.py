"""Scaling by the statistical similarity measure, for prior and measurement or for R only."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import ABOVE_0, BANDWIDTH, FREEDOM, ONE_OF_SIDES, PASSES, one_of
from jerkbench.adaptation.common import MAX_ITERATIONS, MIN_WEIGHT, take_step
from jerkbench.adaptation.linalg import diagonalise, explained_sums, scaled
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, select
from jerkbench.kalman import submatrix
from jerkbench.parameters import DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register

FUNCTIONS = ("log", "sqrt", "exp")


@register("adaptation", "ssmkf")
@dataclass(frozen=True)
class StatisticalSimilarity(Limited):
    """Scales P- and R by factors that maximise the similarity of the state to the prior and to the measurement.

    In the following equations of a pass, x and P are the state and the covariance of the previous pass, for n states
    and m measured rows::

        g_x = tr(D_x (P-)^-1),  D_x = P + (x - x-)(x - x-)'
        g_z = tr(D_z R^-1),     D_z = H P H' + (z - H x)(z - H x)'
        xi = w(n, g_x),  lambda = w(m, g_z);    P~ = P- / xi,  R~ = R / lambda,  then the Kalman update for x and P

        w(d, g) = (nu + d) / (nu + g)           log
                  its square root               sqrt
                  exp((d - g) / (2 sigma^2))    exp

    In the first pass, the weights xi and lambda are 1. The iteration ends if x changes by less than 1e-6 |x|, or after
    50 passes. If the covariances are correct, the mean of g_x is n and the mean of g_z is m. A weight may be larger
    than 1, which reduces the covariance. All measured rows have the same factor, so one faulty axis reduces the weight
    of the other axes. If P- is larger than R, an outlier changes the state and reduces the weight of the prior. P- is
    larger than R after an outage or with a large Q. The option ``sides=measurement`` sets xi = 1, so the prior is not
    scaled. The adaptation `ssmkf_r` changes only R, with the square root function and a fixed number of passes.

    Source: Y. Huang, Y. Zhang, Y. Zhao, P. Shi, J. A. Chambers, "A novel outlier-robust Kalman filtering framework
    based on statistical similarity measure", IEEE Trans. Automatic Control 66(6), 2677-2692, 2021,
    doi:10.1109/TAC.2020.3011443. Three similarity functions of the source are implemented. Additions to the published
    method are ``sides`` and a lower bound of 1e-8 for the weights.

    Attributes:
        function: name of the similarity function, "log", "sqrt" or "exp".
        nu: parameter of the functions log and sqrt. For nu -> infinity, the method is equivalent to `none` [-].
        sigma: width of the similarity function exp [-].
        sides: "both" to weight prior and measurement, or "measurement" to weight only the measurement.
    """

    provenance = Provenance("published", "doi:10.1109/TAC.2020.3011443")

    function: Annotated[
        str, one_of(FUNCTIONS), DefaultOrigin("ours: the function of the paper that is nearest to Student's t")
    ] = "log"
    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("literature: 5 in the paper")] = 5.0
    sigma: Annotated[float, ABOVE_0, BANDWIDTH, DefaultOrigin("literature: 5 in the paper")] = 5.0
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weights both")] = "both"

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 1, because the memory passes the weight lambda from `adapt_prior` to `adapt`."""
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
        """Return the scaled prior covariance P~, and store lambda in the memory."""
        n, m = len(x), len(rows)
        w, step, X = np.empty(m, P.dtype), np.zeros(n, P.dtype), np.empty((m, n + 1), P.dtype)
        for i in range(m):
            for s in range(n):
                X[i, s] = P[rows[i], s]
            X[i, n] = innovation[i]
        d = diagonalise(submatrix(P, rows), R.copy(), X)
        xi = weight = r = changed = 1.0
        explained = prior = measured = 0.0
        for k in range(MAX_ITERATIONS):
            if k > 0:
                g_x, g_z = n - explained + xi * prior, explained + xi * r * measured
                if self.sides == "both":
                    xi = select(changed, 0.0, _weight(self.function, n, g_x, xi, self.nu, self.sigma), xi)
                weight = select(changed, 0.0, _weight(self.function, m, g_z, weight, self.nu, self.sigma), weight)
                r = xi / weight
            explained, prior, measured = explained_sums(d, X[:, n], r, w)
            changed = take_step(step, X, w, x)
            if not anywhere(changed):
                break
        memory[0] = weight
        return scaled(P, 1.0 / xi)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the scaled measurement covariance R~ of the last pass."""
        return scaled(R, 1.0 / memory[0])


def _weight(function: str, dimension: int, product: float, previous: float, nu: float, sigma: float) -> float:
    """Return the weight w(d, g) for the ``dimension`` d, where ``product`` is g times the ``previous`` weight."""
    if function == "exp":
        weight = math.exp(0.5 * (dimension - product / previous) / (sigma * sigma))
    else:
        weight = (nu + dimension) * previous / (nu * previous + product)
        if function == "sqrt":
            weight = math.sqrt(weight)
    return max(weight, MIN_WEIGHT)


@register("adaptation", "ssmkf_r")
@dataclass(frozen=True)
class StatisticalSimilarityR(Limited):
    """Scales R by the factor that maximises the similarity of the measurement to its prediction.

    The method uses the statistical similarity measure with the square root function. In the following equations of a
    pass, y is the innovation of m rows, HPH' = H P- H', and lambda starts at 1::

        S = HPH' + R / lambda,  res = (R / lambda) S^-1 y
        B = res res' + HPH' - HPH' S^-1 HPH'                   expected square of z - H x after the update
        lambda = sqrt((nu + m) / (nu + tr(B R^-1)))

    The adapted covariance is R / lambda. The trace tr(B R^-1) is computed as (y' S^-1 res + tr(S^-1 HPH')) / lambda,
    because this form has no difference of large numbers. If R is correct, the mean of tr(B R^-1) is m. If tr(B R^-1) is
    smaller than m, lambda exceeds 1 and R decreases. For large residuals, lambda is proportional to the inverse of the
    residual, as with Huber weights. The weight depends on the residual after the update, so a large innovation that is
    due to a large prior covariance is not treated as an outlier. All measured rows have the same factor.

    Source: Y. Huang, Y. Zhang, Y. Zhao, P. Shi, J. A. Chambers, "A novel outlier-robust Kalman filtering framework
    based on statistical similarity measure", IEEE Trans. Automatic Control 66(6), 2677-2692, 2021,
    doi:10.1109/TAC.2020.3011443. Simplifications: only R is scaled, with xi = 1 for P-; the number of passes is fixed;
    and the square root is the only similarity function.

    Attributes:
        nu: parameter of the square root function. For nu -> infinity, the method is equivalent to `none` [-].
        passes: maximum number of fixed-point passes in each update [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TAC.2020.3011443", "Only R, with the square root, in a fixed number of passes."
    )

    nu: Annotated[float, ABOVE_0, FREEDOM, DefaultOrigin("ours, because only R is scaled; the source uses 5")] = 3.0
    passes: Annotated[int, PASSES, DefaultOrigin("ours")] = 10

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, multiplied by the factor 1 / lambda of the last pass."""
        m, weight = len(rows), 1.0  # the weight is lambda of the equations
        w, y = np.empty(m, R.dtype), innovation.copy().reshape((m, 1))
        d = diagonalise(HPHt.copy(), R.copy(), y)
        for _ in range(self.passes):
            previous, scale = weight, 1.0 / weight
            explained, _prior, measured = explained_sums(d, y[:, 0], scale, w)
            weight = math.sqrt((self.nu + m) / (self.nu + scale * (explained + scale * measured)))
            if not anywhere(abs(weight - previous)):
                break
        return scaled(R, 1.0 / weight)
