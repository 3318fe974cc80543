"""From the runs of a cell to the number that stands for them, with its interval."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.exact import quantiles
from jerkbench.evaluation.statistics.intervals import ROUNDING
from jerkbench.evaluation.statistics.log_ratio import LOCKED_OUT
from jerkbench.evaluation.statistics.paired import student_interval

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
    kept = errors[~np.isnan(errors)]
    whole = quantiles(kept, confidence)
    locked = int(np.sum(np.isfinite(kept) & (kept > LOCKED_OUT * whole.median)))
    if len(kept) == 0 or locked or not np.isfinite(kept).all() or kept.min() <= 0:
        return Centre(MEDIAN, whole.median, whole.low, whole.high, whole.quartiles, locked)
    if np.ptp(kept) <= ROUNDING * kept.max():
        ends = (float(kept[0]),) * 2 if len(kept) > 1 else (np.nan, np.nan)
        return Centre(GEOMETRIC, float(kept[0]), *ends, whole.quartiles, 0)
    logs = np.log(kept)
    low, high = (float(np.exp(end)) for end in student_interval(logs, confidence))
    return Centre(GEOMETRIC, float(np.exp(logs.mean())), low, high, whole.quartiles, 0)
