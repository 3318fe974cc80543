"""The share that an adaptation gains of what the true R would gain."""

import numpy as np
import numpy.typing as npt

from jerkbench.evaluation.statistics.intervals import RESAMPLES, SEED, Interval


def oracle_gap_closed(
    none: npt.ArrayLike, adapted: npt.ArrayLike, oracle: npt.ArrayLike, confidence: float = 0.95
) -> Interval:
    """Return (mean none - mean adapted)/(mean none - mean oracle) with a percentile bootstrap interval over the seeds.

    1 is the oracle, 0 is no adaptation, below 0 it harms. The i-th values of the three (n,) belong to the same seed.
    NaN where the gap is not there: where the interval of mean none - mean oracle has 0 in it.
    """
    values = np.column_stack([np.asarray(one, dtype=np.float64) for one in (none, adapted, oracle)])
    values = values[np.isfinite(values).all(axis=1)]
    n = len(values)
    if n < 2:
        return Interval(np.nan, np.nan, np.nan, n)
    picked = np.random.default_rng(SEED).integers(0, n, (RESAMPLES, n))
    means = values[picked].mean(axis=1)
    tails = [(1 - confidence) / 2, (1 + confidence) / 2]
    gap = means[:, 0] - means[:, 2]
    if np.quantile(gap, tails[0]) <= 0:
        return Interval(np.nan, np.nan, np.nan, n)
    low, high = np.quantile((means[:, 0] - means[:, 1]) / gap, tails)
    first, second, third = values.mean(axis=0)
    return Interval(float((first - second) / (first - third)), float(low), float(high), n)
