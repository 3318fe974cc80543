"""Two methods on common seeds: their log ratios, with the runs that either lost or that locked out."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.statistics.intervals.signed_over_seeds import ROUNDING

LOCKED_OUT = 10.0
"""A run whose ratio is so many times its median has locked out: it is no scatter, and no mean describes it."""


@dataclass(frozen=True, eq=False)
class LogRatios:
    """d_i = log(a_i/b_i) over the seeds that both have; a lost run is larger than every number.

    Attributes:
        d: (n,) infinite where a alone lost the run, minus infinite where b alone did, 0 where both did.
        lost: (n, 2) whether a, and whether b, lost the run.
        locked: (n, 2) whether a, and whether b, locked out: its ratio is `LOCKED_OUT` times the median ratio.
    """

    d: FloatArray
    lost: BoolArray
    locked: BoolArray

    @property
    def n(self) -> int:
        """Seeds that both have."""
        return len(self.d)

    @property
    def turned(self) -> "LogRatios":
        """Those of b to a."""
        return LogRatios(-self.d, self.lost[:, ::-1], self.locked[:, ::-1])

    @cached_property
    def plain(self) -> bool:
        """Whether every run went well, and a mean may stand for them."""
        return not (self.lost.any() or self.locked.any() or np.isinf(self.d).any())

    @cached_property
    def failures(self) -> tuple[int, int]:
        """Runs that a, and that b, lost or locked out in."""
        failed = self.lost | self.locked
        return int(failed[:, 0].sum()), int(failed[:, 1].sum())


def log_ratios(a: npt.ArrayLike, b: npt.ArrayLike) -> LogRatios:
    """Return the log ratios of (n,) errors of a to those of b, of which the i-th belong to the same seed.

    An infinite error is a lost run; of a seed where either is NaN (the metric did not apply), or negative, nothing is
    said. What differs by rounding is equal. An error of 0 beside another that is not is smaller by any factor.
    """
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    known = (first >= 0) & (second >= 0)
    first, second = first[known], second[known]
    lost = np.column_stack([np.isinf(first), np.isinf(second)])
    with np.errstate(divide="ignore", invalid="ignore"):
        d = np.log(first) - np.log(second)
        near = np.abs(first - second) <= ROUNDING * np.minimum(first, second)
        same = (first == second) | (near & ~lost.any(axis=1))
    d = np.where(same, 0.0, d)
    return LogRatios(d, lost, _locked(d))


def _locked(d: FloatArray) -> BoolArray:
    """Return (n, 2) which finite ratios lie `LOCKED_OUT` times above, and below, their median."""
    finite = np.isfinite(d)
    limit = np.log(LOCKED_OUT)
    if not finite.any() or (finite.all() and d.max() - d.min() <= limit):
        return np.zeros((len(d), 2), dtype=bool)
    with np.errstate(invalid="ignore"):
        away = np.where(finite, d - np.median(d[finite]), 0.0)
    return np.column_stack([away > limit, away < -limit])
