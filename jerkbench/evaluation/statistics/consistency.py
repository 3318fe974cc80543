"""NEES and NIS against chi-square: the band in which the average of a consistent filter lies, and the verdict."""

import numpy as np
import numpy.typing as npt

from jerkbench.evaluation.statistics.intervals import student_interval
from jerkbench.evaluation.statistics.over_seeds import FEW, mean_interval

CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN = "consistent", "overconfident", "too cautious", "not known"

NEAR = (0.5, 2.0)
"""An average over its expectation within these is near enough to be believed."""


def chi2_band(dof: float, samples: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return the band of the average of ``samples`` independent chi-square values of ``dof`` degrees each.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """
    from scipy.stats import chi2

    low, high = chi2.ppf([(1 - confidence) / 2, (1 + confidence) / 2], dof * samples) / samples
    return float(low), float(high)


def runs_verdict(averages: npt.ArrayLike, expected: float, confidence: float = 0.95, lost: int = 0) -> str:
    """Judge (n,) averages of independent runs by the interval of their mean; of one run nothing is known.

    ::

        overconfident   the whole interval is above ``expected``
        too cautious    the whole interval is below it
        consistent      the interval holds it, and lies within 0.5 to 2 times it
        not known       the interval holds it, and more: to reject nothing is no proof

    From 5 runs on the interval is that of `mean_interval`; of fewer it is Student's on the logarithms. That one is of
    the geometric mean, which is at most the mean: what is above ``expected`` is all the more so. The runs that were
    ``lost``, or have no finite average, were none of the consistent ones: of the others only "overconfident" holds.
    """
    values = np.asarray(averages, dtype=np.float64)
    kept = values[np.isfinite(values)]
    low = high = np.nan
    if len(kept) >= FEW:
        _, low, high, _ = mean_interval(kept, confidence)
    elif len(kept) > 1 and kept.min() > 0:
        low, high = np.exp(student_interval(np.log(kept), confidence))
    if low > expected:
        return OVERCONFIDENT
    if lost + len(values) > len(kept):
        return UNKNOWN
    if high < expected:  # each comparison with NaN is false
        return CAUTIOUS
    return CONSISTENT if NEAR[0] * expected <= low and high <= NEAR[1] * expected else UNKNOWN
