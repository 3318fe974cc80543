"""The Ljung-Box test of innovations: those of an optimal filter are white."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals.correlated_errors import autocorrelation

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
    measured = innovation[np.isfinite(innovation)]
    return _tested(measured[:, None])[0]


def whiteness_of_rows(innovation: FloatArray) -> list[Whiteness]:
    """Return what `whiteness` says of each column of (m, r); all at once where no row was absent."""
    if np.isfinite(innovation).all():
        return _tested(innovation)
    return [whiteness(column) for column in innovation.T]


def _tested(columns: FloatArray) -> list[Whiteness]:
    from scipy.special import chdtrc  # scipy.stats would take half a second to import in every worker

    m = len(columns)
    if m < FEWEST:
        return [Whiteness(np.nan, np.nan, np.nan)] * columns.shape[1]
    lags = np.arange(1, LAGS + 1)
    rho = autocorrelation(columns, LAGS)[1:]
    statistic = m * (m + 2) * np.sum(rho**2 / (m - lags)[:, None], axis=0)
    bound = float(1.96 / np.sqrt(m))
    return [
        Whiteness(float(correlation), bound, float(p))
        for correlation, p in zip(rho[0], chdtrc(LAGS, statistic), strict=True)
    ]
