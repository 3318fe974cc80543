"""Robust weights: Huber weights for prior and measurement or for R only, and IGG III weights for R."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.adaptation._ranges import ABOVE_0, ONE_OF_SIDES, check_order
from jerkbench.adaptation.common import MAX_ITERATIONS, MIN_WEIGHT, solve_stack, stack_of, weighted_prior
from jerkbench.adaptation.linalg import root_of, weighted
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, select
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "huber")
@dataclass(frozen=True)
class Huber(Limited):
    """Iterates the update with Huber weights for every component of prior and measurement until it converges.

    In the following equations of a pass, x is the state of the previous pass, and P- = B_p B_p' and R = B_r B_r'
    (Cholesky)::

        r_p = B_p^-1 (x - x-),  r_r = B_r^-1 (z - H x)                whitened residuals
        C_p, C_r = diag(min(1, gamma / |r_i|))                        in the first pass 1
        P~ = B_p C_p^-1 B_p',  R~ = B_r C_r^-1 B_r',  x = x- + P~ H' (H P~ H' + R~)^-1 (z - H x-)

    The iteration ends if x changes by less than 1e-6 |x|, or after 50 passes. P~ and R~ of the last pass replace P- and
    R in the update of the state and of its covariance. For residuals beyond gamma standard deviations, the cost is
    linear, so the influence of an outlier is bounded. If P- is larger than R, an outlier of the measurement changes the
    state and reduces the weights of the prior. P- is larger than R after an outage or with a large Q. The option
    ``sides=measurement`` sets C_p = I, so the weights of the prior do not change. The adaptation `huber_r` weights each
    row of R separately, without iterations.

    Source: C. D. Karlgaard, "Nonlinear regression Huber-Kalman filtering and fixed-interval smoothing", Journal of
    Guidance, Control, and Dynamics 38(2), 2015, doi:10.2514/1.G000799. The nonlinear measurement and the smoother of
    the source are not included. The parameter ``sides`` is an addition to the published method.

    Attributes:
        threshold: gamma, threshold in standard deviations of the whitened residual [-].
        sides: "both" to weight prior and measurement, or "measurement" to weight only the measurement.
    """

    provenance = Provenance("published", "doi:10.2514/1.G000799")

    threshold: Annotated[
        float,
        ABOVE_0,
        Range(0.5, 10.0, log=True, source="ours: from nearly the median to nearly the mean"),
        DefaultOrigin("literature: 1.345 has 95 % efficiency on Gaussian noise"),
    ] = 1.345
    sides: Annotated[str, ONE_OF_SIDES, DefaultOrigin("literature: the paper weights both")] = "both"

    lanes: ClassVar[bool] = True

    def memory_size(self) -> int:
        """Return 6, because the memory passes the inverse weights of six rows from `adapt_prior` to `adapt`."""
        return 6

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
        """Return the weighted prior covariance P~, and store the inverse weights of the rows in the memory."""
        stack = stack_of(P, R, rows, innovation)
        p, by_threshold, changed = len(stack.Up), 1.0 / self.threshold, 1.0
        for k in range(MAX_ITERATIONS):
            if k > 0:
                for i in range(0 if self.sides == "both" else p, len(stack.inverses)):
                    inverse = min(max(abs(stack.residual[i]) * by_threshold, 1.0), 1.0 / MIN_WEIGHT)
                    stack.inverses[i] = select(changed, 0.0, inverse, stack.inverses[i])
            changed = solve_stack(stack, x)
            if not anywhere(changed):
                break
        for i in range(len(rows)):
            memory[i] = stack.inverses[p + i]
        return weighted_prior(P, stack)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the weighted measurement covariance R~ of the last pass."""
        return weighted(root_of(R, len(R)), memory[: len(rows)])


