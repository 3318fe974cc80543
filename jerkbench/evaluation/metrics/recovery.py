"""Errors in outages, and how an estimate comes back after a fault: its window, and the step response to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, streaks
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import counting, mean, position_error_m, rms, rms_norm, timed_errors
from jerkbench.evaluation.sums import Summed
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums

LARGER = 4.0
"""So many times its reported variance is the true one of a measurement at fault: two sigma stand for one."""


def fault_windows_s(recording: Recording) -> FloatArray:
    """Return (k, 2) begin and end of each fault, by their begins: outages, and measurements worse than they say.

    A measurement is at fault where the true variance of an axis, which simulated and disturbed recordings carry, is
    `LARGER` times the reported one; such measurements of a stream that follow each other are one fault, which ends with
    the first that is none. Windows that overlap are one.
    """
    position, velocity = recording.position, recording.velocity
    windows = [recording.outages_s]
    if position is not None and position.true_covariance_m2 is not None:
        windows.append(_windows(position.t_s, position.covariance_m2, position.true_covariance_m2))
    if velocity is not None and velocity.true_covariance_m2ps2 is not None:
        windows.append(_windows(velocity.t_s, velocity.covariance_m2ps2, velocity.true_covariance_m2ps2))
    return _joined(np.concatenate(windows))


def _windows(t_s: FloatArray, reported: FloatArray, true: FloatArray) -> FloatArray:
    """Return (k, 2) first stamp at fault and first that is not any more, or the last of all."""
    says, is_ = (np.diagonal(covariance, axis1=1, axis2=2) for covariance in (reported, true))
    at_fault: BoolArray = np.any(is_ > LARGER * says, axis=1)
    begins, ends = streaks(at_fault).T
    return np.column_stack([t_s[begins], t_s[np.minimum(ends, len(t_s) - 1)]])


def _joined(windows_s: FloatArray) -> FloatArray:
    """Return windows that do not overlap, from windows (k, 2)."""
    joined: list[list[float]] = []
    for begin, end in windows_s[np.argsort(windows_s[:, 0], kind="stable")].tolist():
        if joined and begin <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([begin, end])
    return np.array(joined).reshape(-1, 2)


# The answer to a fault: how large the error grows, and how long it takes to halve again.


class StepResponse(NamedTuple):
    """The error after a fault.

    Attributes:
        peak: the largest error from its beginning on.
        halved_s: time from the peak until the error is at most halfway back and stays there; NaN where it never does.
    """

    peak: float
    halved_s: float


def step_response(t_s: FloatArray, error: FloatArray, begin_s: float, end_s: float) -> StepResponse:
    """Return how (n,) errors at ``t_s`` answer a fault at ``begin_s``, looked at before ``end_s``.

    With e0 the error before the fault, halfway back is (peak + e0)/2, or half of the peak where e0 is no smaller.
    """
    earlier, during = t_s < begin_s, (t_s >= begin_s) & (t_s < end_s)
    before = float(np.sqrt(np.mean(error[earlier] ** 2))) if earlier.any() else np.nan
    if not during.any():
        return StepResponse(np.nan, np.nan)
    t_s, error = t_s[during], error[during]
    top = int(np.argmax(error))
    peak = float(error[top])
    half = (peak + before) / 2 if before < peak else peak / 2
    above = np.flatnonzero(error > half)
    last = int(above[-1]) if len(above) else top
    halved_s = float(t_s[last + 1] - t_s[top]) if last + 1 < len(t_s) else np.nan
    return StepResponse(peak, halved_s)


# The time that a filter takes to recover from a fault.


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
        t_s, _, error = timed_errors(estimate, recording, counted)
        begins = fault_windows_s(recording)[:, 0]
        begins = begins[begins > t_s[0]] if len(t_s) else begins[:0]
        ends = np.append(begins, np.inf)[1:]
        answers = [step_response(t_s, error, begin, end) for begin, end in zip(begins, ends, strict=True)]
        return {
            "recovery_s": median_time_s([answer.halved_s for answer in answers]),
            "recovery_peak_m": median_time_s([answer.peak for answer in answers]),
            "faults_counted": float(len(answers)),
        }


def median_time_s(values: Sequence[float]) -> float:
    """Return the median of values of which NaN is the largest; NaN where that is one, or of none."""
    if not values:
        return np.nan
    middle = float(np.median(np.where(np.isnan(values), np.inf, values)))
    return middle if np.isfinite(middle) else np.nan


# Position errors while there is no aiding.


@register("metric", "outage")
@dataclass(frozen=True)
class Outage(Summed):
    """Position error inside the recording's outages, and at their ends.

    With e_i = p_i - p_ref,i [m], ENU, over rows whose reference is known, and row i inside outage j if
    begin_j <= t_i < end_j (at the end itself a fix may already have come)::

        outage_rmse_m     = sqrt(1/N sum |e_i|^2)       over the N counted rows inside any outage
        l(j)              = the last row inside outage j, scored or not, from the first counted row on
        J                 = the outages with end_j - t_l(j) <= 2 dt,    dt = median interval of the known reference
        outage_end_m      = mean over j in J of |e_l(j)|
        outage_end_max_m  = max over j in J of |e_l(j)|
        outage_end_percent = 100 sum over J of |e_l(j)| / sum over J of d_j
        outages_counted   = how many outages J has

    with d_j the way of the reference from the first row inside outage j to the last. An outage whose end the reference
    or the run does not reach is thus left out, and seen to be. Errors are NaN without such a row or outage, the part of
    the distance also where all stood still; all five without any outage.
    """

    reads_covariance: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the five values by column name."""
        ends, driven_m = sums.outage_ends_m, float(sums.outage_driven_m.sum())
        return {
            "outage_rmse_m": rms(sums.outage_m2, sums.outage_rows),
            "outage_end_m": mean(float(ends.sum()), float(ends.size)),
            "outage_end_max_m": float(ends.max()) if ends.size else float("nan"),
            "outage_end_percent": mean(100 * float(ends.sum()), driven_m),
            "outages_counted": float(ends.size) if sums.outages else float("nan"),
        }


@register("metric", "outage_axes")
@dataclass(frozen=True)
class OutageAxes:
    """Position error inside the recording's outages, horizontal and vertical apart.

    With e_i = p_i - p_ref,i [m], ENU, over the N counted rows inside any outage, as in `outage`::

        outage_rmse_horizontal_m  = sqrt(1/N sum (e_east^2 + e_north^2))
        outage_rmse_up_m          = sqrt(1/N sum e_up^2)

    A wheel's speed holds the one and leaves the other to the attitude. NaN without such a row.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the two values by column name."""
        inside = counting(estimate.index, recording, counted).outage
        error = position_error_m(estimate, recording)[inside]
        return {"outage_rmse_horizontal_m": rms_norm(error[:, :2]), "outage_rmse_up_m": rms_norm(error[:, 2:])}


@register("metric", "outage_drift")
@dataclass(frozen=True)
class OutageDrift(Summed):
    """Growth of the position error over an outage, per second.

    With f(j) and l(j) the first and the last row inside outage j, as in the metric `outage`, and e_i the error [m]::

        outage_drift_mps = mean over j of |e_l(j) - e_f(j)|/(t_l(j) - t_f(j))

    The error with which the outage began does not count. NaN without an outage of two rows.
    """

    reads_covariance: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        drifts = sums.outage_drifts_mps[~np.isnan(sums.outage_drifts_mps)]
        return {"outage_drift_mps": mean(float(drifts.sum()), float(drifts.size))}
