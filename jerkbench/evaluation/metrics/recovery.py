"""Faults: errors in outages, how an estimate comes back after one, and fixes that are not believed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, streaks
from jerkbench.estimate import Estimate, Sums, Updates
from jerkbench.evaluation.counted_rows import (
    counting,
    first_counted_s,
    mean,
    position_error_m,
    rms,
    rms_norm,
    timed_errors,
)
from jerkbench.evaluation.evaluated_run import Summed
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import MeasuredVectors, Recording
from jerkbench.timeline import VARIANCE_FLOOR

LARGER = 4.0
"""So many times its reported variance is the true one of a measurement at fault: two sigma stand for one."""


def fault_windows_s(recording: Recording) -> FloatArray:
    """Return (k, 2) begin and end of each fault, by their begins: outages, and measurements worse than they say.

    A measurement is at fault where the true variance of an axis, which simulated and disturbed recordings carry, is
    `LARGER` times the reported one; such measurements of a stream that follow each other are one fault, which ends with
    the first that is none. Windows that overlap are one.
    """
    windows = [recording.outages_s]
    for stream in (recording.position, recording.velocity):
        if stream is not None and len(stream.t_s):
            begins, ends = streaks(_at_fault(stream)).T
            windows.append(np.column_stack([stream.t_s[begins], stream.t_s[np.minimum(ends, len(stream.t_s) - 1)]]))
    return _joined(np.concatenate(windows))


def _at_fault(stream: MeasuredVectors) -> BoolArray:
    """Return (m,) whether each measurement is at fault; none is where the true covariance is not known."""
    reported, true = (np.diagonal(covariance, axis1=1, axis2=2) for covariance in (stream.reported, stream.true))
    return np.asarray(np.any(true > LARGER * reported, axis=1))


def _joined(windows_s: FloatArray) -> FloatArray:
    """Return windows that do not overlap, from windows (k, 2)."""
    joined: list[list[float]] = []
    for begin, end in windows_s[np.argsort(windows_s[:, 0], kind="stable")].tolist():
        if joined and begin <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([begin, end])
    return np.array(joined).reshape(-1, 2)


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


def step_responses(t_s: FloatArray, error: FloatArray, begins_s: FloatArray) -> list[StepResponse]:
    """Return the response to each fault, up to the begin of the next one."""
    ends_s = [*begins_s[1:].tolist(), np.inf]
    return [step_response(t_s, error, *span) for span in zip(begins_s.tolist(), ends_s, strict=False)]


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

    columns: ClassVar[Mapping[str, Column]] = {
        "recovery_s": Column("Time until the error (3-D) after a fault is halfway back, median over the faults"),
        "recovery_peak_m": Column("Largest position error (3-D) after the begin of a fault, median over the faults"),
        "faults_counted": Column("Faults that begin after the burn-in", judged=False),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        t_s, _, error = timed_errors(estimate, recording, counted)
        begins = fault_windows_s(recording)[:, 0]
        answers = step_responses(t_s, error, begins[begins > t_s[0]] if len(t_s) else begins[:0])
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

    columns: ClassVar[Mapping[str, Column]] = {
        "outage_rmse_m": Column("Position RMSE (3-D) during outages", section=6),
        "outage_end_m": Column("Position error (3-D) at the end of an outage, mean over the outages", section=9),
        "outage_end_max_m": Column("Position error (3-D) at the end of an outage, the largest"),
        "outages_counted": Column("Outages with a known error at the end", judged=False),
    }

    reads_covariance: ClassVar[bool] = False
    reads_velocity: ClassVar[bool] = False

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

    columns: ClassVar[Mapping[str, Column]] = {
        "outage_rmse_horizontal_m": Column("Position RMSE during outages, horizontal", section=7),
        "outage_rmse_up_m": Column("Position RMSE during outages, up", section=8),
    }

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

    columns: ClassVar[Mapping[str, Column]] = {
        "outage_drift_mps": Column("Growth of the position error (3-D) in an outage"),
    }

    reads_covariance: ClassVar[bool] = False
    reads_velocity: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        drifts = sums.outage_drifts_mps[~np.isnan(sums.outage_drifts_mps)]
        return {"outage_drift_mps": mean(float(drifts.sum()), float(drifts.size))}


INFLATED = 4.0
"""A variance that is so many times the reported one: twice the sigma."""


@register("metric", "lockout")
@dataclass(frozen=True)
class Lockout:
    """Updates of which a position was inflated or rejected, and the longest streak of them.

    With R_ua the variance used for position axis a in update u and r_ua the one that the fix reported, over the updates
    with a position, from the first counted row on::

        inflated  any a: R_ua > 4 r_ua        rejected  all a: R_ua infinite (such an update is inflated too)

        inflated_percent, rejected_percent       share of the updates
        lockout_s                                longest time from the first inflated update of a streak to its last

    A filter that drifts away and rejects every fix has a long lock-out. NaN without such an update.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "inflated_percent": Column("Updates with an inflated position", judged=False),
        "rejected_percent": Column("Updates with a rejected position", judged=False),
        "lockout_s": Column("Longest streak of inflated positions", judged=False),
    }

    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
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
    """Return the longest time between the first and the last of flags that are set without a gap; 0 without any."""
    begin, end = streaks(flags).T
    return float(np.max(t_s[end - 1] - t_s[begin], initial=0.0))


