"""A family of means at once: the largest studentised mean of all, by the bootstrap over common seeds."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals import ROUNDING

RESAMPLES = 1999
SEED = 14
"""Fixed: the same rows give the same verdicts."""

ROWS_AT_ONCE = 16
"""Means that go through the bootstrap together: so many stay in the processor's cache."""

FLAT = 1e-12
"""A resample with less of the variance than this is one value, drawn n times: its t is infinite."""


@dataclass(frozen=True, eq=False)
class MaxT:
    """The distribution of the largest |t| of a family.

    Attributes:
        maxima: (B,) in ascending order; infinite where a resample had no spread.
        share: how much of the family's level is this distribution's; 1 where it is the whole family's.
    """

    maxima: FloatArray
    share: float = 1.0

    def p(self, t: FloatArray) -> FloatArray:
        """Return the p of (k,) |t|, corrected for the family: (1 + resamples whose largest is as large)/(B + 1)."""
        larger = len(self.maxima) - np.searchsorted(self.maxima, t, side="left")
        p = (1.0 + larger) / (1.0 + len(self.maxima)) / self.share
        return np.asarray(np.minimum(1.0, p), dtype=np.float64)

    def critical(self, level: float) -> float:
        """Return the |t| from which on p is at most ``level``; infinite where none is."""
        allowed = int(np.floor(level * self.share * (1 + len(self.maxima)) + 1e-9)) - 1
        if allowed < 0:
            return np.inf
        above: float = self.maxima[len(self.maxima) - 1 - allowed]
        return float(np.nextafter(above, np.inf))


def standard_errors(d: FloatArray) -> FloatArray:
    """Return the standard errors (m,) of the means of (m, n) values; 0 of values that differ by rounding alone."""
    error = d.std(axis=1, ddof=1) / np.sqrt(d.shape[1])
    return np.where(error <= ROUNDING * np.maximum(1.0, np.abs(d).max(axis=1)), 0.0, error)


def studentised(distance: FloatArray, error: FloatArray) -> FloatArray:
    """Return distance/error (m,); without an error it is infinite, or 0 where there is no distance."""
    exact = np.where(distance > 0, np.inf, 0.0)
    return np.divide(distance, error, out=exact, where=error > 0)


def max_t(d: FloatArray, resamples: int = RESAMPLES, seed: int = SEED) -> MaxT:
    """Return the distribution of max |t| of (m, n) log ratios under means of 0; constant rows add nothing to it.

    Seeds are drawn with replacement, the same for all m, so that what is common to comparisons (a method, a seed)
    stays common. Of each resample b, with x centred::

        t_b = mean(x_b)/(s(x_b)/sqrt(n))        maximum_b = max over m of |t_b|

    Sign flips would be exact for symmetric differences; of skewed ones they err in 17 % of studies of 60
    scenarios where this stays near 5 % (benchmarks/README.md). The price is that 5 seeds show little.

    Source: Romano and Wolf, "Exact and approximate stepdown methods for multiple hypothesis testing", JASA 100 (2005);
    Hall, "The Bootstrap and Edgeworth Expansion", Springer (1992), 3.3 for studentising.
    """
    n = d.shape[1]
    share = _shares(n, resamples, seed)
    largest = np.where(share.max(axis=0) == 1.0, np.inf, 0.0)  # one seed, drawn n times
    scattered = d[standard_errors(d) > 0]
    for start in range(0, len(scattered), ROWS_AT_ONCE):
        np.maximum(largest, _largest_squares(scattered[start : start + ROWS_AT_ONCE], share), out=largest)
    return MaxT(np.sort(np.sqrt((n - 1) * largest)))


def _largest_squares(d: FloatArray, share: FloatArray) -> FloatArray:
    """Return (B,) the largest mean^2/variance of the rows of (k, n)."""
    centred = d - d.mean(axis=1, keepdims=True)
    centred /= np.sqrt(np.mean(centred**2, axis=1, keepdims=True))
    mean2 = (centred @ share) ** 2
    variance = (centred**2) @ share - mean2
    flat = variance < FLAT
    ratio = np.divide(mean2, variance, out=mean2, where=~flat)
    ratio[flat] = np.inf
    largest: FloatArray = ratio.max(axis=0)
    return largest


@lru_cache(maxsize=4)
def _shares(n: int, resamples: int, seed: int) -> FloatArray:
    """Return the share (n, B) of each of n seeds in each resample."""
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=resamples)
    return np.ascontiguousarray(drawn.T / n)
