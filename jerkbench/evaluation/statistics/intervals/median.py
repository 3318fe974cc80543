"""The median with its interval, and the quartiles: whatever the distribution is, lost runs included."""

import numpy as np

from jerkbench.arrays import FloatArray

NEARLY = 0.93
"""A median's interval that covers at least this is given; of 5 values the whole range covers 93.75 %."""


def quantiles_of_rows(values: FloatArray, confidence: float = 0.95) -> tuple[FloatArray, ...]:
    """Return median, both ends of its interval, lower and upper quartile, (k,) each, of (k, n) values without NaN."""
    if values.shape[1] == 0:
        return (np.full(len(values), np.nan),) * 5
    ordered = np.sort(values, axis=1)
    lower, middle, upper = (_between(ordered, share) for share in (0.25, 0.5, 0.75))
    return middle, *median_intervals(ordered, confidence), lower, upper


def median_intervals(ordered: FloatArray, confidence: float, *, exact: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of the intervals of the medians of (k, n) values in ascending order, some infinite.

    Between the k-th and the (k+1)-th value from both ends, of which one covers more than asked and the other less, by
    interpolation; where either is infinite, or an ``exact`` one is asked for, the outer one, which inverts the sign
    test. NaN where even the whole range covers less than ``NEARLY``, or of higher levels and exactly, less than asked.

    Source: Hettmansperger and Sheather, "Confidence intervals based on interpolated order statistics", Statistics and
    Probability Letters 4 (1986).
    """
    from scipy.special import bdtr

    n = ordered.shape[1]
    if n < 2 or 1 - 2 * 0.5**n < (confidence if exact or confidence > 0.95 else min(confidence, NEARLY)):
        return np.full(len(ordered), np.nan), np.full(len(ordered), np.nan)
    below = bdtr(np.arange(n), n, 0.5)  # P(at most k of n lie below the median)
    k = max(1, int(np.searchsorted(below, (1 - confidence) / 2)))  # the largest k that covers enough
    wide, narrow = 1 - 2 * float(below[k - 1]), 1 - 2 * float(below[k])
    part = min(1.0, max(0.0, (wide - confidence) / (wide - narrow))) if k < n - k and not exact else 0.0
    weight = (n - k) * part / (k + (n - 2 * k) * part) if part else 0.0
    lower, upper = ordered.T, ordered.T[::-1]
    return _mixed(lower[k - 1], lower[k], weight), _mixed(upper[k - 1], upper[k], weight)


def _between(ordered: FloatArray, share: float) -> FloatArray:
    """Return the quantile of each row of values in ascending order, between two of them their mixture."""
    place = share * (ordered.shape[1] - 1)
    left = int(place)
    first, second = ordered[:, left], ordered[:, min(left + 1, ordered.shape[1] - 1)]
    infinite = np.isinf(second) & (place > left)
    return np.where(infinite, second, _mixed(first, second, place - left))


def _mixed(outer: FloatArray, inner: FloatArray, weight: float) -> FloatArray:
    """Return outer + weight (inner - outer); where either is infinite, the outer one."""
    kept = (outer == inner) | np.isinf(outer) | np.isinf(inner) | (weight == 0)
    with np.errstate(invalid="ignore", over="ignore"):
        mixed: FloatArray = np.where(kept, outer, outer + weight * (inner - outer))
    return mixed
