"""(Recording, Attitude) -> Timeline: the events of a run in the order in which they were true.

Nothing is rounded to the IMU's grid and nothing is interpolated: a measurement, or a stamp of the reference, between
two IMU stamps splits the interval. Times are compared as whole nanoseconds, so that equal stamps are equal.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError, RecordingError, unknown
from jerkbench.estimate import Attitude, Estimate, Updates
from jerkbench.measurements import (
    Measurements,
    ScaledMeasurements,
    Start,
    merged_measurements,
    motion_told,
    start_of,
)
from jerkbench.recording import Position, Recording, Velocity


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
        start: what x0 and P0 were made of, with R as reported; None: they were given.
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
    start: Start | None = None

    @cached_property
    def lengths(self) -> tuple[FloatArray, IntArray]:
        """The different lengths of steps, and which of them each step has: `step_lengths`."""
        return step_lengths(self.dt_s)

    @cached_property
    def visits(self) -> tuple[int, int]:
        """How many stamps of the reference are met, and how many updates there are."""
        return int(np.count_nonzero(self.reference >= 0)), int(np.count_nonzero(self.update >= 0))

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
    measurements = merged_measurements(recording, attitude)
    clock, reference = nanoseconds(recording.clock_s), nanoseconds(recording.reference.t_s)
    dt0_s = float(np.median(np.diff(recording.clock_s)))
    first = _first_fix(measurements, clock[0] - round(dt0_s * 1e9), clock[-1], recording.name)
    start_ns = measurements.t_ns[first]
    events = merged_times(clock, measurements.t_ns, reference)
    events = events[(events >= start_ns) & (events <= clock[-1])]
    start = start_of(measurements, first, attitude if recording.imu else None, dt0_s)
    x0, P0 = start.motion()
    update = _rows_at(events, measurements.t_ns)
    update[0] = -1  # the first fix is the start itself
    return Timeline(
        dt0_s=dt0_s,
        dt_s=np.diff(events, prepend=start_ns) * 1e-9,
        sample=np.searchsorted(clock, events).astype(np.int64),
        update=update,
        reference=_rows_at(events, reference),
        accel_enu_mps2=attitude.accel_enu_mps2,
        measurements=measurements,
        x0=x0,
        P0=P0,
        euler_rad=attitude.euler_rad[np.maximum(np.searchsorted(clock, reference, side="right") - 1, 0)],
        t_s=events * 1e-9,
        start=start,
    )


def merged_times(*times_ns: IntArray) -> IntArray:
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


# Lengths of steps: few different ones, but where stamps are uneven.


def step_lengths(dt_s: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the different lengths, whole nanoseconds apart, and which of them each step has (-1: none, dt = 0)."""
    if _even(dt_s) or _even(key := np.round(dt_s * 1e9).astype(np.int64)):
        which = np.zeros(len(dt_s), dtype=np.int64)
        which[0] = -1
        return dt_s[1:2], which
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    which = which.astype(np.int64)
    which[dt_s <= 0] = -1
    return dt_s[first], which


def _even(dt: FloatArray | IntArray) -> bool:
    """Whether all steps but the first, in which no time passes, are equal; to sort them takes a tenth of a run."""
    return bool(len(dt) > 1 and dt[0] <= 0 < dt[1] and (dt[1:] == dt[1]).all())


# The measurement noise that a filter is told: the reported R, scaled, whatever the data are.


