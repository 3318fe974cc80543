"""The statistical similarity measure on prior and measurement."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.adaptation._measured import distances, innovate, measured_of
from jerkbench.adaptation._stack import PASSES, SMALLEST_WEIGHT, check_sides, has_settled
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError, unknown
from jerkbench.parameters import Origin, Range
from jerkbench.plugins import register

FUNCTIONS = ("log", "sqrt", "exp")


@register("adaptation", "ssmkf")
@dataclass(frozen=True)
class StatisticalSimilarity:
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

    function: Annotated[str, Origin("ours: of the paper's, the one nearest to Student's t")] = "log"
    nu: Annotated[
        float,
        Range(1.0, 100.0, log=True, source="ours: from Cauchy's tails to all but Gaussian ones"),
        Origin("literature: 5 in the paper"),
    ] = 5.0
    sigma: Annotated[
        float,
        Range(
            1.0, 50.0, log=True, source="ours: from a kernel that rejects good measurements to one that rejects none"
        ),
        Origin("literature: 5 in the paper"),
    ] = 5.0
    sides: Annotated[str, Origin("literature: the paper weighs both")] = "both"

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_sides("ssmkf", self.sides)
        if self.function not in FUNCTIONS:
            raise PluginError(f"ssmkf.function: {unknown('value', self.function, FUNCTIONS)}")
        if not (self.nu > 0 and self.sigma > 0):
            raise PluginError(f"ssmkf.nu is {self.nu} and sigma {self.sigma}; both must be above 0.")

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
        n, m, part = len(x), len(rows), measured_of(P, R, rows)
        xi, weight, step, before = 1.0, 1.0, np.zeros(len(x)), np.zeros(len(x))
        for k in range(PASSES):
            if k > 0:
                g_x, g_z = distances(part, n, xi, weight)
                weight = _weight(self.function, m, g_z, self.nu, self.sigma)
                if self.sides == "both":
                    xi = _weight(self.function, n, g_x, self.nu, self.sigma)
            innovate(part, innovation, xi, weight)
            step, before = before, step
            _fill_step(P, rows, part.v, xi, step)
            if has_settled(step, before, x, step):
                break
        memory[0] = weight
        return np.asarray(P / xi, dtype=np.float64)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R~."""
        return np.asarray(R / memory[0], dtype=np.float64)


def _fill_step(P: FloatArray, rows: IntArray, v: FloatArray, xi: float, step: FloatArray) -> None:
    """Fill x - x- = P- H' v / xi."""
    step[:] = 0.0
    for i in range(len(rows)):
        share = v[i] / xi
        for s in range(len(step)):
            step[s] += share * P[rows[i], s]


def _weight(function: str, dimension: int, distance: float, nu: float, sigma: float) -> float:
    """Return w(d, g)."""
    if function == "exp":
        weight = np.exp(0.5 * (dimension - distance) / sigma**2)
    else:
        weight = (nu + dimension) / (nu + distance)
        if function == "sqrt":
            weight = np.sqrt(weight)
    return float(max(weight, SMALLEST_WEIGHT))
