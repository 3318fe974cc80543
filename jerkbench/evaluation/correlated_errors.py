"""Statistics of correlated errors: the interval of the RMSE of one recording, and a whiteness test of innovations."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray

_RESAMPLES = 1999
_SEED = 20
"""Seed of the bootstrap. It is fixed, so that equal errors give equal intervals."""

FACTOR = 12
"""Length of a block in correlation times. With shorter blocks, their means are correlated and the interval is too
short."""

DIRECT = 32
"""Maximum number of lags for which direct sums of products are faster than a Fourier transform."""

MIN_CORRELATION_TIMES = 75
"""Minimum length of a recording for an interval, in correlation times.

With 40 correlation times, the 95 % interval contained the true RMSE in only 90 % of cases.
"""


class RecordingInterval(NamedTuple):
    """The RMSE of one recording with its interval.

    Attributes:
        rmse: RMSE over all rows, NaN without rows.
        low: lower end of the interval. ``low`` is NaN if the recording is shorter than `MIN_CORRELATION_TIMES`
            correlation times.
        high: upper end of the interval. ``high`` is NaN if ``low`` is NaN.
        block: number of rows in a block of the bootstrap.
        correlation: correlation time of the squared errors (integrated autocorrelation), as a number of rows.
    """

    rmse: float
    low: float
    high: float
    block: int
    correlation: float


def block_interval(squares: FloatArray) -> RecordingInterval:
    """Return the RMSE from the (n,) squared errors of successive rows, with a 95 % moving-block bootstrap interval.

    A resample consists of blocks of l successive rows, drawn with replacement from all n - l + 1 blocks. The errors
    within a block therefore remain correlated. The block length l is at least `FACTOR` times the correlation time, and
    at least n^(1/3). Let s be the standard deviation of the logarithms of the resampled means, and b = n/l the number
    of blocks. The interval of the mean square is the mean square of the rows times exp(-+ t_{b-1} s sqrt(b/(b - 1))).

    In simulations with autoregressive errors of three axes, the 95 % interval contains the true RMSE in 92 to 93 % of
    cases for recordings of 75 to 150 correlation times. For recordings of at least 300 correlation times, the coverage
    is 94 % (benchmarks/README.md). For recordings of fewer than 75 correlation times, the correlation time is hard to
    estimate. The interval describes the variation of the RMSE over other parts of the same kind of drive. The interval
    does not describe the variation over other drives, receivers or days, and no p value is computed from the interval.

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
    half = 0.0 if not means.max() > 0 else np.inf  # half width of the interval of log(RMSE)
    if means.min() > 0:
        scale = np.sqrt(blocks / (blocks - 1))
        half = float(stdtrit(blocks - 1, 0.975) * np.std(np.log(means)) * scale) / 2
    return RecordingInterval(rmse, rmse * np.exp(-half), rmse * np.exp(half), block, tau)


def correlation_rows(values: FloatArray) -> float:
    """Return the correlation time 1 + 2 sum rho_k of (n,) values, as a number of rows. The result is at least 1.

    If the correlation time is tau rows, tau successive rows contain the information of one independent value. The sum
    of the autocorrelations rho_k ends before the first pair rho_{2k} + rho_{2k+1} that is not positive.

    Source: Geyer, "Practical Markov chain Monte Carlo", Statistical Science 7 (1992), the initial positive sequence.
    """
    rho = autocorrelation(values)
    pairs = rho[: len(rho) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)
    positive = pairs[: ends[0]] if len(ends) else pairs
    return max(1.0, float(2 * positive.sum() - 1.0))


def autocorrelation(values: FloatArray, last: int | None = None) -> FloatArray:
    """Return the autocorrelation of (n, ...) values along the first axis, at the lags 0 to n - 1, or 0 to ``last``.

    The autocorrelation of constant values is 1 at lag 0, and 0 at all other lags.
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
    """Return the sums (size, ...) of the products of (..., n) values with themselves at the lags 0 to ``size`` - 1."""
    n = centred.shape[-1]
    if size <= DIRECT:
        return np.array([np.vecdot(centred[..., lag:], centred[..., : n - lag]) for lag in range(size)])
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2  # n appended zeros avoid circular correlation
    return np.asarray(np.moveaxis(np.fft.irfft(spectrum, 2 * n)[..., :size], -1, 0))


def _resampled_means(values: FloatArray, block: int) -> FloatArray:
    """Return the means (_RESAMPLES,) of block resamples. The last block is cut so that each resample has n values."""
    n = len(values)
    sums = np.concatenate([[0.0], np.cumsum(values)])
    full, rest = divmod(n, block)
    starts = np.random.default_rng(_SEED).integers(0, n - block + 1, (_RESAMPLES, full + 1))
    total = (sums[starts[:, :-1] + block] - sums[starts[:, :-1]]).sum(axis=1)
    last = sums[starts[:, -1] + rest] - sums[starts[:, -1]]
    return np.asarray((total + last) / n)


LAGS = 20
MIN_INNOVATIONS = 30
"""Minimum number of innovations for the test."""


class Whiteness(NamedTuple):
    """The Ljung-Box test of the innovations of one row of the measurement vector.

    Attributes:
        first: autocorrelation at lag 1. ``first`` is positive if the filter lags behind, and negative if it overshoots.
        p: p value of the test over `LAGS` lags. A small p value means that the innovations are not white.
    """

    first: float
    p: float

    @property
    def white(self) -> bool:
        """True if the test does not reject whiteness at the 5 % level."""
        return not self.p < 0.05


def whiteness_of_rows(innovation: FloatArray) -> list[Whiteness]:
    """Return the Ljung-Box test of each column of (m, r) innovations of successive updates.

    NaN values (the row was not measured) are left out. The statistic Q depends on the autocorrelations rho_k at the
    lags k::

        Q = m (m + 2) sum_k rho_k^2/(m - k),  k = 1 ... LAGS,  chi-square with LAGS degrees of freedom

    Source: Ljung and Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978).
    """
    if np.isfinite(innovation).all():
        return _tested(innovation)
    return [test for column in innovation.T for test in _tested(column[np.isfinite(column), None])]


def _tested(columns: FloatArray) -> list[Whiteness]:
    from scipy.special import chdtrc  # importing scipy.stats takes half a second

    m = len(columns)
    if m < MIN_INNOVATIONS:
        return [Whiteness(np.nan, np.nan)] * columns.shape[1]
    lags = np.arange(1, LAGS + 1)
    rho = autocorrelation(columns, LAGS)[1:]
    statistic = m * (m + 2) * np.sum(rho**2 / (m - lags)[:, None], axis=0)
    return list(map(Whiteness, rho[0].tolist(), chdtrc(LAGS, statistic).tolist()))