@dataclass(frozen=True)
class RScale:
    """Factors on the covariances that the receiver reports, as the filter is told them.

    A knob of tuning like those of Q. Measurements, their true covariances and the attitude stay what they are.

    Attributes:
        position: factor on the covariance of each position [-].
        velocity: factor on the covariance of each velocity [-].
    """

    position: float = 1.0
    velocity: float = 1.0

    def __post_init__(self) -> None:
        """Check that the factors are positive numbers."""
        for name in ("position", "velocity"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise PluginError(f"r_scale.{name} is {value}; it must be a positive number; 1 leaves R as reported.")

    @property
    def changed(self) -> dict[str, float]:
        """The factors that are not 1, by name."""
        return {name: value for name, value in vars(self).items() if value != 1.0}


def scale_of(values: object) -> RScale:
    """Return the factors that a configuration names: a mapping, or None for R as reported.

    Raises:
        PluginError: it is no mapping, names something else, or holds what is no positive number.
    """
    known = [f.name for f in dataclasses.fields(RScale)]
    factors = {} if values is None else values
    if not isinstance(factors, Mapping):
        raise PluginError(f"r_scale is {factors}; it has two parts: r_scale.position=2 r_scale.velocity=0.5.")
    for name, value in factors.items():
        if name not in known:
            raise PluginError(unknown("parameter of r_scale", str(name), known))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise PluginError(f"r_scale.{name} is {value}; it must be a positive number; 1 leaves R as reported.")
    return RScale(**{name: float(value) for name, value in factors.items()})


AS_REPORTED = RScale()
"""R as the receiver reports it."""


def with_r_scale(recording: Recording, scale: RScale) -> Recording:
    """Return ``recording`` with the covariances that a filter is told; what an oracle is told stays."""
    if not scale.changed:
        return recording
    p, v = recording.position, recording.velocity
    return dataclasses.replace(
        recording,
        position=None if p is None else _told(p, "m2", scale.position),
        velocity=None if v is None else _told(v, "m2ps2", scale.velocity),
    )


def told_timeline(timeline: Timeline, recording: Recording, attitude: Attitude, scale: RScale) -> Timeline:
    """Return what `build_timeline` makes of `with_r_scale`, to the bit, from the ``timeline`` of ``recording`` itself.

    It shares with ``timeline`` all that no covariance changes, and takes some 15 us, but where a velocity was turned.
    """
    if not scale.changed:
        return timeline
    before = timeline.measurements
    if timeline.start and (recording.velocity is None or recording.velocity.frame == "enu"):
        measured: Measurements = ScaledMeasurements(before, scale.position, scale.velocity)
        x0, P0 = motion_told(timeline.start, scale.position, scale.velocity)
    else:  # R is not the reported one, but was turned
        again = merged_measurements(with_r_scale(recording, scale), attitude)
        measured = dataclasses.replace(before, R=again.R, unfloored=again.unfloored)
        first = int(np.searchsorted(before.t_ns, round(timeline.t_s[0] * 1e9)))
        x0, P0 = start_of(measured, first, attitude if recording.imu else None, timeline.dt0_s).motion()
    told, at_s = object.__new__(Timeline), timeline.update_times_s  # `dataclasses.replace` takes as long as all else
    vars(told).update(vars(timeline), update_times_s=at_s, measurements=measured, x0=x0, P0=P0)
    return told


_Stream = TypeVar("_Stream", Position, Velocity)


def _told(stream: _Stream, unit: str, factor: float) -> _Stream:
    reported, true = (getattr(stream, f"{name}_{unit}") for name in ("covariance", "true_covariance"))
    told = {f"covariance_{unit}": factor * reported, f"true_covariance_{unit}": reported if true is None else true}
    return dataclasses.replace(stream, **told)


# The recorder of a run: its states and updates, in arrays that are made once.


class Recorder:
    """States at the reference's stamps and what each update saw, in the order in which they come."""

    def __init__(self, timeline: Timeline) -> None:
        """Make room for every stamp of the reference and every update of ``timeline``."""
        references, updates = timeline.visits
        self._timeline = timeline
        self._index = np.empty(references, dtype=np.int64)
        self._x, self._P = np.empty((references, 6)), np.empty((references, 6, 6))
        self._which = np.empty(updates, dtype=np.int64)
        self._counts, self._nis, self._nis_used, self._log_det = np.empty((4, updates))
        self._innovation, self._R = np.full((updates, 6), np.nan), np.full((updates, 6), np.nan)
        self._k = self._m = 0

    def state(self, reference: int, x: FloatArray, P: FloatArray) -> None:
        """Keep position, velocity and their covariance at a stamp of the reference."""
        self._index[self._k], self._x[self._k], self._P[self._k] = reference, x, P
        self._k += 1

    def update(
        self,
        which: int,
        rows: IntArray,
        innovation: FloatArray,
        R_diagonal: FloatArray,
        nis: float,
        nis_used: float,
        log_det: float = np.nan,
    ) -> None:
        """Keep what an update saw."""
        m = self._m
        self._which[m], self._counts[m] = which, len(rows)
        self._nis[m], self._nis_used[m], self._log_det[m] = nis, nis_used, log_det
        self._innovation[m, rows], self._R[m, rows] = innovation, R_diagonal
        self._m += 1

    def estimate(self, failure: str = "") -> Estimate:
        """Return what was collected so far."""
        k, m = self._k, self._m
        t_s = np.asarray(self._timeline.measurements.t_ns[self._which[:m]] * 1e-9, dtype=np.float64)
        scalars = self._counts[:m], self._nis[:m], self._nis_used[:m]
        updates = Updates(t_s, *scalars, self._innovation[:m], self._R[:m], self._log_det[:m])
        index, x = self._index[:k], self._x[:k]
        return Estimate(index, x[:, :3], x[:, 3:], self._P[:k], self._timeline.euler_rad[index], updates, failure)


# The timelines of the latest recordings, for the next adaptation.

kept_timeline = lru_cache(maxsize=32)(build_timeline)
"""`build_timeline`, done once for a recording with its attitude; as many as a process keeps recordings."""
