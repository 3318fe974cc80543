"""Weights of Geman and McClure for jerkbench: the row of a measurement that does not fit counts less."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class GemanMcClure:
    """Inflates the variance of each row by the weight of its own innovation, after Geman and McClure.

    With y the innovation, S = H P- H' + R and e_i = y_i / sqrt(S_ii)::

        w_i = 1 / (1 + (e_i / c)^2)^2,    R = D R D,    D = diag(1 / sqrt(w_i)) = diag(1 + (e_i / c)^2)

    A row at e = c counts a quarter; the weight goes on falling, so a gross outlier is as good as not there.

    Source: S. Geman and D. E. McClure, 1985; the loss with alpha = -2 of J. T. Barron, 2019
    (doi:10.1109/CVPR.2019.00446), of which this is the weight with its c scaled by two.

    Attributes:
        c: innovation in standard deviations at which a row counts a quarter [-].
    """

    c: float = 3.0

    def adapt(self, innovation, HPHt, R, rows, memory):
        """Return R with its rows and columns scaled."""
        e = innovation / np.sqrt(np.diag(HPHt + R))
        d = 1.0 + (e / self.c) ** 2
        return R * np.outer(d, d)
