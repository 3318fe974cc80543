"""The number that stands for the errors of a cell, with its interval: the median, of few seeds the geometric mean."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.statistics.families import LEAST_SEEDS
from jerkbench.evaluation.statistics.intervals import few_intervals, quantiles_of_rows
from jerkbench.evaluation.statistics.over_seeds import LOCKED_OUT, ROUNDING, Samples

GEOMETRIC, MEDIAN, MEAN = "geometric mean", "median", "mean"


@dataclass(frozen=True)
class Centre:
    """What stands for the errors of a cell.

    Attributes:
        kind: `MEDIAN` of all runs from `LEAST_SEEDS` on, below them `GEOMETRIC` of those that went well: it does not
            depend on whether a failure was drawn.
        value: infinite where half of the runs or more were lost.
        low: lower end of the 95 % interval; NaN where there is none.
        high: upper end; infinite where it reaches the lost runs.
        quartiles: of the runs, a lost one larger than every number.
        locked: runs that are `LOCKED_OUT` times their median.
        geometric: geometric mean of those that went well.
    """

    kind: str
    value: float
    low: float
    high: float
    quartiles: tuple[float, float]
    locked: int
    geometric: float


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
    geometric: FloatArray

    @classmethod
    def of_nothing(cls, count: int, kind: str | NDArray[np.object_]) -> "Centres":
        """Return those of ``count`` cells without a value."""
        value, low, high, lower, upper, geometric = np.full((6, count), np.nan)
        kinds, locked = np.full(count, kind, dtype=object), np.zeros(count, np.int64)
        return cls(kinds, value, low, high, lower, upper, locked, geometric)

    def put(self, places: IntArray | BoolArray, others: "Centres") -> None:
        """Put ``others`` in the ``places``."""
        for field in fields(self):
            getattr(self, field.name)[places] = getattr(others, field.name)

    def __iter__(self) -> Iterator[Centre]:
        """Yield the centre of each cell."""
        quartiles = zip(self.lower_quartile.tolist(), self.upper_quartile.tolist(), strict=True)
        ends = (self.value.tolist(), self.low.tolist(), self.high.tolist())
        return map(Centre, self.kind.tolist(), *ends, quartiles, self.locked.tolist(), self.geometric.tolist())


def centres(samples: Sequence[FloatArray]) -> list[Centre]:
    """Return what `centres_of` gives for each sample."""
    return list(centres_of(Samples.of(samples)))


def centres_of(samples: Samples, confidence: float = 0.95, least: float | FloatArray = LEAST_SEEDS) -> Centres:
    """Return the centres of samples of errors, infinite for a lost run; NaN (did not apply) is left out.

    The median has an interval by order statistics: lock-outs that were not drawn move it little. The geometric mean has
    Student's interval on the logarithms, of few runs a wider one (`few_intervals`): errors of an RMSE scatter more like
    a lognormal than like a normal. The median stands from ``least`` values on, of each sample its own.
    """
    made = Centres.of_nothing(len(samples.sizes), MEDIAN)
    for places, errors in samples.without_nan().by_size():
        if errors.shape[1]:
            median, *others = quantiles_of_rows(errors, confidence)
            columns = (made.value, made.low, made.high, made.lower_quartile, made.upper_quartile)
            for column, values in zip(columns, (median, *others), strict=True):
                column[places] = values
            made.locked[places] = np.sum(np.isfinite(errors) & (errors > LOCKED_OUT * median[:, None]), axis=1)
    few = samples.sizes < least
    made.kind[few] = GEOMETRIC
    for places, errors in samples.only(np.isfinite(samples.values)).by_size():
        if errors.shape[1]:
            ends = np.array(_geometric(errors, confidence))
            made.geometric[places] = ends[0]
            for column, values in zip((made.value, made.low, made.high), ends, strict=True):
                column[places[few[places]]] = values[few[places]]
    return made


def costs_of(samples: Samples, least: float | FloatArray = LEAST_SEEDS) -> FloatArray:
    """Return (k,) by what each sample is ranked: its centre, infinite where a run was lost."""
    lost = samples.count(np.isposinf(samples.values)) > 0
    return np.where(lost, np.inf, centres_of(samples, least=least).value)


def _geometric(errors: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return geometric mean and ends of (k, n) errors; where they differ by rounding alone, the first."""
    with np.errstate(all="ignore"):
        logs = np.log(errors)
        mean, low, high = (np.exp(end) for end in (logs.mean(axis=1), *few_intervals(logs, confidence)))
    alike = np.ptp(errors, axis=1) <= ROUNDING * errors.max(axis=1)
    same = errors[:, 0] if errors.shape[1] > 1 else np.full(len(errors), np.nan)
    return np.where(alike, errors[:, 0], mean), np.where(alike, same, low), np.where(alike, same, high)
