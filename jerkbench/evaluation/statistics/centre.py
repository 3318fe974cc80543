"""From the runs of a cell to the number that stands for them, with its interval."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.exact import quantiles_of_rows
from jerkbench.evaluation.statistics.intervals import ROUNDING
from jerkbench.evaluation.statistics.log_ratio import LOCKED_OUT
from jerkbench.evaluation.statistics.student import student_intervals

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


def centre(errors: FloatArray, confidence: float = 0.95) -> Centre:
    """Return the centre of (n,) errors, infinite for a lost run; NaN (did not apply) is left out.

    The geometric mean has Student's interval on the logarithms: of two methods on the same seeds the quotient of the
    geometric means is what is tested, and errors of an RMSE scatter more like a lognormal than like a normal.
    """
    return centres([errors], confidence)[0]


def centres(samples: Sequence[FloatArray], confidence: float = 0.95) -> list[Centre]:
    """Return what `centre` gives for each sample; those of one size are computed together."""
    kept = [errors[~np.isnan(errors)] for errors in samples]
    sizes = np.array([len(errors) for errors in kept], dtype=np.int64)
    result: dict[int, Centre] = {}
    for size in np.unique(sizes).tolist():
        places = np.flatnonzero(sizes == size).tolist()
        together = _of_one_size(np.stack([kept[place] for place in places]), confidence)
        result.update(zip(places, together, strict=True))
    return [result[place] for place in range(len(kept))]


def _of_one_size(errors: FloatArray, confidence: float) -> list[Centre]:
    """Return the centres of (k, n) errors without NaN."""
    median, low, high, lower, upper = (column.tolist() for column in quantiles_of_rows(errors, confidence))
    if errors.shape[1] == 0:
        return [Centre(MEDIAN, np.nan, np.nan, np.nan, (np.nan, np.nan), 0)] * len(errors)
    limits = LOCKED_OUT * np.array(median)[:, None]
    locked = np.sum(np.isfinite(errors) & (errors > limits), axis=1)
    whole = (locked == 0) & np.isfinite(errors).all(axis=1) & (errors.min(axis=1) > 0)
    quartiles = list(zip(lower, upper, strict=True))
    made = [
        Centre(MEDIAN, value, start, end, of, lost)
        for value, start, end, of, lost in zip(median, low, high, quartiles, locked.tolist(), strict=True)
    ]
    geometric = zip(np.flatnonzero(whole).tolist(), _geometric(errors[whole], confidence), strict=True)
    for place, (mean, start, end) in geometric:
        made[place] = Centre(GEOMETRIC, mean, start, end, quartiles[place], 0)
    return made


def _geometric(errors: FloatArray, confidence: float) -> list[tuple[float, float, float]]:
    """Return geometric mean and ends of (k, n) positive errors; where they differ by rounding alone, the first."""
    logs = np.log(errors)
    ends = (np.exp(end) for end in (logs.mean(axis=1), *student_intervals(logs, confidence)))
    alike = np.ptp(errors, axis=1) <= ROUNDING * errors.max(axis=1)
    same = errors[:, 0], *(errors[:, 0] if errors.shape[1] > 1 else np.full(len(errors), np.nan),) * 2
    chosen = (np.where(alike, first, value).tolist() for first, value in zip(same, ends, strict=True))
    return list(zip(*chosen, strict=True))
