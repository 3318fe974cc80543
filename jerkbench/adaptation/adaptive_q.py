"""Process noise by innovations, through the prior covariance."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.adaptation._ranges import ONE_OR_MORE, WINDOW, check_order
from jerkbench.adaptation.common import unfilled, window_memory, windowed_mean
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "adaptive_q")
@dataclass(frozen=True)
class AdaptiveQ(Limited):
    """Scales the prior covariance by what the innovations of a window say of it.

    With w_i the mean of the last N values of y_i^2, this one included, h_i = (H P- H')_ii of now and r_i = R_ii::

        alpha = sum (w_i - r_i) / sum h_i
        P- = P- min(max(sqrt(max(alpha, 0)), lo), hi)          1 until each row that is there has seen N updates

    An adaptation cannot touch Q itself, so the factor f acts on the whole prior: it stands for adding
    (f - 1) P- to Q, in the update that it belongs to. f < 1 would stand for taking something away that Q may not
    have, hence lo = 1. The root damps, because P- of the next update carries the factor on. Good where Q is too small
    (a naive baseline); where the sensor is at fault it opens the filter to it for N updates.

    Source: W. Ding, J. Wang, C. Rizos, D. Kinlyside, "Improving adaptive Kalman estimation in GPS/INS integration",
    Journal of Navigation 60(3), 517-529, 2007, doi:10.1017/S0373463307004316: their factor on Q is sqrt(alpha) with the
    mean of y y' in place of w; here on P-.

    Attributes:
        window: N, number of squared innovations in the mean, this one included [updates].
        low: lo, smallest factor on the prior covariance [-].
        high: hi, largest factor on the prior covariance [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.1017/S0373463307004316", "On the whole prior covariance, not on Q; never below 1."
    )

    window: Annotated[int, ONE_OR_MORE, WINDOW, DefaultOrigin("ours")] = 20
    low: Annotated[float, DefaultOrigin("ours: the prior is not narrowed")] = 1.0
    high: Annotated[
        float,
        Range(2.0, 1e4, log=True, source="ours: from 1.4 to 100 times the prior's sigma"),
        DefaultOrigin("ours"),
    ] = 100.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_order(self, "low", "high")

    def memory_size(self) -> int:
        """Return the length of what `windowed_mean` remembers of six rows."""
        return window_memory(self.window)

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor on the prior covariance."""
        excess, full = 0.0, True
        for i, row in enumerate(rows):
            excess += windowed_mean(memory, self.window, row, innovation[i] ** 2) - R[i, i]
            full = full and unfilled(memory, self.window, row) <= 0.0
        root = np.sqrt(max(excess, 0.0) / np.trace(HPHt))
        return min(max(root, self.low), self.high) if full else 1.0

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged."""
        return R
