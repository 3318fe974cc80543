"""Metrics of the response to faults: errors in outages, recovery after faults, and rejected fixes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, streaks
from jerkbench.estimate import Estimate, Sums, Updates
from jerkbench.evaluation.counted_rows import (
    counted_errors,
    first_counted_s,
    mean,
    rms,
)
from jerkbench.evaluation.evaluated_run import Summed
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import VARIANCE_FLOOR

LARGER = 4.0
"""A measurement is faulty if its true variance exceeds this factor times its reported variance (two times in sigma)."""


def fault_windows_s(recording: Recording) -> FloatArray:
    """Return the start and end (k, 2) [s] of each fault in ascending order.

    Faults are outages, and periods with faulty measurements. A measurement is faulty if the true variance of an axis
    (known in simulated and disturbed recordings) exceeds `LARGER` times the reported variance. Consecutive faulty
    measurements of the same sensor are one fault, which ends at the first measurement that is not faulty. Overlapping
    faults are merged.
    """
    windows = [recording.outages_s]
    for stream in (recording.position, recording.velocity):
        if stream is not None and len(stream.t_s):
            reported, true = (np.diagonal(one, axis1=1, axis2=2) for one in (stream.reported, stream.true))
            begins, ends = streaks(np.any(true > LARGER * reported, axis=1)).T  # NaN is not faulty
            windows.append(np.column_stack([stream.t_s[begins], stream.t_s[np.minimum(ends, len(stream.t_s) - 1)]]))
    return _joined(np.concatenate(windows))


def _joined(windows_s: FloatArray) -> FloatArray:
    """Return the windows (k, 2) [s] with overlapping windows merged."""
    joined: list[list[float]] = []
    for begin, end in windows_s[np.argsort(windows_s[:, 0], kind="stable")].tolist():
        if joined and begin <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([begin, end])
    return np.array(joined).reshape(-1, 2)


class StepResponse(NamedTuple):
    """The response of an error to a fault.

    Attributes:
        peak: largest error from the start of the fault on.
        halved_s: time from the peak until the error has recovered as defined in `step_response` [s]. ``halved_s`` is
            NaN if the error does not recover.
    """

    peak: float
    halved_s: float


def step_response(t_s: FloatArray, error: FloatArray, begin_s: float, end_s: float) -> StepResponse:
    """Return the response of an error to a fault.

    Let e0 be the root mean square error before the fault. The error has recovered when it stays at or below the limit
    (peak + e0)/2. If e0 is not smaller than the peak, the limit is peak/2.

    Args:
        t_s: (n,) times of the errors [s].
        error: (n,) errors at the times ``t_s``.
        begin_s: start of the fault [s].
        end_s: errors from this time on are ignored [s].
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


