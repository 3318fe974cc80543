"""Whether innovations follow each other: those of an optimal filter do not."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.blocks import autocorrelation

LAGS = 20
FEWEST = 30
"""Of fewer innovations nothing is said."""


@dataclass(frozen=True)
class Whiteness:
    """The Ljung-Box test of one row's innovations.

    Attributes:
        first: autocorrelation at lag 1; over 0: the filter lags behind, below: it overshoots.
        bound: 95 % of white series of that length stay within -+bound.
        p: of the test over `LAGS` lags; small: not white.
    """

    first: float
    bound: float
    p: float

    @property
    def white(self) -> bool:
        """Whether nothing speaks against it, at 5 %."""
        return not self.p < 0.05


def whiteness(innovation: FloatArray) -> Whiteness:
    """Test (m,) innovations of one row in their order; NaN (the row was absent) is left out.

    With rho_k their autocorrelation::

        Q = m (m + 2) sum_k rho_k^2/(m - k),  k = 1 ... LAGS,  chi-square with LAGS degrees of freedom

    Source: Ljung and Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978).
    """
    from scipy.special import chdtrc  # scipy.stats would take half a second to import in every worker

    there = innovation[np.isfinite(innovation)]
    m = len(there)
    if m < FEWEST:
        return Whiteness(np.nan, np.nan, np.nan)
    lags = np.arange(1, LAGS + 1)
    rho = autocorrelation(there)[lags]
    statistic = m * (m + 2) * float(np.sum(rho**2 / (m - lags)))
    return Whiteness(float(rho[0]), float(1.96 / np.sqrt(m)), float(chdtrc(LAGS, statistic)))