def used_and_reported(updates: Updates, recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Return (3, m) the variances used and reported of the position in each update; NaN where it had none."""
    used = np.ascontiguousarray(updates.R_diagonal[:, :3].T)  # over short rows NumPy is slow
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
    """Successive fixes that are at fault.

    Attributes:
        fixes: number of fixes.
        begin_s: time of the first one.
        end_s: time of the first fix after them; infinite if there is none.
        size_m: largest root of trace(R_true - R).
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
    """Which single displaced fixes a filter takes, what they do to it, and how long it takes to recover.

    A spike is one fix whose true variance on an axis is more than four times the reported one (the fixes beside it are
    sound); its size is the root of trace(R_true - R). It is taken unless the update with it was dropped on all axes, or
    its R was made more than four times the reported one on one of them. With e the position error [m], over the spikes
    after the first counted row::

        spike_taken_m       the largest spike that was taken; 0 where none was
        spike_refused_m     the smallest spike that was not taken; NaN where all were
        spike_step_m        the largest |e(t+) - e(t-)|: the counted rows next to a spike, before and at or after it
        spike_recovery_s    median time from the peak after a spike until |e| is halfway back and stays there

    A gate that never works takes the largest spike of all. A sharp gate has both limits at the same size; the noise of
    the fixes spreads them. NaN without a spike. Not computed unless asked for: ``metrics=[gate]``, with the disturbance
    `spike_sweep`.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "spike_taken_m": Column("Largest displaced fix that was taken"),
        "spike_refused_m": Column("Smallest displaced fix that was not taken"),
        "spike_step_m": Column("Largest step of the position at a displaced fix"),
        "spike_recovery_s": Column("Time until the error (3-D) after a displaced fix is halfway back, median"),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the four values by column name."""
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
    """Whether the updates at the times ``at_s`` (s,) used the position as it was reported, or nearly so."""
    updates = estimate.updates
    if not len(updates.t_s):
        return np.ones(len(at_s), dtype=np.bool_)
    used, reported = used_and_reported(updates, recording)
    update = np.clip(np.searchsorted(updates.t_s, at_s - 1e-6), 0, len(updates.t_s) - 1)
    kept = np.isfinite(used[:, update]) & (used[:, update] <= INFLATED * reported[:, update])
    same = np.abs(updates.t_s[update] - at_s) < 1e-5
    return np.asarray(kept.all(axis=0) & same, dtype=np.bool_)


@register("metric", "capture")
@dataclass(frozen=True)
class Capture:
    """What a filter does with fixes that agree with each other in a wrong place, and with the right ones after them.

    A false stretch is two or more successive fixes whose true variance on an axis is more than four times the reported
    one; its size d is the largest root of trace(R_true - R) in it. With |e| the position error [m] at counted rows::

        captured_percent    share of the stretches at whose last row |e| > d/2: the filter followed
        returned_percent    share after which |e| <= d/2 by the next stretch or the end, and stays: it came back
        return_s            median time from the first right fix until then; longer than all others where it never is

    A filter that rejects for ever is not captured, and does not return where it has drifted away. NaN without a false
    stretch. Not computed unless asked for: ``metrics=[capture]``, with the disturbance `false_return`.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "captured_percent": Column("False returns that the filter followed"),
        "returned_percent": Column("False returns after which the filter came back", judged=False),
        "return_s": Column("Time from the first right fix until the filter is back, median"),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
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
