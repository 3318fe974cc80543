"""The timeline of a run: IMU stamps, measurements and reference stamps in the order of their times of validity.

The times of measurements are not rounded to the time stamps of the IMU, and measurements are not interpolated. A
measurement or a reference stamp between two IMU stamps divides the prediction into two steps. Times are compared as
integer nanoseconds, because floating point times of the same event may differ by rounding errors.
"""

import dataclasses
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude, ErrorWeights
from jerkbench.parameters import AS_REPORTED, RScale
from jerkbench.recording import Recording, Velocity

VARIANCE_FLOOR = 1e-6
"""Minimum variance of a measurement: (1 mm)^2 or (1 mm/s)^2."""

ABSENT_SIGMA_MPS = 100.0
"""Standard deviation of the axes that a speed does not measure [m/s]. This value is small enough for a well conditioned
R."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements of position and velocity, ordered by time.

    A position and a velocity with equal times are in one row.

    Attributes:
        t_ns: (m,) times at which the measurements were valid [ns].
        z: (m, 6) position [m] and velocity [m/s] in ENU, with NaN on axes that were not measured.
        R: (m, 6, 6) reported covariance, whose diagonal elements are at least `VARIANCE_FLOOR`.
        R_true: (m, 6, 6) true covariance of the measurement errors. If the true covariance is unknown, R_true is R.
        unfloored: (m, 6, 6) R before small diagonal elements were raised to `VARIANCE_FLOOR`, or None if no element was
            raised.
    """

    t_ns: IntArray
    z: FloatArray
    R: FloatArray
    R_true: FloatArray
    unfloored: FloatArray | None = None

    def covariances(self, *, true: bool) -> FloatArray:
        """Return the true measurement covariances (m, 6, 6) if ``true`` is set, otherwise the reported covariances."""
        return self.R_true if true else self.R

    @property
    def as_reported(self) -> FloatArray:
        """Reported R (m, 6, 6) before the variance floor is applied."""
        return self.R if self.unfloored is None else self.unfloored


class ScaledMeasurements(Measurements):
    """Measurements whose R is scaled by two factors. The scaled R is computed on first access.

    Batched runs do not access R, because the compiled filter loop multiplies R by the factors.

    Attributes:
        reported: The measurements with R as reported.
        position: Factor on the covariance of each position [-].
        velocity: Factor on the covariance of each velocity [-].
    """

    def __init__(self, reported: Measurements, position: float, velocity: float) -> None:
        """Store the arrays of ``reported`` without copying them. R is computed later."""
        vars(self).update(t_ns=reported.t_ns, z=reported.z, R_true=reported.R_true)
        self.reported, self.position, self.velocity = reported, position, velocity

    @cached_property
    def R(self) -> FloatArray:  # noqa: N802 - overrides the field R
        """Reported R (m, 6, 6) multiplied by the factors. Elements of missing measurements do not change."""
        R, there = self.reported.as_reported.copy(), np.asarray(np.isfinite(self.z).reshape(-1, 2, 3).any(axis=2))
        for k, factor in enumerate((self.position, self.velocity)):
            rows: slice | BoolArray = slice(None) if there[:, k].all() else there[:, k]
            R[rows, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] *= factor
        variances = R.reshape(-1, 36)[:, ::7]
        np.maximum(variances, VARIANCE_FLOOR, out=variances)
        return R


def merged_measurements(recording: Recording, attitude: Attitude) -> Measurements:
    """Merge the positions and velocities of a recording into measurement vectors z, ordered by time."""
    position, velocity = recording.position, recording.velocity
    streams = [(slice(0, 3), position), (slice(3, 6), velocity and velocity_in_enu(velocity, attitude))]
    stamps = [np.empty(0, dtype=np.int64) if stream is None else nanoseconds(stream.t_s) for _, stream in streams]
    t_ns = np.unique(np.concatenate(stamps))
    z, R, R_true = np.full((len(t_ns), 6), np.nan), *np.tile(np.eye(6), (2, len(t_ns), 1, 1))
    for (block, stream), stamp in zip(streams, stamps, strict=True):
        if stream is not None:
            rows = np.searchsorted(t_ns, stamp)
            z[rows, block], R[rows, block, block] = stream.values, stream.reported
            R_true[rows, block, block] = stream.true
    present = np.isfinite(z).any(axis=1)
    reported, raised = R[present], floored(R[present])
    unfloored = reported if (raised != reported).any() else None
    return Measurements(t_ns[present], z[present], raised, floored(R_true[present]), unfloored)