@register("metric", "recovery")
@dataclass(frozen=True)
class Recovery:
    """Response of the position error to the faults of the recording.

    Faults are outages, and fixes and velocities whose true sigma is more than twice the reported sigma. True sigmas are
    known in simulated and disturbed recordings. Consecutive faulty measurements are one fault. The response to a fault
    lasts until the start of the next fault, and is evaluated at counted rows whose reference is known. Let |e| be the
    length of the position error, e0 its root mean square before the fault, and peak its largest value from the start of
    the fault on::

        recovery_s         median time from the peak until |e| is at most halfway back, (peak + e0)/2, and stays there
        recovery_peak_m    median peak
        faults_counted     faults that begin after the first counted row

    If the error does not recover before the next fault, the recovery time of the fault counts as infinite. The values
    recovery_s and recovery_peak_m are NaN without a fault, and recovery_s is also NaN if the error does not recover
    after half of the faults or more. The metric is computed only on request: ``metrics=[recovery]``.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "recovery_s": Column("Time until the error (3-D) after a fault is halfway back, median over the faults"),
        "recovery_peak_m": Column("Largest position error (3-D) after the start of a fault, median over the faults"),
        "faults_counted": Column("Faults that start after the burn-in", judged=False),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        rows, error = counted_errors(estimate, recording, counted)
        t_s = recording.reference.t_s[estimate.index[rows]]
        with np.errstate(over="ignore", invalid="ignore"):
            length_m = np.linalg.norm(error, axis=1)
        begins_s = fault_windows_s(recording)[:, 0]
        begins_s = begins_s[begins_s > t_s[0]] if len(t_s) else begins_s[:0]
        ends_s = np.append(begins_s[1:], np.inf)
        answers = [step_response(t_s, length_m, *span) for span in zip(begins_s, ends_s, strict=False)]
        return {
            "recovery_s": median_time_s([answer.halved_s for answer in answers]),
            "recovery_peak_m": median_time_s([answer.peak for answer in answers]),
            "faults_counted": float(len(answers)),
        }


def median_time_s(values: Sequence[float]) -> float:
    """Return the median of ``values``, where NaN counts as infinite, or NaN for no values or an infinite median."""
    if not values:
        return np.nan
    middle = float(np.median(np.where(np.isnan(values), np.inf, values)))
    return middle if np.isfinite(middle) else np.nan


@register("metric", "outage")
@dataclass(frozen=True)
class Outage(Summed):
    """Position error inside the outages of the recording, and at the ends of the outages.

    Let e_i = p_i - p_ref,i be the position error in ENU [m] at rows whose reference is known. Row i is inside outage j
    if begin_j <= t_i < end_j. The time end_j is excluded, because a fix may be available at this time::

        outage_rmse_m     = sqrt(1/N sum |e_i|^2)       over the N counted rows inside any outage
        l(j)              = the last row inside outage j, scored or not, from the first counted row on
        J                 = the outages with end_j - t_l(j) <= 2 dt,    dt = median interval of the known reference
        outage_end_m      = mean over j in J of |e_l(j)|
        outage_end_max_m  = max over j in J of |e_l(j)|
        outage_end_percent = 100 sum over J of |e_l(j)| / sum over J of d_j
        outages_counted   = number of outages in J

    The reference covers the distance d_j from the first to the last row inside outage j. An outage is not in J if the
    reference or the run ends before the end of the outage. A value is NaN if no row or outage contributes to the value.
    The value outage_end_percent is also NaN if the reference does not move in the outages. All five values are NaN if
    the recording has no outages.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "outage_rmse_m": Column("Position RMSE (3-D) during outages", section=6),
        "outage_end_m": Column("Position error (3-D) at the end of an outage, mean over the outages", section=9),
        "outage_end_max_m": Column("Position error (3-D) at the end of an outage, the largest"),
        "outages_counted": Column("Outages with a known error at the end", judged=False),
    }

    reads_covariance: ClassVar[bool] = False
    reads_velocity: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the five values of the metric by column name."""
        ends, driven_m = sums.outage_ends_m, float(sums.outage_driven_m.sum())
        return {
            "outage_rmse_m": rms(sums.outage_m2, sums.outage_rows),
            "outage_end_m": mean(float(ends.sum()), float(ends.size)),
            "outage_end_max_m": float(ends.max()) if ends.size else float("nan"),
            "outage_end_percent": mean(100 * float(ends.sum()), driven_m),
            "outages_counted": float(ends.size) if sums.outages else float("nan"),
        }


@register("metric", "outage_drift")
@dataclass(frozen=True)
class OutageDrift(Summed):
    """Growth of the position error over an outage, per second.

    Let f(j) and l(j) be the first and the last row inside outage j, as in the metric `outage`, and e_i the position
    error at row i [m]::

        outage_drift_mps = mean over j of |e_l(j) - e_f(j)|/(t_l(j) - t_f(j))

    The error at the start of an outage is subtracted. The value is NaN if no outage contains two rows.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "outage_drift_mps": Column("Growth of the position error (3-D) in an outage"),
    }

    reads_covariance: ClassVar[bool] = False
    reads_velocity: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value of the metric by column name."""
        drifts = sums.outage_drifts_mps[~np.isnan(sums.outage_drifts_mps)]
        return {"outage_drift_mps": mean(float(drifts.sum()), float(drifts.size))}


INFLATED = 4.0
"""A variance is inflated if it exceeds this factor times the reported variance (two times in sigma)."""


@register("metric", "lockout")
@dataclass(frozen=True)
class Lockout:
    """Fraction of updates with an inflated or rejected position, and duration of their longest streak.

    Let R_ua be the variance that was used for position axis a in update u, and r_ua the reported variance of the fix.
    The metric includes the updates with a position from the first counted row on::

        inflated  any a: R_ua > 4 r_ua        rejected  all a: R_ua infinite (such an update is inflated too)

        inflated_percent, rejected_percent       fraction of the updates
        lockout_s                                longest time from the first inflated update of a streak to its last

    A filter that has drifted away and rejects all fixes has a long lockout. The values are NaN if no update has a
    position.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "inflated_percent": Column("Updates with an inflated position", judged=False),
        "rejected_percent": Column("Updates with a rejected position", judged=False),
        "lockout_s": Column("Longest streak of inflated positions", judged=False),
    }

    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        updates = estimate.updates
        used, reported = used_and_reported(updates, recording)
        start_s = first_counted_s(recording.reference, estimate.index, counted)
        rows = (updates.t_s >= start_s) & np.isfinite(reported).any(axis=0) & ~np.isnan(used).all(axis=0)
        if not rows.any():
            return dict.fromkeys(self.columns, np.nan)
        used, reported = used[:, rows], reported[:, rows]
        inflated = np.asarray((used > INFLATED * reported).any(axis=0))
        rejected = (~np.isfinite(used)).all(axis=0)
        t_s, (begin, end) = updates.t_s[rows], streaks(inflated).T
        return {
            "inflated_percent": 100 * float(inflated.mean()),
            "rejected_percent": 100 * float(rejected.mean()),
            "lockout_s": float(np.max(t_s[end - 1] - t_s[begin], initial=0.0)),
        }


def used_and_reported(updates: Updates, recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Return the used and the reported position variances [m2] of each update, both (3, m), NaN without a position."""
    used = np.ascontiguousarray(updates.R_diagonal[:, :3].T)  # NumPy is slow for arrays with short rows
    reported = np.full_like(used, np.nan)
    position = recording.position
    if position is None or len(position.t_s) == 0 or used.size == 0:
        return used, reported
    nearest = np.clip(np.searchsorted(position.t_s, updates.t_s - 1e-9), 0, len(position.t_s) - 1)
    same = np.abs(position.t_s[nearest] - updates.t_s) < 1e-6
    variances = np.diagonal(position.covariance_m2, axis1=1, axis2=2)[nearest[same]]
    reported[:, same] = np.maximum(variances.T, VARIANCE_FLOOR)
    return used, reported
