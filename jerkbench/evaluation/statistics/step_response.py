"""The answer to a fault: how large the error grows, and how long it takes to halve again."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray


@dataclass(frozen=True)
class StepResponse:
    """The error after a fault.

    Attributes:
        before: root mean square of the errors before it.
        peak: the largest error from its beginning on.
        peak_s: time of that after the beginning [s].
        halved_s: time from the peak until the error is at most halfway back and stays there; NaN where it never does.
    """

    before: float
    peak: float
    peak_s: float
    halved_s: float


def step_response(t_s: FloatArray, error: FloatArray, begin_s: float, end_s: float) -> StepResponse:
    """Return how (n,) errors at ``t_s`` answer a fault at ``begin_s``, looked at before ``end_s``.

    With e0 the error before the fault, halfway back is (peak + e0)/2, or half of the peak where e0 is no smaller.
    """
    earlier, during = t_s < begin_s, (t_s >= begin_s) & (t_s < end_s)
    before = float(np.sqrt(np.mean(error[earlier] ** 2))) if earlier.any() else np.nan
    if not during.any():
        return StepResponse(before, np.nan, np.nan, np.nan)
    t_s, error = t_s[during], error[during]
    top = int(np.argmax(error))
    peak = float(error[top])
    half = (peak + before) / 2 if before < peak else peak / 2
    above = np.flatnonzero(error > half)
    last = int(above[-1]) if len(above) else top
    halved_s = float(t_s[last + 1] - t_s[top]) if last + 1 < len(t_s) else np.nan
    return StepResponse(before, peak, float(t_s[top] - begin_s), halved_s)
