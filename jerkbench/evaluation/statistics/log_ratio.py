"""Two methods on common seeds: their log ratios, with the runs that either lost or that locked out."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.statistics.intervals.signed_over_seeds import ROUNDING
from jerkbench.evaluation.statistics.samples import Samples

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
    def sizes(self) -> tuple[int, int]:
        """Seeds of a, and of b, which are the same."""
        return self.n, self.n

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
    return log_ratios_of([(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))])[0]


def log_ratios_of(errors: Iterable[tuple[FloatArray, FloatArray]]) -> list[LogRatios]:
    """Return what `log_ratios` gives for each pair of errors; those of one size are computed together."""
    known = [_known(a, b) for a, b in errors]
    first, second = (Samples.of([pair[side] for pair in known]) for side in (0, 1))
    ratios: dict[int, LogRatios] = {}
    for (places, ours), (_, theirs) in zip(first.by_size(), second.by_size(), strict=True):
        ratios.update(zip(places.tolist(), _of_one_size(ours, theirs), strict=True))
    return [ratios[place] for place in range(len(known))]


def _known(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out the seeds of which nothing is said."""
    known = (first >= 0) & (second >= 0)
    return (first, second) if known.all() else (first[known], second[known])


def _of_one_size(first: FloatArray, second: FloatArray) -> list[LogRatios]:
    """Return the log ratios of the rows of two (k, n) errors."""
    lost = np.stack([np.isinf(first), np.isinf(second)], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        d = np.log(first) - np.log(second)
        near = np.abs(first - second) <= ROUNDING * np.minimum(first, second)
    same = (first == second) | (near & ~lost.any(axis=-1))
    d = np.where(same, 0.0, d)
    return list(map(LogRatios, d, lost, _locked(d)))


def _locked(d: FloatArray) -> BoolArray:
    """Return (k, n, 2) which finite ratios (k, n) lie `LOCKED_OUT` times above, and below, the median of their row."""
    finite, limit = np.isfinite(d), np.log(LOCKED_OUT)
    locked = np.zeros((*d.shape, 2), dtype=bool)
    if d.size:
        with np.errstate(invalid="ignore"):
            wide = ~(finite.all(axis=1) & (d.max(axis=1) - d.min(axis=1) <= limit)) & finite.any(axis=1)
        for row in np.flatnonzero(wide):
            away = np.where(finite[row], d[row] - np.median(d[row][finite[row]]), 0.0)
            locked[row] = np.column_stack([away > limit, away < -limit])
    return locked
