"""(Recording, Attitude) -> Timeline: the events of a run in the order in which they were true.

Nothing is rounded to the IMU's grid and nothing is interpolated: a measurement, or a stamp of the reference, between
two IMU stamps splits the interval. Times are compared as whole nanoseconds, so that equal stamps are equal.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.recording import Recording
from jerkbench.timeline.measurements import Measurements, gather
from jerkbench.timeline.start import start_motion


@dataclass(frozen=True, eq=False)
class Timeline:
    """The steps of one run: predict over dt with u of ``sample``, then update, then compare with the reference.

    Attributes:
        dt0_s: nominal interval of the IMU; without one, the usual one between fixes.
        dt_s: (n,) length of each step; the first is 0 (the start).
        sample: (n,) which row of ``accel_enu_mps2`` covers the step.
        update: (n,) row of ``measurements`` at the end of the step, or -1.
        reference: (n,) row of the reference at the end of the step, or -1.
        accel_enu_mps2: (samples, 3) the input u; without an IMU zeros.
        measurements: what is measured, six rows each.
        x0: (6,) initial position and velocity.
        P0: (6, 6) their covariance.
        euler_rad: (k, 3) roll, pitch, yaw at the reference's stamps.
        t_s: (n,) time at the end of each step.
    """

    dt0_s: float
    dt_s: FloatArray
    sample: IntArray
    update: IntArray
    reference: IntArray
    accel_enu_mps2: FloatArray
    measurements: Measurements
    x0: FloatArray
    P0: FloatArray
    euler_rad: FloatArray
    t_s: FloatArray

    @cached_property
    def update_times_s(self) -> FloatArray:
        """(m,) when the updates are that measure anything, seconds since the start; shared, so it cannot be written."""
        rows = self.update[self.update >= 0]
        rows = rows[np.isfinite(self.measurements.z[rows]).any(axis=1)]
        times_s: FloatArray = self.measurements.t_ns[rows] * 1e-9 - self.t_s[0]
        times_s.flags.writeable = False
        return times_s


def build_timeline(recording: Recording, attitude: Attitude) -> Timeline:
    """Order the events of ``recording`` from the first fix to the last IMU sample; without an IMU, to the last fix.

    Raises:
        RecordingError: there is no complete position fix while the IMU runs.
    """
    measurements = gather(recording, attitude)
    clock, reference = nanoseconds(recording.clock_s), nanoseconds(recording.reference.t_s)
    dt0_s = float(np.median(np.diff(recording.clock_s)))
    first = _first_fix(measurements, clock[0] - round(dt0_s * 1e9), clock[-1], recording.name)
    start = measurements.t_ns[first]
    events = in_order(clock, measurements.t_ns, reference)
    events = events[(events >= start) & (events <= clock[-1])]
    x0, P0 = start_motion(measurements, first, attitude if recording.imu else None, dt0_s)
    update = _rows_at(events, measurements.t_ns)
    update[0] = -1  # the first fix is the start itself
    return Timeline(
        dt0_s=dt0_s,
        dt_s=np.diff(events, prepend=start) * 1e-9,
        sample=np.searchsorted(clock, events).astype(np.int64),
        update=update,
        reference=_rows_at(events, reference),
        accel_enu_mps2=attitude.accel_enu_mps2,
        measurements=measurements,
        x0=x0,
        P0=P0,
        euler_rad=attitude.euler_rad[np.maximum(np.searchsorted(clock, reference, side="right") - 1, 0)],
        t_s=events * 1e-9,
    )


def in_order(*times_ns: IntArray) -> IntArray:
    """Return all of the times once, in increasing order; quick where each of them is in order already."""
    merged = np.sort(np.concatenate(times_ns), kind="stable")  # np.unique puts them into a table first
    is_new = np.append(True, merged[1:] != merged[:-1])
    return np.asarray(merged[is_new[: len(merged)]])


def nanoseconds(t_s: FloatArray) -> IntArray:
    """Turn seconds into whole nanoseconds."""
    return np.round(np.asarray(t_s) * 1e9).astype(np.int64)


def _rows_at(events: IntArray, t_ns: IntArray) -> IntArray:
    """Return the row of ``t_ns`` of each event, or -1."""
    rows = np.full(len(events), -1, dtype=np.int64)
    if len(t_ns):
        near = np.minimum(np.searchsorted(t_ns, events), len(t_ns) - 1)
        rows[t_ns[near] == events] = near[t_ns[near] == events]
    return rows


def _first_fix(measurements: Measurements, begin_ns: int, end_ns: int, name: str) -> int:
    complete = np.isfinite(measurements.z[:, :3]).all(axis=1)
    inside = (measurements.t_ns >= begin_ns) & (measurements.t_ns <= end_ns)
    rows = np.flatnonzero(complete & inside)
    if not rows.size:
        raise RecordingError(
            f"{name} has no complete position fix while it runs; a navigation filter needs one to start from."
        )
    return int(rows[0])
