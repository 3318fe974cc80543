"""The bias-corrected and accelerated bootstrap of a mean, for many samples of one size at once."""

from functools import lru_cache

import numpy as np

from jerkbench.arrays import FloatArray

TIE = 1e-12
"""Of values that lie within 1 of each other: a resample's mean this near to the mean is the mean, but for rounding."""


def bca_ends(values: FloatArray, level: float, resamples: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of the intervals of the means of (k, n) values, each row within 1 of its mean.

    With m_1 <= ... <= m_B the means of B resamples of a row x, and d_i = x_i - mean(x)::

        z0    = Phi^-1(share of m_b < mean(x), of those that are equal a half)
        a     = sum_i d_i^3/(6 (sum_i d_i^2)^(3/2))
        end_c = quantile of m at Phi(z0 + (z0 + z_c)/(1 - a (z0 + z_c))),   z_c = -+Phi^-1((1 + level)/2)

    Every row meets the same resamples, whatever stands beside it. Their means are one matrix product with how often
    each value was drawn, which is much faster than to gather the values.

    Args:
        values: (k, n), n > 1, no row all equal.
        level: between 0 and 1.
        resamples: B.
        seed: of the draws.

    Source: Efron, "Better Bootstrap Confidence Intervals", JASA 82 (1987); d is n - 1 times what the jackknife gives.
    """
    from scipy.special import ndtr, ndtri

    mean = values.mean(axis=1, keepdims=True)
    means = np.sort(values @ _shares(values.shape[1], resamples, seed), axis=1)
    below = np.count_nonzero(means < mean - TIE, axis=1) + np.count_nonzero(means <= mean + TIE, axis=1)
    z0 = ndtri(below / (2 * resamples))
    deviation = values - mean
    a = np.sum(deviation**3, axis=1) / (6 * np.sum(deviation**2, axis=1) ** 1.5)
    z = ndtri((1 + level) / 2)
    low, high = (_quantile(means, ndtr(z0 + (z0 + end) / (1 - a * (z0 + end)))) for end in (-z, z))
    return low, high


@lru_cache(maxsize=2)
def _shares(n: int, resamples: int, seed: int) -> FloatArray:
    """Return the share (n, B) of each of n values in each resample."""
    drawn = np.random.default_rng(seed).integers(0, n, (resamples, n))
    places = drawn + n * np.arange(resamples)[:, None]
    times = np.bincount(places.ravel(), minlength=n * resamples)
    return np.asarray(times.reshape(resamples, n).T / n, dtype=np.float64)


def _quantile(ordered: FloatArray, share: FloatArray) -> FloatArray:
    """Return the value at (k,) shares of the way through (k, B) ordered values, between two of them their mixture."""
    place = share * (ordered.shape[1] - 1)
    left = np.minimum(place.astype(np.int64), ordered.shape[1] - 2)
    rows = np.arange(len(ordered))
    first, second = ordered[rows, left], ordered[rows, left + 1]
    return np.asarray(first + (place - left) * (second - first), dtype=np.float64)