def velocity_in_enu(velocity: Velocity, attitude: Attitude) -> Velocity:
    """Rotate velocities in the frame "body" or "speed", and their covariances, into ENU.

    With the velocity v, its covariance C, and the attitude Omega at the last IMU stamp up to the time of the velocity::

        z = Omega v;  R = Omega C Omega'

    An axis of "speed" that was not measured is set to 0 with the variance (100 m/s)^2 and without correlations. After
    the rotation into ENU, only the large variance in R shows that the axis was not measured. The rotation distributes a
    measured speed over three rows. Adaptations that use only the diagonal of R, or that add up variances, therefore get
    little information from a speed.
    """
    if velocity.frame == "enu":
        return velocity
    sample = np.maximum(np.searchsorted(attitude.t_s, velocity.t_s, side="right") - 1, 0)
    omega = attitude.dcm[sample]
    absent = ~np.isfinite(velocity.mps)
    absent[absent.all(axis=1)] = False  # rows without any measured axis remain NaN
    true = velocity.true_covariance_m2ps2
    return Velocity(
        velocity.t_s,
        np.einsum("nij,nj->ni", omega, np.where(absent, 0.0, velocity.mps)),
        _rotated(omega, _widened(velocity.covariance_m2ps2, absent)),
        "enu",
        None if true is None else _rotated(omega, _widened(true, absent)),
    )


def floored(covariance: FloatArray) -> FloatArray:
    """Raise diagonal elements of covariances (m, 6, 6) to at least `VARIANCE_FLOOR`. Other elements do not change."""
    raised = covariance.copy()
    diagonal = np.einsum("nii->ni", raised)
    np.maximum(diagonal, VARIANCE_FLOOR, out=diagonal)
    return raised


def _widened(covariance: FloatArray, absent: BoolArray) -> FloatArray:
    """For the axes ``absent`` (n, 3), set the variance to `ABSENT_SIGMA_MPS` squared, and all correlations to zero."""
    either = absent[:, :, None] | absent[:, None, :]
    return np.where(either, ABSENT_SIGMA_MPS**2 * np.eye(3), covariance)


