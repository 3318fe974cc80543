"""The number that stands for the errors of a cell, with its interval: the median, of few seeds the geometric mean."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.families import LEAST_SEEDS
from jerkbench.evaluation.statistics.intervals import few_intervals, quantiles_of_rows
from jerkbench.evaluation.statistics.over_seeds import LOCKED_OUT, ROUNDING, Samples

GEOMETRIC, MEDIAN, MEAN = "geometric mean", "median", "mean"


CENTRE_NUMBERS = ("value", "low", "high", "lower_quartile", "upper_quartile", "geometric")
CENTRE = np.dtype([("kind", object), *((name, np.float64) for name in CENTRE_NUMBERS), ("locked", np.int64)])
"""What stands for the errors of a cell.

- kind: `MEDIAN` of all runs from `LEAST_SEEDS` on, below them `GEOMETRIC` of those that went well: it does not depend
  on whether a failure was drawn
- value: infinite where half of the runs or more were lost
- low: lower end of the 95 % interval; NaN where there is none
- high: upper end; infinite where it reaches the lost runs
- lower_quartile, upper_quartile: of the runs, a lost one larger than every number
- geometric: geometric mean of those that went well
- locked: runs that are `LOCKED_OUT` times their median
"""

Centre = np.record
Centres = np.recarray[Any, Any]
"""One, and (k,) of them, with the fields of `CENTRE`."""


def no_centres(count: int, kind: str) -> Centres:
    """Return the centres of ``count`` cells without a value."""
    made = np.rec.array(np.zeros(count, CENTRE))
    made.kind = kind
    for name in CENTRE_NUMBERS:
        made[name] = np.nan
    return made


def centres(samples: Sequence[FloatArray]) -> list[Centre]:
    """Return what `centres_of` gives for each sample."""
    return list(centres_of(Samples.of(samples)))


def centres_of(samples: Samples, confidence: float = 0.95, least: float | FloatArray = LEAST_SEEDS) -> Centres:
    """Return the centres of samples of errors, infinite for a lost run; NaN (did not apply) is left out.

    The median has an interval by order statistics: lock-outs that were not drawn move it little. The geometric mean has
    Student's interval on the logarithms, of few runs a wider one (`few_intervals`): errors of an RMSE scatter more like
    a lognormal than like a normal. The median stands from ``least`` values on, of each sample its own.
    """
    made = no_centres(len(samples.sizes), MEDIAN)
    for places, errors in samples.without_nan().by_size():
        if errors.shape[1]:
            for name, values in zip(CENTRE_NUMBERS[:5], quantiles_of_rows(errors, confidence), strict=True):
                made[name][places] = values
            locked = np.isfinite(errors) & (errors > LOCKED_OUT * made.value[places, None])
            made.locked[places] = locked.sum(axis=1)
    few = samples.sizes < least
    made.kind[few] = GEOMETRIC
    for places, errors in samples.only(np.isfinite(samples.values)).by_size():
        if errors.shape[1]:
            ends = _geometric(errors, confidence)
            made.geometric[places] = ends[0]
            for name, values in zip(CENTRE_NUMBERS[:3], ends, strict=True):
                made[name][places[few[places]]] = values[few[places]]
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
