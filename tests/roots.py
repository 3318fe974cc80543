"""The interval of a mean of few values by a search for the root of Hall's cubic: slow, and by scipy alone."""

import numpy as np
from scipy.optimize import brentq
from scipy.stats import skew, t, ttest_1samp

SHARE, ENOUGH = 0.6, 20
"""As `jerkbench.evaluation.intervals` has them, said once more."""


def hall_ends(values, share):
    """Lower and upper end."""
    n, c = len(values), share * skew(values, bias=False)
    q = t.ppf(0.975, n - 1)

    def cubic(x, y):
        return x + c * x**2 / (3 * np.sqrt(n)) + c**2 * x**3 / (27 * n) + c / (6 * np.sqrt(n)) - y

    error = values.std(ddof=1) / np.sqrt(n)
    return [values.mean() - brentq(cubic, -1e3, 1e3, args=(end,), xtol=1e-14, rtol=1e-14) * error for end in (q, -q)]


def mean_ends(values):
    """Student's; of 3 to 19 values the shortest interval that holds it and Hall's with his cubic."""
    ends = ttest_1samp(values, 0).confidence_interval(0.95)
    if not 2 < len(values) < ENOUGH:
        return ends.low, ends.high
    hall = hall_ends(values, SHARE)
    return min(ends.low, hall[0]), max(ends.high, hall[1])
