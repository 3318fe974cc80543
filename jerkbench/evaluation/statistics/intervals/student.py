"""Student's interval of a mean."""

import numpy as np

from jerkbench.arrays import FloatArray


def student_interval(d: FloatArray, confidence: float) -> tuple[float, float]:
    """Return the ends of Student's interval for the mean of ``d``; NaN of fewer than two."""
    low, high = student_intervals(np.asarray(d)[None], confidence)
    return float(low[0]), float(high[0])


def student_intervals(d: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Return the ends (k,), (k,) of Student's intervals for the means of (k, n) values; NaN of fewer than two."""
    from scipy.special import stdtrit

    n = d.shape[1]
    if n < 2:
        return np.full(len(d), np.nan), np.full(len(d), np.nan)
    mean = d.mean(axis=1)
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * np.std(d, axis=1, ddof=1) / np.sqrt(n)
    return mean - half, mean + half
