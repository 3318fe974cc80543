"""The time that a filter takes to recover from a fault."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.faults import fault_windows_s
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.evaluation.statistics.step_response import step_response
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "recovery")
@dataclass(frozen=True)
class Recovery:
    """Answer of the position error to the recording's faults.

    Faults are the outages, and, where the true covariances are known (simulated and disturbed recordings), fixes and
    velocities with more than twice the sigma that they report; those that follow each other are one. Of each, from its
    begin to the begin of the next, over the counted rows whose reference is known, with |e| the position error, e0 its
    root mean square before the fault and peak its largest value::

        recovery_s         median time from the peak until |e| is at most halfway back, (peak + e0)/2, and stays there
        recovery_peak_m    median peak
        faults_counted     faults that begin after the first counted row

    Where the error does not come back before the next fault, the time is longer than every other. NaN without a fault,
    and where half of the errors or more do not come back. Not computed unless asked for: ``metrics=[recovery]``.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        rows = counted & known(recording.reference.enu_m, estimate)
        t_s = recording.reference.t_s[estimate.index[rows]]
        with np.errstate(over="ignore", invalid="ignore"):
            error = np.linalg.norm(position_error_m(estimate, recording)[rows], axis=1)
        begins = fault_windows_s(recording)[:, 0]
        begins = begins[begins > t_s[0]] if len(t_s) else begins[:0]
        ends = np.append(begins, np.inf)[1:]
        answers = [step_response(t_s, error, begin, end) for begin, end in zip(begins, ends, strict=True)]
        return {
            "recovery_s": _median([answer.halved_s for answer in answers]),
            "recovery_peak_m": _median([answer.peak for answer in answers]),
            "faults_counted": float(len(answers)),
        }


def _median(values: Sequence[float]) -> float:
    """Return the median of values of which NaN is the largest; NaN where that is one, or of none."""
    if not values:
        return np.nan
    middle = float(np.median(np.where(np.isnan(values), np.inf, values)))
    return middle if np.isfinite(middle) else np.nan
