"""Metrics of the response to faults: errors in outages, recovery after faults, and rejected fixes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, streaks
from jerkbench.estimate import Estimate, Sums, Updates
from jerkbench.evaluation.counted_rows import (
    first_counted_s,
    mean,
    rms,
    timed_errors,
)
from jerkbench.evaluation.evaluated_run import Summed
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import MeasuredVectors, Recording
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
            begins, ends = streaks(_at_fault(stream)).T
            windows.append(np.column_stack([stream.t_s[begins], stream.t_s[np.minimum(ends, len(stream.t_s) - 1)]]))
    return _joined(np.concatenate(windows))


def _at_fault(stream: MeasuredVectors) -> BoolArray:
    """Return a mask (m,) of the faulty measurements, which is False if the true covariance is unknown."""
    reported, true = (np.diagonal(covariance, axis1=1, axis2=2) for covariance in (stream.reported, stream.true))
    return np.asarray(np.any(true > LARGER * reported, axis=1))


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


def step_responses(t_s: FloatArray, error: FloatArray, begins_s: FloatArray) -> list[StepResponse]:
    """Return the response of (n,) errors to each of the faults that start at ``begins_s`` (k,).

    The response to a fault ends at the start of the next fault.
    """
    ends_s = [*begins_s[1:].tolist(), np.inf]
    return [step_response(t_s, error, *span) for span in zip(begins_s.tolist(), ends_s, strict=False)]


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
        t_s, _, error = timed_errors(estimate, recording, counted)
        begins = fault_windows_s(recording)[:, 0]
        answers = step_responses(t_s, error, begins[begins > t_s[0]] if len(t_s) else begins[:0])
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
        return {
            "inflated_percent": 100 * float(inflated.mean()),
            "rejected_percent": 100 * float(rejected.mean()),
            "lockout_s": longest_streak_s(inflated, updates.t_s[rows]),
        }


def longest_streak_s(flags: BoolArray, t_s: FloatArray) -> float:
    """Return the longest time [s] from the first to the last of consecutive true ``flags``, or 0 if no flag is true."""
    begin, end = streaks(flags).T
    return float(np.max(t_s[end - 1] - t_s[begin], initial=0.0))


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


class _Displaced(NamedTuple):
    """A sequence of successive faulty fixes.

    Attributes:
        fixes: number of faulty fixes.
        begin_s: time of the first faulty fix [s].
        end_s: time of the next fix that is not faulty [s], or infinity without such a fix.
        size_m: size of the fault: the largest square root of trace(R_true - R) over the faulty fixes [m].
    """

    fixes: int
    begin_s: float
    end_s: float
    size_m: float


def _displaced(recording: Recording) -> list[_Displaced]:
    position = recording.position
    if position is None:
        return []
    size_m = np.sqrt(np.maximum(np.trace(position.true - position.reported, axis1=1, axis2=2), 0.0))
    t_s = [*position.t_s.tolist(), np.inf]
    return [
        _Displaced(b - a, t_s[a], t_s[b], float(size_m[a:b].max())) for a, b in streaks(_at_fault(position)).tolist()
    ]


@register("metric", "gate")
@dataclass(frozen=True)
class Gate:
    """Size of the single displaced fixes that a filter accepts, their effect, and the recovery time.

    A spike is a single faulty fix between fixes that are not faulty. A fix is faulty if its true variance on any axis
    is more than four times the reported variance. The size of a spike is the square root of trace(R_true - R). A filter
    accepts a spike if the variance in its update is at most four times the reported variance on every axis. Let e be
    the position error [m]. The metric includes the spikes after the first counted row::

        spike_taken_m       the largest accepted spike; 0 without one
        spike_refused_m     the smallest spike that was not accepted; NaN without one
        spike_step_m        the largest |e(t+) - e(t-)|: the counted rows next to a spike, before and at or after it
        spike_recovery_s    median time from the peak after a spike until |e| is halfway back and stays there

    A filter without a gate accepts the largest spike. For a sharp gate, spike_taken_m and spike_refused_m are almost
    equal. They are not exactly equal, because the fixes are noisy. All values are NaN if no fix is a spike. The metric
    is computed only on request: ``metrics=[gate]``, with the disturbance `spike_sweep`.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "spike_taken_m": Column("Largest accepted displaced fix"),
        "spike_refused_m": Column("Smallest rejected displaced fix"),
        "spike_step_m": Column("Largest step of the position at a displaced fix"),
        "spike_recovery_s": Column("Time until the error (3-D) after a displaced fix is halfway back, median"),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the four values of the metric by column name."""
        t_s, error, length_m = timed_errors(estimate, recording, counted)
        spikes = [d for d in _displaced(recording) if d.fixes == 1 and len(t_s) and d.begin_s > t_s[0]]
        if not spikes:
            return dict.fromkeys(self.columns, np.nan)
        at_s, size_m = (np.array([getattr(spike, name) for spike in spikes]) for name in ("begin_s", "size_m"))
        taken = _taken(estimate, recording, at_s)
        after = np.minimum(np.searchsorted(t_s, at_s - 1e-9), len(t_s) - 1)
        with np.errstate(over="ignore", invalid="ignore"):
            steps_m = np.linalg.norm(error[after] - error[np.maximum(after - 1, 0)], axis=1)
        return {
            "spike_taken_m": float(np.max(size_m[taken], initial=0.0)),
            "spike_refused_m": float(np.min(size_m[~taken])) if not taken.all() else np.nan,
            "spike_step_m": float(np.max(steps_m)),
            "spike_recovery_s": median_time_s([of.halved_s for of in step_responses(t_s, length_m, at_s)]),
        }


def _taken(estimate: Estimate, recording: Recording, at_s: FloatArray) -> BoolArray:
    """Return a mask (s,) of the fixes at the times ``at_s`` (s,) that were accepted without an inflated variance."""
    updates = estimate.updates
    if not len(updates.t_s):
        return np.ones(len(at_s), dtype=np.bool_)
    used, reported = used_and_reported(updates, recording)
    update = np.clip(np.searchsorted(updates.t_s, at_s - 1e-6), 0, len(updates.t_s) - 1)
    accepted = np.isfinite(used[:, update]) & (used[:, update] <= INFLATED * reported[:, update])
    same = np.abs(updates.t_s[update] - at_s) < 1e-5
    return np.asarray(accepted.all(axis=0) & same, dtype=np.bool_)


@register("metric", "capture")
@dataclass(frozen=True)
class Capture:
    """Response of a filter to several fixes with a common false position, and to the correct fixes after them.

    A false stretch consists of two or more successive fixes whose true variance on an axis is more than four times the
    reported variance. The size d of a stretch is the largest square root of trace(R_true - R) over the fixes of the
    stretch. Let |e| be the length of the position error [m] at counted rows::

        captured_percent    fraction of the stretches at whose last row |e| > d/2: the filter followed
        returned_percent    fraction after which |e| <= d/2 before the next stretch or the end, permanently
        return_s            median time from the first correct fix until the return; infinite without a return

    A filter that rejects all fixes is not captured. If such a filter has drifted away, it does not return. The values
    are NaN if the recording has no false stretch. The metric is computed only on request: ``metrics=[capture]``, with
    the disturbance `false_return`.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "captured_percent": Column("False returns that the filter followed"),
        "returned_percent": Column("False returns after which the filter came back", judged=False),
        "return_s": Column("Time from the first correct fix until the filter is back, median"),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        t_s, _, length_m = timed_errors(estimate, recording, counted)
        stretches = [d for d in _displaced(recording) if d.fixes > 1]
        nexts_s = [*(stretch.begin_s for stretch in stretches[1:]), np.inf]
        captured, times_s = [], []
        for stretch, next_s in zip(stretches, nexts_s, strict=False):
            before, behind = t_s < stretch.end_s, (t_s >= stretch.end_s) & (t_s < next_s)
            if not (before.any() and behind.any()):
                continue
            captured.append(bool(length_m[before][-1] > stretch.size_m / 2))
            far = np.flatnonzero(~(length_m[behind] <= stretch.size_m / 2))
            back = 0 if not len(far) else int(far[-1]) + 1
            times_s.append(float(t_s[behind][back] - stretch.end_s) if back < behind.sum() else np.nan)
        if not captured:
            return dict.fromkeys(self.columns, np.nan)
        return {
            "captured_percent": 100 * float(np.mean(captured)),
            "returned_percent": 100 * float(np.mean(np.isfinite(times_s))),
            "return_s": median_time_s(times_s),
        }
