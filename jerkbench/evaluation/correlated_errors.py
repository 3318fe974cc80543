"""One recording: an interval for its RMSE from errors that follow each other, by a moving-block bootstrap."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray

_RESAMPLES = 1999
_SEED = 20
"""Fixed: the same errors give the same interval."""

FACTOR = 12
"""Correlation times in a block: the means of shorter ones know each other, and the interval gets too short."""

DIRECT = 32
"""Up to so many lags, sums of products are faster than a Fourier transform."""

MIN_CORRELATION_TIMES = 75
"""Fewer correlation times carry no interval: of 40 it held the true RMSE in 90 % of cases."""


class RecordingInterval(NamedTuple):
    """The RMSE over one recording, with what this one recording can say about its accuracy.

    Attributes:
        rmse: over all rows; NaN without any.
        low: lower end; NaN if the recording is shorter than `MIN_CORRELATION_TIMES` correlation times.
        high: upper end.
        block: rows of a block.
        correlation: rows after which squared errors forget each other (integrated autocorrelation).
    """

    rmse: float
    low: float
    high: float
    block: int
    correlation: float


def block_interval(squares: FloatArray, confidence: float = 0.95) -> RecordingInterval:
    """Return the RMSE of (n,) squared errors in their order, with a moving-block bootstrap interval.

    Blocks of l rows, drawn with replacement from all n - l + 1 of them, keep the correlation within; l is at least
    `FACTOR` times the correlation time and n^(1/3). With s the standard deviation of the logarithms of the resampled
    means, and b = n/l blocks, the mean square lies within exp(-+ t_{b-1} s sqrt(b/(b - 1))) of that of the rows.
    Simulated with autoregressive errors of three axes it holds the true RMSE in 92 to 93 % of cases at 75 to 150
    correlation times, where the correlation itself is hard to see, and in 94 % from 300 on (benchmarks/README.md). It
    says how the RMSE would vary over other stretches of the same kind of drive: not over other drives, receivers or
    days, and it carries no p-value.

    Source: Künsch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17 (1989).
    """
    from scipy.special import stdtrit

    n = len(squares)
    if n == 0 or not np.isfinite(squares).all():
        return RecordingInterval(np.nan, np.nan, np.nan, 0, np.nan)
    tau = correlation_rows(squares)
    block = int(min(n, max(np.ceil(FACTOR * tau), np.ceil(n ** (1 / 3)))))
    rmse = float(np.sqrt(np.mean(squares)))
    if n < MIN_CORRELATION_TIMES * tau:
        return RecordingInterval(rmse, np.nan, np.nan, block, tau)
    means, blocks = _resampled_means(squares, block), n / block
    half = 0.0 if not means.max() > 0 else np.inf  # of the logarithm of the root
    if means.min() > 0:
        scale = np.sqrt(blocks / (blocks - 1))
        half = float(stdtrit(blocks - 1, (1 + confidence) / 2) * np.std(np.log(means)) * scale) / 2
    return RecordingInterval(rmse, rmse * np.exp(-half), rmse * np.exp(half), block, tau)


def correlation_rows(values: FloatArray) -> float:
    """Return 1 + 2 sum rho_k, the rows that count as one independent value; at least 1.

    The sum ends before the first pair rho_{2k} + rho_{2k+1} that is not positive.

    Source: Geyer, "Practical Markov chain Monte Carlo", Statistical Science 7 (1992), the initial positive sequence.
    """
    rho = autocorrelation(values)
    pairs = rho[: len(rho) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)
    kept = pairs[: ends[0]] if len(ends) else pairs
    return max(1.0, float(2 * kept.sum() - 1.0))


def autocorrelation(values: FloatArray, last: int | None = None) -> FloatArray:
    """Return the autocorrelation of (n, ...) values at lags 0, 1, ... n - 1, or to ``last``, along the first axis.

    Of a constant it is 1, 0, 0, ...
    """
    n = len(values)
    size = n if last is None else min(last + 1, n)
    series = np.ascontiguousarray(np.moveaxis(values, 0, -1))
    centred = series - series.mean(axis=-1, keepdims=True)
    power = np.vecdot(centred, centred)
    constant = power <= n * (1e-14 * np.abs(series).max(axis=-1, initial=0.0)) ** 2
    lags = _lagged_products(centred, size) / np.where(constant, 1.0, power)
    return np.where(constant, np.eye(size, 1).reshape(-1, *[1] * (values.ndim - 1)), lags)


def _lagged_products(centred: FloatArray, size: int) -> FloatArray:
    """Return (size, ...) the sums of the products of (..., n) values that are 0, 1, ... apart."""
    n = centred.shape[-1]
    if size <= DIRECT:
        return np.array([np.vecdot(centred[..., lag:], centred[..., : n - lag]) for lag in range(size)])
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2  # with n zeros behind, so that nothing wraps around
    return np.asarray(np.moveaxis(np.fft.irfft(spectrum, 2 * n)[..., :size], -1, 0))


def _resampled_means(values: FloatArray, block: int) -> FloatArray:
    """Return (RESAMPLES,) means of series of n values made of blocks; the last block is cut to fit."""
    n = len(values)
    sums = np.concatenate([[0.0], np.cumsum(values)])
    whole, rest = divmod(n, block)
    starts = np.random.default_rng(_SEED).integers(0, n - block + 1, (_RESAMPLES, whole + 1))
    total = (sums[starts[:, :-1] + block] - sums[starts[:, :-1]]).sum(axis=1)
    last = sums[starts[:, -1] + rest] - sums[starts[:, -1]]
    return np.asarray((total + last) / n)


LAGS = 20
MIN_INNOVATIONS = 30
"""Of fewer innovations nothing is said."""


class Whiteness(NamedTuple):
    """The Ljung-Box test of one row's innovations.

    Attributes:
        first: autocorrelation at lag 1; over 0: the filter lags behind, below: it overshoots.
        p: of the test over `LAGS` lags; small: not white.
    """

    first: float
    p: float

    @property
    def white(self) -> bool:
        """Whether nothing speaks against it, at 5 %."""
        return not self.p < 0.05


def whiteness_of_rows(innovation: FloatArray) -> list[Whiteness]:
    """Test each column of (m, r) innovations in their order; NaN (the row was absent) is left out.

    With rho_k their autocorrelation::

        Q = m (m + 2) sum_k rho_k^2/(m - k),  k = 1 ... LAGS,  chi-square with LAGS degrees of freedom

    Source: Ljung and Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978).
    """
    if np.isfinite(innovation).all():
        return _tested(innovation)
    return [test for column in innovation.T for test in _tested(column[np.isfinite(column), None])]


def _tested(columns: FloatArray) -> list[Whiteness]:
    from scipy.special import chdtrc  # scipy.stats would take half a second to import in every worker

    m = len(columns)
    if m < MIN_INNOVATIONS:
        return [Whiteness(np.nan, np.nan)] * columns.shape[1]
    lags = np.arange(1, LAGS + 1)
    rho = autocorrelation(columns, LAGS)[1:]
    statistic = m * (m + 2) * np.sum(rho**2 / (m - lags)[:, None], axis=0)
    return list(map(Whiteness, rho[0].tolist(), chdtrc(LAGS, statistic).tolist()))
