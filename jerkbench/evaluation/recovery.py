"""The time that a filter takes to recover from an outage."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.evaluation.statistics.step_response import step_response
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "recovery")
@dataclass(frozen=True)
class Recovery:
    """Answer of the position error to the recording's outages.

    Of each outage, from its begin to the begin of the next, over the counted rows whose reference is known, with |e|
    the position error, e0 its root mean square before the outage and peak its largest value::

        recovery_s         mean time from the peak until |e| is at most halfway back, (peak + e0)/2, and stays there
        recovery_peak_m    mean peak

    NaN without an outage, or where the error of one never comes back.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the two values by column name."""
        rows = counted & known(recording.reference.enu_m, estimate)
        t_s = recording.reference.t_s[estimate.index[rows]]
        with np.errstate(over="ignore", invalid="ignore"):
            error = np.linalg.norm(position_error_m(estimate, recording)[rows], axis=1)
        begins = recording.outages_s[:, 0]
        ends = np.append(begins, np.inf)[1:]
        answers = [step_response(t_s, error, begin, end) for begin, end in zip(begins, ends, strict=True)]
        if not answers:
            return {"recovery_s": np.nan, "recovery_peak_m": np.nan}
        return {
            "recovery_s": float(np.mean([answer.halved_s for answer in answers])),
            "recovery_peak_m": float(np.mean([answer.peak for answer in answers])),
        }