@register("adaptation", "huber_r")
@dataclass(frozen=True)
class HuberR(Limited):
    """Inflates the variance of a row in proportion to its innovation, if the innovation exceeds a threshold.

    In the following equation for row i, y is the innovation, h_i = (H P- H')_ii and r_i = R_ii::

        r_i = r_i max(1, |y_i| / (k sqrt(h_i + r_i)))

    The cost function is quadratic for innovations up to k standard deviations, and linear for larger innovations. With
    k = 1.345, the efficiency on Gaussian noise is 95 %. The method never drops an outlier. The influence of an outlier
    is bounded if h_i is small compared with r_i, but several consecutive outliers still change the state. The
    off-diagonal elements of R do not change. The weights are computed from the innovation of the prior, without
    iterations.

    Source: P. J. Huber, "Robust estimation of a location parameter", Annals of Mathematical Statistics 35, 73-101,
    1964, doi:10.1214/aoms/1177703732; in Kalman filters e.g. C. D. Karlgaard, H. Schaub, "Huber-based divided
    difference filtering", Journal of Guidance, Control, and Dynamics 30(3), 885-891, 2007. Simplifications: only the
    measurement is weighted, and each row is weighted separately without iterations.

    Attributes:
        threshold: k, threshold in standard deviations of the innovation [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1214/aoms/1177703732", "Weights only the measurement, row by row, in one step."
    )

    threshold: Annotated[
        float,
        ABOVE_0,
        Range(0.5, 5.0, log=True, source="ours: from nearly the median to nearly the mean"),
        DefaultOrigin("literature: 95 % efficiency on Gaussian noise"),
    ] = 1.345

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with inflated variances in the rows whose innovation exceeds the threshold."""
        adapted = R.copy()
        for i in range(len(rows)):
            distance = abs(innovation[i]) / math.sqrt(HPHt[i, i] + R[i, i])
            adapted[i, i] = R[i, i] * max(1.0, distance / self.threshold)
        return adapted


@register("adaptation", "igg3")
@dataclass(frozen=True)
class Igg3(Limited):
    """Accepts, down-weights or drops each row according to the size of its innovation.

    The weight w of row i depends on v = |y_i| / sqrt(S_ii), with the innovation y and S = H P- H' + R::

        w = 1                                    v <= k0
        w = (k0 / v) ((k1 - v) / (k1 - k0))^2    k0 < v <= k1
        w = 0                                    k1 < v

        R_ii = R_ii / w;  w = 0 drops the row

    The off-diagonal elements of R do not change. Unlike a Huber weight, the weight decreases to zero, so a gross
    outlier has no influence. If the error of the state itself exceeds k1 standard deviations, the filter drops every
    measurement and does not recover.

    Source: Y. Yang, L. Song, T. Xu, "Robust estimator for correlated observations based on bifactor equivalent
    weights", Journal of Geodesy 76, 353-358, 2002, for the weight function. Simplifications: the innovation replaces
    the residual of the least-squares adjustment, and each row is weighted separately without iterations. The defaults
    k0 = 2 and k1 = 6 are larger than the common values 1.5 and 4.

    Attributes:
        keep: k0, size of the innovation up to which a row has the full weight, in standard deviations [-].
        drop: k1, size of the innovation above which a row is dropped, in standard deviations [-].
    """

    provenance = Provenance(
        "simplified", "Yang, Song and Xu, 2002", "The innovation instead of a residual, row by row, without iterations."
    )

    keep: Annotated[
        float,
        Range(1.0, 3.5, source="literature: 1.5 to 3 is common; extended on both sides"),
        DefaultOrigin("ours: larger than the common 1.5, which increases the error by 7 % without a fault"),
    ] = 2.0
    drop: Annotated[
        float,
        Range(4.0, 15.0, log=True, source="literature: 3 to 8 is common; from above the largest k0 to larger values"),
        DefaultOrigin("ours: larger than the common 4"),
    ] = 6.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self, "keep", "drop", equal=False)

    lanes: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with inflated variances in down-weighted rows and infinite variances in dropped rows."""
        adapted = R.copy()
        for i in range(len(rows)):
            v = abs(innovation[i]) / math.sqrt(HPHt[i, i] + R[i, i])
            steep = (self.drop - self.keep) / select(self.drop, v, self.drop - v, 1.0)
            inflated = select(v, self.keep, R[i, i] * (v / self.keep) * (steep * steep), R[i, i])
            adapted[i, i] = select(self.drop, v, inflated, math.inf)
        return adapted
