"""Estimation of R, or of a factor on the prior covariance, from the innovations in a window."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.adaptation._ranges import SHRINKING, WINDOW, check_order
from jerkbench.adaptation.common import UPDATE_COUNTS, UnchangedR, Windowed, windowed_mean
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import each_run, select
from jerkbench.parameters import AT_LEAST_ONE, DefaultOrigin, Limit, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "iae")
@dataclass(frozen=True)
class InnovationBased(Windowed):
    """Estimates R as the variance of the last innovations minus the variance of the prior.

    In the following equation, w_i is the mean of the last N squared innovations y_i^2, including the current
    innovation, and h_i = (H P- H')_ii::

        r_i = max(w_i - h_i, lo r_i),    R diagonal

    Before a row has had N updates, the method uses the reported R for this row, including the off-diagonal elements.
    The method works well on noise that changes slowly compared with the window. The relative standard deviation of a
    variance estimated from N values is sqrt(2/N), which is 45 % for N = 10, so a short window gives a noisy R. The
    method cannot distinguish errors of the process model from errors of the sensor.

    Source: A. H. Mohamed and K. P. Schwarz, "Adaptive Kalman filtering for INS/GPS", Journal of Geodesy 73, 193-203,
    1999, doi:10.1007/s001900050236. Simplifications: only the diagonal of R is estimated, and the current h is
    used instead of the mean of h over the window.

    Attributes:
        window: N, number of squared innovations in the mean w_i, including the current innovation [updates].
        low: lo, lower bound of the estimated variance as a multiple of the reported variance [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1007/s001900050236", "Only the diagonal of R, with the current prior covariance."
    )

    window: Annotated[int, AT_LEAST_ONE, WINDOW, DefaultOrigin("ours")] = 10
    low: Annotated[
        float,
        Limit(lambda low: low > 0, "it must be above 0, because R has to be positive."),
        SHRINKING,
        DefaultOrigin("ours, as sage_husa"),
    ] = 0.1

    lanes: ClassVar[bool] = True
    varying: ClassVar[tuple[str, ...]] = ("window",)

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, with estimated variances in the rows whose window contains N values."""
        adapted = R.copy()
        for i, row in enumerate(rows):
            mean = each_run(windowed_mean, memory, self.window, row, innovation[i] * innovation[i])
            missing = self.window - memory[UPDATE_COUNTS + row]
            for j in range(len(rows)):
                adapted[i, j] = adapted[j, i] = select(missing, 0.0, adapted[i, j], 0.0)
            adapted[i, i] = select(missing, 0.0, R[i, i], max(mean - HPHt[i, i], self.low * R[i, i]))
        return adapted


@register("adaptation", "adaptive_q")
@dataclass(frozen=True)
class AdaptiveQ(UnchangedR, Windowed):
    """Scales the prior covariance by a factor that is estimated from a window of innovations.

    In the following equations, w_i is the mean of the last N squared innovations y_i^2, including the current
    innovation, h_i = (H P- H')_ii and r_i = R_ii::

        alpha = sum (w_i - r_i) / sum h_i
        P- = P- min(max(sqrt(max(alpha, 0)), lo), hi)          factor 1 until each present row has had N updates

    The method `fade` returns a factor f on P- and cannot change Q. The multiplication of P- by f is equivalent to
    adding (f - 1) P- to Q at this update. The default is lo = 1, because a factor f < 1 could require a negative Q. The
    square root damps the adaptation, because P- of the next update includes the factor. The method works well if Q is
    too small. If a sensor has a fault, the larger P- gives the faulty measurements more weight for N updates.

    Source: W. Ding, J. Wang, C. Rizos, D. Kinlyside, "Improving adaptive Kalman estimation in GPS/INS integration",
    Journal of Navigation 60(3), 517-529, 2007, doi:10.1017/S0373463307004316. The source applies the factor sqrt(alpha)
    to Q, with the mean of y y' instead of w; here the factor is applied to P-.

    Attributes:
        window: N, number of squared innovations in the mean w_i, including the current innovation [updates].
        low: lo, minimum factor by which the prior covariance is multiplied [-].
        high: hi, maximum factor by which the prior covariance is multiplied [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1017/S0373463307004316", "A factor on the prior covariance, not on Q; at least 1."
    )

    window: Annotated[int, AT_LEAST_ONE, WINDOW, DefaultOrigin("ours")] = 20
    low: Annotated[float, DefaultOrigin("ours: the prior covariance is never reduced")] = 1.0
    high: Annotated[
        float,
        Range(2.0, 1e4, log=True, source="ours: from 1.4 to 100 times the sigma of the prior"),
        DefaultOrigin("ours"),
    ] = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self, "low", "high")

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor by which the prior covariance is multiplied."""
        excess, full = 0.0, True
        for i, row in enumerate(rows):
            excess += windowed_mean(memory, self.window, row, innovation[i] ** 2) - R[i, i]
            full = full and memory[UPDATE_COUNTS + row] >= self.window
        root = np.sqrt(max(excess, 0.0) / np.trace(HPHt))
        return min(max(root, self.low), self.high) if full else 1.0