def _rotated(omega: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariances Omega C Omega' (n, 3, 3), made exactly symmetric."""
    rotated = np.einsum("nij,njk,nlk->nil", omega, covariance, omega)
    return np.asarray(0.5 * (rotated + rotated.transpose(0, 2, 1)))


INITIAL_SPEED_SIGMA_MPS = 10.0
"""Initial standard deviation of a velocity axis without a measurement in the last second before the start [m/s]."""

INITIAL_SPEED_AGE_S = 1.0
"""Maximum age of a velocity measurement that is used for the initial state [s]."""

INPUT_SIGMA_MPS2 = 0.5
"""Standard deviation of the error of the input u on each axis, constant over `INITIAL_SPEED_AGE_S` [m/s2].

The main cause of this error is the tilt error.
"""

UNSEEN_SIGMA_MPS2 = 2.0
"""Standard deviation of the acceleration of a vehicle during a gap of the IMU samples [m/s2]."""


_AT_START = np.diag([1.0] * 3 + [INITIAL_SPEED_SIGMA_MPS**2] * 3)


@dataclass(frozen=True, eq=False)
class Start:
    """The measurements from which the initial state is computed. The covariances are not raised to the variance floor.

    Attributes:
        position_m: (3,) position of the first fix in ENU [m].
        covariance_m2: (3, 3) covariance of the first fix [m2].
        velocities: For each velocity measurement, a tuple of the indices of the measured axes in x, the velocity z
            predicted to the time of the fix, R, and the variance that the prediction adds to each axis.
    """

    position_m: FloatArray
    covariance_m2: FloatArray
    velocities: tuple[tuple[IntArray, FloatArray, FloatArray, float], ...]

    def motion(self, position: float = 1.0, velocity: float = 1.0) -> tuple[FloatArray, FloatArray]:
        """Return the initial state x0 (6,) and its covariance P0 (6, 6), with R multiplied by the given factors."""
        x0, P0 = np.zeros(6), _AT_START.copy()
        x0[:3], P0[:3, :3] = self.position_m, _scaled(self.covariance_m2, position)
        for axes, z, R, grown in self.velocities:
            scaled = _scaled(R, velocity)
            x0[axes], P0[axes[:, None], axes] = _bounded(z, scaled + grown * np.eye(len(axes)) if grown else scaled)
        return x0, P0


cached_motion = lru_cache(maxsize=8192)(Start.motion)  # each cached result needs about 1 kB
"""`Start.motion` with a cache, because many settings of a search have the same factors."""


def _scaled(R: FloatArray, factor: float) -> FloatArray:
    """Return R (k, k) multiplied by ``factor``. Diagonal elements are raised to at least the variance floor."""
    scaled = factor * R
    for k in range(len(scaled)):
        scaled[k, k] = max(scaled[k, k], VARIANCE_FLOOR)
    return scaled


def start_of(measurements: Measurements, first: int, attitude: Attitude | None, dt0_s: float) -> Start:
    """Return the position fix in row ``first``, and the latest velocity up to it, predicted to the time of the fix.

    For each velocity axis, the latest measurement in the last second up to the fix is used. Correlations between axes
    of the same measurement are retained. The prediction covers the age tau of the measurement. IMU samples with the
    input u (acceleration in ENU) are available during tau_u, a part of tau. Without an IMU (``attitude`` is None),
    tau_u is 0::

        v = z + int u dt;  P = R + (tau_u .5 m/s2)^2 I + ((tau - tau_u) 2 m/s2)^2 I

    If an axis was not measured in this second, its velocity is 0 with a standard deviation of 10 m/s. Measurements
    after the fix are not used for the initial state, because the filter uses them in its updates, and no measurement
    may be used twice. A velocity measurement is ignored in directions in which its standard deviation is 10 m/s or
    more, for example across the direction of travel if only a speed was measured.
    """
    start_s, reported, velocities = measurements.t_ns[first] * 1e-9, measurements.as_reported, []
    rows = latest_rows(measurements, first)
    for row in sorted(set(rows.tolist()) - {-1}):
        axes = 3 + np.flatnonzero(rows == row)
        z, R, grown = measurements.z[row, axes], reported[row, axes[:, None], axes], 0.0
        age_s = (measurements.t_ns[first] - measurements.t_ns[row]) * 1e-9
        if age_s > 0:
            gained, seen_s = _gained(attitude, dt0_s, start_s - age_s, start_s)
            grown = (seen_s * INPUT_SIGMA_MPS2) ** 2 + ((age_s - seen_s) * UNSEEN_SIGMA_MPS2) ** 2
            z = z + gained[axes - 3]
        velocities.append((axes, z, R, grown))
    return Start(measurements.z[first, :3].copy(), reported[first, :3, :3].copy(), tuple(velocities))


def latest_rows(measurements: Measurements, first: int) -> IntArray:
    """Return for each velocity axis (3,) the row of its latest measurement in the last second up to the fix, or -1."""
    t_ns = measurements.t_ns
    begin = int(np.searchsorted(t_ns, t_ns[first] - round(INITIAL_SPEED_AGE_S * 1e9)))
    measured = np.isfinite(measurements.z[begin : first + 1, 3:])
    return np.where(measured.any(axis=0), first - np.argmax(measured[::-1], axis=0), -1)


def _bounded(z: FloatArray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a velocity and its covariance, with at most 10 m/s of uncertainty along each principal axis.

    Along each principal axis whose sigma is 10 m/s or more, the velocity is set to 0 m/s and the sigma to 10 m/s.
    """
    if R.trace() < INITIAL_SPEED_SIGMA_MPS**2:  # no eigenvalue can exceed the trace
        return z, R
    variances, axes = np.linalg.eigh(R)
    sure = variances < INITIAL_SPEED_SIGMA_MPS**2
    if sure.all():
        return z, R
    known = axes[:, sure]
    P = axes * np.where(sure, variances, INITIAL_SPEED_SIGMA_MPS**2) @ axes.T
    return known @ (known.T @ z), 0.5 * (P + P.T)


def _gained(attitude: Attitude | None, dt0_s: float, begin_s: float, end_s: float) -> tuple[FloatArray, float]:
    """Return the integral (3,) of the acceleration between two times [m/s], and the duration with IMU samples [s]."""
    if attitude is None:
        return np.zeros(3), 0.0
    t_s = attitude.t_s
    first, last = np.searchsorted(t_s, (begin_s, end_s))
    nodes_s = np.append(t_s[first - 1] if first else t_s[0] - dt0_s, t_s[first : last + 1])
    parts_s = np.diff(np.clip(nodes_s, begin_s, end_s))
    return parts_s @ attitude.accel_enu_mps2[first : last + 1], float(parts_s.sum())


@dataclass(frozen=True, eq=False)
class Timeline:
    """The prediction steps and updates of one run, as arrays with one element for each of n steps.

    A step is a prediction over the time dt with the input u (acceleration in ENU). A step can end with an update by a
    measurement, followed by a comparison of the state with the reference.

    Attributes:
        dt0_s: Nominal sampling interval of the IMU, or the median interval between measurements without an IMU [s].
        dt_s: (n,) length of each step [s]. The first step has the length 0, because it is the start of the run.
        sample: (n,) row of ``accel_enu_mps2`` that contains the acceleration during the step.
        update: (n,) row of ``measurements`` for the update at the end of the step, or -1 for a step without an update.
        reference: (n,) row of the reference trajectory at the end of the step, or -1 if the reference has no such time.
        accel_enu_mps2: (samples, 3) input u in ENU, or zeros without an IMU [m/s2].
        measurements: The measurements of position and velocity.
        x0: (6,) initial position [m] and velocity [m/s] in ENU.
        P0: (6, 6) covariance of x0.
        euler_rad: (k, 3) roll, pitch, yaw at the stamps of the reference [rad].
        t_s: (n,) time at the end of each step [s].
        start: The measurements from which x0 and P0 were computed, or None if the caller set x0 and P0 directly.
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
        """The distinct lengths of the steps [s], and for each step the index of its length (see `step_lengths`)."""
        return step_lengths(self.dt_s)

    @cached_property
    def visits(self) -> tuple[int, int]:
        """The number of stamps of the reference in the run, and the number of updates."""
        return int(np.count_nonzero(self.reference >= 0)), int(np.count_nonzero(self.update >= 0))

    @cached_property
    def update_times_s(self) -> FloatArray:
        """Times (m,) of all updates, relative to the start of the run [s]. The array is read-only."""
        rows = self.update[self.update >= 0]
        rows = rows[np.isfinite(self.measurements.z[rows]).any(axis=1)]
        times_s: FloatArray = self.measurements.t_ns[rows] * 1e-9 - self.t_s[0]
        times_s.flags.writeable = False
        return times_s


def build_timeline(recording: Recording, attitude: Attitude) -> Timeline:
    """Return the timeline from the first fix to the last IMU sample.

    Without an IMU, the timeline ends at the last measurement.

    Raises:
        RecordingError: The recording has no position fix with all three axes during the run.
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
    update[0] = -1  # the first fix determines the initial state, so it is not an update
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
    """Return the distinct times in increasing order. Sorted input arrays are merged faster."""
    merged = np.sort(np.concatenate(times_ns), kind="stable")  # np.unique is slower
    is_new = np.append(True, merged[1:] != merged[:-1])
    return np.asarray(merged[is_new[: len(merged)]])


def nanoseconds(t_s: FloatArray) -> IntArray:
    """Convert seconds to integer nanoseconds."""
    return np.round(np.asarray(t_s) * 1e9).astype(np.int64)


def _rows_at(events: IntArray, t_ns: IntArray) -> IntArray:
    """Return for each time in ``events`` the index of the same time in ``t_ns``, or -1 if ``t_ns`` lacks this time."""
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
        raise RecordingError(f"{name} has no position fix with all three axes during the run; a filter needs one.")
    return int(rows[0])


# Distinct step lengths. With regular time stamps, the steps have only a few distinct lengths.


def step_lengths(dt_s: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct step lengths [s], and for each step the index of its length, or -1 for a step of length 0.

    Two lengths count as equal if they are equal after rounding to 1 ns.
    """
    if _even(dt_s) or _even(key := np.round(dt_s * 1e9).astype(np.int64)):
        which = np.zeros(len(dt_s), dtype=np.int64)
        which[0] = -1
        return dt_s[1:2], which
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    which = which.astype(np.int64)
    which[dt_s <= 0] = -1
    return dt_s[first], which


def _even(dt: FloatArray | IntArray) -> bool:
    """Return whether all steps after the start have equal lengths. This check avoids a slow sort of the lengths."""
    return bool(len(dt) > 1 and dt[0] <= 0 < dt[1] and (dt[1:] == dt[1]).all())


def with_r_scale(recording: Recording, scale: RScale) -> Recording:
    """Return the recording with scaled reported covariances and unchanged true covariances, which an oracle uses."""
    if not scale.changed:
        return recording
    p, v = recording.position, recording.velocity
    return dataclasses.replace(
        recording,
        position=p and p.changed(p.values, scale.position * p.reported, p.true),
        velocity=v and v.changed(v.values, scale.velocity * v.reported, v.true),
    )


def scaled_timeline(timeline: Timeline, recording: Recording, attitude: Attitude, scale: RScale) -> Timeline:
    """Return the timeline with R multiplied by the factors ``scale``, computed from ``timeline`` with the reported R.

    The result is bitwise equal to the result of `build_timeline` for a recording that `with_r_scale` returned. The
    function takes only about 15 us, because arrays that do not depend on R are not copied. Only if velocities have to
    be rotated again, the function takes longer.
    """
    if not scale.changed:
        return timeline
    before = timeline.measurements
    if timeline.start and (recording.velocity is None or recording.velocity.frame == "enu"):
        measured: Measurements = ScaledMeasurements(before, scale.position, scale.velocity)
        x0, P0 = cached_motion(timeline.start, scale.position, scale.velocity)
    else:  # the reported R of a rotated velocity must be scaled before the rotation
        again = merged_measurements(with_r_scale(recording, scale), attitude)
        measured = dataclasses.replace(before, R=again.R, unfloored=again.unfloored)
        first = int(np.searchsorted(before.t_ns, round(timeline.t_s[0] * 1e9)))
        x0, P0 = start_of(measured, first, attitude if recording.imu else None, timeline.dt0_s).motion()
    scaled, at_s = object.__new__(Timeline), timeline.update_times_s  # `dataclasses.replace` would take twice as long
    vars(scaled).update(vars(timeline), update_times_s=at_s, measurements=measured, x0=x0, P0=P0)
    return scaled


# A cache of recent timelines, because runs with different adaptations use the same timeline.

cached_timeline = lru_cache(maxsize=32)(build_timeline)
"""`build_timeline` with a cache that has the same size as the cache of recordings."""


class Run(NamedTuple):
    """The inputs of a run of a kinematic filter: the timeline, and the weights of the errors for the metrics."""

    timeline: Timeline
    scoring: ErrorWeights


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """The inputs of a run of an estimator: the recording, the timeline, and the weights of the errors for the metrics.

    Attributes:
        reported: The recording with covariances as reported by the receiver (not scaled).
        attitude: The estimated attitude of the vehicle in this recording.
        timeline: The timeline, computed from the recording and the attitude.
        scoring: Weights with which errors are added to the sums for the metrics.
        r_scale: Factors on the reported covariances.
    """

    reported: Recording
    attitude: Attitude
    timeline: Timeline
    scoring: ErrorWeights
    r_scale: RScale = AS_REPORTED

    @cached_property
    def recording(self) -> Recording:
        """The recording with scaled covariances, computed on first access because scaling takes longer than a run."""
        return with_r_scale(self.reported, self.r_scale)
