"""The verdict on the consistency of a filter, from the averages of its runs."""

import numpy as np
import numpy.typing as npt

from jerkbench.evaluation.intervals import student_intervals
from jerkbench.evaluation.over_seeds import MIN_BOOTSTRAP, mean_interval

_CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN = "consistent", "overconfident", "too cautious", "not known"

NEAR = (0.5, 2.0)
"""A filter is consistent if the ratio of the average to its expectation is within these limits."""


def chi2_band(dof: float, samples: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return the band of the average of ``samples`` independent chi-square values with ``dof`` degrees each.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """
    from scipy.stats import chi2

    low, high = chi2.ppf([(1 - confidence) / 2, (1 + confidence) / 2], dof * samples) / samples
    return float(low), float(high)


def runs_verdict(averages: npt.ArrayLike, expected: float, confidence: float = 0.95, failed: int = 0) -> str:
    """Judge the averages (n,) of independent runs by the interval of their mean; one run has no interval.

    ::

        overconfident   the whole interval is above ``expected``
        too cautious    the whole interval is below ``expected``
        consistent      the interval contains ``expected`` and lies within 0.5 to 2 times this value
        not known       the interval contains ``expected``, but is wider

    From 5 runs on, the interval is that of `mean_interval`. For fewer runs it is Student's interval of the logarithms.
    It is an interval of the geometric mean, which is at most the mean, so "overconfident" holds for the mean too. If
    runs ``failed`` or have no finite average, only "overconfident" can be stated.
    """
    values = np.asarray(averages, dtype=np.float64)
    finite = values[np.isfinite(values)]
    low = high = np.nan
    if len(finite) >= MIN_BOOTSTRAP:
        _, low, high = mean_interval(finite, confidence)
    elif len(finite) > 1 and finite.min() > 0:
        ((low,), (high,)) = np.exp(student_intervals(np.log(finite)[None], confidence))
    if low > expected:
        return OVERCONFIDENT
    if failed + len(values) > len(finite):
        return UNKNOWN
    if high < expected:  # each comparison with NaN is false
        return CAUTIOUS
    return _CONSISTENT if NEAR[0] * expected <= low and high <= NEAR[1] * expected else UNKNOWN
