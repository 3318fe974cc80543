"""The number that stands for the errors of a cell, with its interval: `few_seeds`, or `median` where runs were lost."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.statistics.intervals.few_seeds import few_intervals
from jerkbench.evaluation.statistics.intervals.median import quantiles_of_rows
from jerkbench.evaluation.statistics.intervals.signed_over_seeds import ROUNDING
from jerkbench.evaluation.statistics.log_ratio import LOCKED_OUT
from jerkbench.evaluation.statistics.samples import Samples

GEOMETRIC, MEDIAN, MEAN = "geometric mean", "median", "mean"


@dataclass(frozen=True)
class Centre:
    """What stands for the errors of a cell.

    Attributes:
        kind: `GEOMETRIC` where every run went well, `MEDIAN` where runs were lost or locked out, or an error is 0.
        value: infinite where half of the runs or more were lost.
        low: lower end of the 95 % interval; NaN where there is none.
        high: upper end; infinite where it reaches the lost runs.
        quartiles: of the runs, a lost one larger than every number.
        locked: runs that are `LOCKED_OUT` times their median.
    """

    kind: str
    value: float
    low: float
    high: float
    quartiles: tuple[float, float]
    locked: int


@dataclass(frozen=True, eq=False)
class Centres:
    """What stands for the errors of many cells: the fields of `Centre`, (k,) each."""

    kind: NDArray[np.object_]
    value: FloatArray
    low: FloatArray
    high: FloatArray
    lower_quartile: FloatArray
    upper_quartile: FloatArray
    locked: IntArray

    @classmethod
    def of_nothing(cls, count: int, kind: str = MEDIAN) -> "Centres":
        """Return those of ``count`` cells without a value."""
        value, low, high, lower, upper = (np.full(count, np.nan) for _ in range(5))
        return cls(np.full(count, kind, dtype=object), value, low, high, lower, upper, np.zeros(count, np.int64))

    def put(self, places: IntArray | BoolArray, others: "Centres") -> None:
        """Put ``others`` in the ``places``."""
        for field in fields(self):
            getattr(self, field.name)[places] = getattr(others, field.name)

    def __iter__(self) -> Iterator[Centre]:
        """Yield the centre of each cell."""
        quartiles = zip(self.lower_quartile.tolist(), self.upper_quartile.tolist(), strict=True)
        ends = (self.value.tolist(), self.low.tolist(), self.high.tolist())
        return map(Centre, self.kind.tolist(), *ends, quartiles, self.locked.tolist())


def centre(errors: FloatArray, confidence: float = 0.95) -> Centre:
    """Return the centre of (n,) errors, infinite for a lost run; NaN (did not apply) is left out.

    The geometric mean has Student's interval on the logarithms, of few runs a wider one (`few_intervals`): of two
    methods on the same seeds the quotient of the geometric means is what is tested, and errors of an RMSE scatter more
    like a lognormal than like a normal.
    """
    return centres([errors], confidence)[0]


def centres(samples: Sequence[FloatArray], confidence: float = 0.95) -> list[Centre]:
    """Return what `centre` gives for each sample; those of one size are computed together."""
    return list(centres_of(Samples.of(samples), confidence))


def centres_of(samples: Samples, confidence: float = 0.95) -> Centres:
    """Return what `centre` gives for each sample."""
    made = Centres.of_nothing(len(samples.sizes))
    for places, errors in samples.without_nan().by_size():
        if errors.shape[1]:
            made.put(places, _of_one_size(errors, confidence))
    return made


def _of_one_size(errors: FloatArray, confidence: float) -> Centres:
    """Return the centres of (k, n) errors without NaN, n > 0."""
    median, low, high, lower, upper = (column.copy() for column in quantiles_of_rows(errors, confidence))
    locked = np.sum(np.isfinite(errors) & (errors > LOCKED_OUT * median[:, None]), axis=1)
    kind = np.full(len(errors), MEDIAN, dtype=object)
    made = Centres(kind, median, low, high, lower, upper, locked)
    whole = (locked == 0) & np.isfinite(errors).all(axis=1) & (errors.min(axis=1) > 0)
    made.kind[whole] = GEOMETRIC
    made.value[whole], made.low[whole], made.high[whole] = _geometric(errors[whole], confidence)
    return made


def _geometric(errors: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return geometric mean and ends of (k, n) positive errors; where they differ by rounding alone, the first."""
    logs = np.log(errors)
    mean, low, high = (np.exp(end) for end in (logs.mean(axis=1), *few_intervals(logs, confidence)))
    alike = np.ptp(errors, axis=1) <= ROUNDING * errors.max(axis=1)
    same = errors[:, 0] if errors.shape[1] > 1 else np.full(len(errors), np.nan)
    return np.where(alike, errors[:, 0], mean), np.where(alike, same, low), np.where(alike, same, high)
