"""The interval of a mean of few values that may be skewed."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals.student import student_intervals

ENOUGH = 20
"""Of so many values Student's interval holds a skewed mean nearly as often as it says; of fewer it is widened."""

SHRUNK = 0.6
"""So much of the skewness of few values is taken: all of it would be too cautious where tails are heavy."""

STRAIGHT = 1e-7
"""A cubic that bends less than this is its straight line, but for rounding."""


def few_intervals(d: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of the intervals for the means of (k, n) values; NaN of fewer than two.

    Student's; of 3 to `ENOUGH` - 1 values the shortest that holds it and Hall's, whose cubic removes skewness::

        g(t) = t + c t^2/(3 sqrt(n)) + c^2 t^3/(27 n) + c/(6 sqrt(n)),   c = .6 n/((n - 1)(n - 2)) sum ((d - mean)/s)^3
        mean - g^-1(+-q) s/sqrt(n),   q of Student's t

    Student's alone misses a skewed mean on the side of the tail that was not seen. Hall's alone is too short on the
    other side of few values, and of many with heavy tails (`docs/statistics.md` has the coverage of both, and joined).

    Source: Hall, "On the removal of skewness by transformation", J. R. Stat. Soc. B 54 (1992), 221 to 228,
    doi:10.1111/j.2517-6161.1992.tb01876.x; to shrink c, to take Student's q and to join the two is ours.
    """
    low, high = student_intervals(d, confidence)
    if not 2 < d.shape[1] < ENOUGH:
        return low, high
    below, above = hall_intervals(d, confidence, SHRUNK)
    return np.fmin(low, below), np.fmax(high, above)


def hall_intervals(d: FloatArray, confidence: float, share: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return Hall's ends (k,), (k,) with a ``share`` of the skewness, n > 2; NaN of values that do not scatter."""
    from scipy.special import stdtrit

    n, mean, s = d.shape[1], d.mean(axis=1), np.std(d, axis=1, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness = n / ((n - 1) * (n - 2)) * np.sum(((d - mean[:, None]) / s[:, None]) ** 3, axis=1)
    q, bend = float(stdtrit(n - 1, (1 + confidence) / 2)), share * skewness / np.sqrt(n)
    low, high = (mean - _untransformed(end, bend) * s / np.sqrt(n) for end in (q, -q))
    return low, high


def _untransformed(y: float, bend: FloatArray) -> FloatArray:
    """Return t (k,) where g(t) = y; ``bend`` (k,) is c/sqrt(n)."""
    straight = y - bend / 6
    curved = np.abs(bend) > STRAIGHT
    return np.asarray(np.divide(3 * (np.cbrt(1 + bend * straight) - 1), bend, out=straight, where=curved))
