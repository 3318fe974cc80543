"""(Recording, Attitude) -> Timeline: the events of a run in the order in which they were true.

Nothing is rounded to the IMU's grid and nothing is interpolated: a measurement, or a stamp of the reference, between
two IMU stamps splits the interval. Times are compared as whole nanoseconds, so that equal stamps are equal.
"""

import dataclasses
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude, ErrorWeights
from jerkbench.r_scale import AS_REPORTED, RScale, with_r_scale
from jerkbench.recording import Recording, Velocity

VARIANCE_FLOOR = 1e-6
"""No variance is taken below (1 mm)^2 or (1 mm/s)^2."""

ABSENT_SIGMA_MPS = 100.0
"""One sigma of what a speed does not tell: far more than any vehicle's, and still well conditioned."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements in the order of time; what comes at the same time is one row.

    Attributes:
        t_ns: (m,) time at which they were true.
        z: (m, 6) position and velocity in ENU; NaN: not there.
        R: (m, 6, 6) as reported, the diagonal not below the floor.
        R_true: (m, 6, 6) what the errors were drawn from, where it is known; else R.
        unfloored: (m, 6, 6) R before its diagonal was raised to the floor; None: none of it was.
    """

    t_ns: IntArray
    z: FloatArray
    R: FloatArray
    R_true: FloatArray
    unfloored: FloatArray | None = None

    def covariances(self, *, true: bool) -> FloatArray:
        """Return (m, 6, 6) those that a filter gets."""
        return self.R_true if true else self.R

    @property
    def as_reported(self) -> FloatArray:
        """(m, 6, 6) R whatever its floor."""
        return self.R if self.unfloored is None else self.unfloored

    @cached_property
    def apart(self) -> bool:
        """Whether no covariance that is reported is one of two axes."""
        return bool(axes_apart(self.R).all())


ACROSS = np.nonzero((np.arange(6)[:, None] - np.arange(6)) % 3)
"""Rows and columns of the elements of a covariance that are those of two axes."""

TURNING_NOISE = 16.0 * np.finfo(np.float64).eps
"""Correlation that rounding leaves where a diagonal covariance was turned."""


def axes_apart(R: FloatArray) -> BoolArray:
    """Whether each of (m, 6, 6) covariances has nothing between two axes but rounding, where they are numbers."""
    (r, c), variances = ACROSS, np.einsum("nii->ni", R)
    across = R[:, r, c] ** 2 > TURNING_NOISE * TURNING_NOISE * variances[:, r] * variances[:, c]
    return np.asarray(~across.any(axis=1))


class ScaledMeasurements(Measurements):
    """Measurements of which a filter is told another R: made where it is read, for runs side by side share `reported`.

    Attributes:
        reported: as they were.
        position: factor on the covariance of each position [-].
        velocity: factor on the covariance of each velocity [-].
    """

    def __init__(self, reported: Measurements, position: float, velocity: float) -> None:
        """Share with ``reported`` all but R."""
        vars(self).update(t_ns=reported.t_ns, z=reported.z, R_true=reported.R_true)
        self.reported, self.position, self.velocity = reported, position, velocity

    @cached_property
    def R(self) -> FloatArray:  # noqa: N802 - read like the field
        """(m, 6, 6) the factors times R; of what is not there it stays."""
        R, there = self.reported.as_reported.copy(), np.asarray(np.isfinite(self.z).reshape(-1, 2, 3).any(axis=2))
        for k, factor in enumerate((self.position, self.velocity)):
            rows: slice | BoolArray = slice(None) if there[:, k].all() else there[:, k]
            R[rows, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] *= factor
        variances = R.reshape(-1, 36)[:, ::7]
        np.maximum(variances, VARIANCE_FLOOR, out=variances)
        return R


def merged_measurements(recording: Recording, attitude: Attitude) -> Measurements:
    """Merge the position and velocity of ``recording`` into rows of z."""
    position, velocity = recording.position, recording.velocity
    streams = [(slice(0, 3), position), (slice(3, 6), velocity and velocity_in_enu(velocity, attitude))]
    stamps = [np.empty(0, dtype=np.int64) if stream is None else nanoseconds(stream.t_s) for _, stream in streams]
    t_ns = np.unique(np.concatenate(stamps))
    z, R, R_true = np.full((len(t_ns), 6), np.nan), *np.tile(np.eye(6), (2, len(t_ns), 1, 1))
    for (block, stream), stamp in zip(streams, stamps, strict=True):
        if stream is not None:
            rows = np.searchsorted(t_ns, stamp)
            z[rows, block], R[rows, block, block], R_true[rows, block, block] = (
                stream.values,
                stream.reported,
                stream.true,
            )
    present = np.isfinite(z).any(axis=1)
    reported, raised = R[present], floored(R[present])
    unfloored = reported if (raised != reported).any() else None
    return Measurements(t_ns[present], z[present], raised, floored(R_true[present]), unfloored)


def velocity_in_enu(velocity: Velocity, attitude: Attitude) -> Velocity:
    """Turn a velocity along the body's axes, and its covariances, into ENU; one that is in ENU stays as it is.

    With Omega of the last IMU stamp before it, v in the frame "body" or "speed" and C its covariance::

        z = Omega v;  R = Omega C Omega'

    An axis of "speed" that nothing is known of is 0 with the variance (100 m/s)^2, uncorrelated: once turned, only that
    much in R says that it is absent, for the rows of z are those of ENU. A speed alone is so one quantity in three
    rows; a rule that adds up variances, or takes the diagonal alone, sees little in them.
    """
    if velocity.frame == "enu":
        return velocity
    sample = np.maximum(np.searchsorted(attitude.t_s, velocity.t_s, side="right") - 1, 0)
    omega = attitude.dcm[sample]
    absent = ~np.isfinite(velocity.mps)
    absent[absent.all(axis=1)] = False  # such a row stays absent as a whole
    true = velocity.true_covariance_m2ps2
    return Velocity(
        velocity.t_s,
        np.einsum("nij,nj->ni", omega, np.where(absent, 0.0, velocity.mps)),
        _turned(omega, _widened(velocity.covariance_m2ps2, absent)),
        "enu",
        None if true is None else _turned(omega, _widened(true, absent)),
    )


def floored(covariance: FloatArray) -> FloatArray:
    """Raise each diagonal element to the floor; the off-diagonals stay."""
    raised = covariance.copy()
    diagonal = np.einsum("nii->ni", raised)
    np.maximum(diagonal, VARIANCE_FLOOR, out=diagonal)
    return raised


def _widened(covariance: FloatArray, absent: BoolArray) -> FloatArray:
    """The covariance with the variance of an absent axis where ``nothing`` (n, 3) is known."""
    either = absent[:, :, None] | absent[:, None, :]
    return np.where(either, ABSENT_SIGMA_MPS**2 * np.eye(3), covariance)


def _turned(omega: FloatArray, covariance: FloatArray) -> FloatArray:
    """Omega C Omega', symmetric to the bit."""
    turned = np.einsum("nij,njk,nlk->nil", omega, covariance, omega)
    return np.asarray(0.5 * (turned + turned.transpose(0, 2, 1)))


INITIAL_SPEED_SIGMA_MPS = 10.0
"""One sigma of a velocity axis that nothing measures in the last second before the start, or at it."""

INITIAL_SPEED_AGE_S = 1.0
"""The largest age of a velocity to start from."""

INPUT_SIGMA_MPS2 = 0.5
"""One sigma of what is wrong with u on each axis, alike over the second: above all gravity that leaks by the tilt."""

UNSEEN_SIGMA_MPS2 = 2.0
"""One sigma of the acceleration of a vehicle while no IMU sees it."""


_AT_START = np.diag([1.0] * 3 + [INITIAL_SPEED_SIGMA_MPS**2] * 3)


@dataclass(frozen=True, eq=False)
class Start:
    """What a run starts from, whatever it is told of R.

    Attributes:
        position_m: (3,) of the first fix.
        covariance_m2: (3, 3) likewise, whatever its floor.
        velocities: of each measurement of some axes: their rows of x, z moved up to the fix, R whatever its floor, and
            the variance that moving it adds to each axis.
    """

    position_m: FloatArray
    covariance_m2: FloatArray
    velocities: tuple[tuple[IntArray, FloatArray, FloatArray, float], ...]

    def motion(self, position: float = 1.0, velocity: float = 1.0) -> tuple[FloatArray, FloatArray]:
        """Return x0 (6,) and P0 (6, 6) of a filter that is told these factors on R."""
        x0, P0 = np.zeros(6), _AT_START.copy()
        x0[:3], P0[:3, :3] = self.position_m, _told(self.covariance_m2, position)
        for axes, z, R, grown in self.velocities:
            told = _told(R, velocity)
            x0[axes], P0[axes[:, None], axes] = _bounded(z, told + grown * np.eye(len(axes)) if grown else told)
        return x0, P0


motion_told = lru_cache(maxsize=8192)(Start.motion)  # a kB each
"""The same, found once for the settings of a search that share these factors."""


def _told(R: FloatArray, factor: float) -> FloatArray:
    """The factor times R (k, k), the diagonal not below the floor."""
    told = factor * R
    for k in range(len(told)):
        told[k, k] = max(told[k, k], VARIANCE_FLOOR)
    return told


def start_of(measurements: Measurements, first: int, attitude: Attitude | None, dt0_s: float) -> Start:
    """Return the position of the fix ``first``, and the velocity as it was last measured, moved up to it.

    Each velocity axis comes from its latest measurement of the last second up to the fix; axes of the same measurement
    keep their covariances. With tau its age, and the input u of the part tau_u of it that the IMU saw (nothing where
    ``attitude`` is None: there is no IMU)::

        v = z + int u dt;  P = R + (tau_u .5 m/s2)^2 I + ((tau - tau_u) 2 m/s2)^2 I

    An axis that was not measured by then is 0 +- 10 m/s: what comes later is an update, and must not be used twice. A
    measurement that is no surer than that in some direction (a speed, across) is not taken there.
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
    """Row of the latest measurement of each velocity axis (3,) in the last second up to the fix; -1: there is none."""
    t_ns = measurements.t_ns
    begin = int(np.searchsorted(t_ns, t_ns[first] - round(INITIAL_SPEED_AGE_S * 1e9)))
    measured = np.isfinite(measurements.z[begin : first + 1, 3:])
    return np.where(measured.any(axis=0), first - np.argmax(measured[::-1], axis=0), -1)


def _bounded(z: FloatArray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A velocity and its covariance, 0 +- 10 m/s along the principal axes where it is no surer."""
    if R.trace() < INITIAL_SPEED_SIGMA_MPS**2:  # the sum of all variances
        return z, R
    variances, axes = np.linalg.eigh(R)
    sure = variances < INITIAL_SPEED_SIGMA_MPS**2
    if sure.all():
        return z, R
    kept = axes[:, sure]
    P = axes * np.where(sure, variances, INITIAL_SPEED_SIGMA_MPS**2) @ axes.T
    return kept @ (kept.T @ z), 0.5 * (P + P.T)


def _gained(attitude: Attitude | None, dt0_s: float, begin_s: float, end_s: float) -> tuple[FloatArray, float]:
    """The integral (3,) of the input u between two times, and how much of that time an IMU saw."""
    if attitude is None:
        return np.zeros(3), 0.0
    t_s = attitude.t_s
    first, last = np.searchsorted(t_s, (begin_s, end_s))
    nodes_s = np.append(t_s[first - 1] if first else t_s[0] - dt0_s, t_s[first : last + 1])
    parts_s = np.diff(np.clip(nodes_s, begin_s, end_s))
    return parts_s @ attitude.accel_enu_mps2[first : last + 1], float(parts_s.sum())


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


# The timelines of the latest recordings, for the next adaptation.

kept_timeline = lru_cache(maxsize=32)(build_timeline)
"""`build_timeline`, done once for a recording with its attitude; as many as a process keeps recordings."""


class Run(NamedTuple):
    """A run without its filter."""

    timeline: Timeline
    scoring: ErrorWeights


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A run of an estimator, which sees the recording itself.

    Attributes:
        reported: the recording, with the covariances that the receiver reports.
        attitude: its attitude.
        timeline: that of `recording` and the attitude.
        scoring: what the errors count for.
        r_scale: what the estimator is told of those covariances.
    """

    reported: Recording
    attitude: Attitude
    timeline: Timeline
    scoring: ErrorWeights
    r_scale: RScale = AS_REPORTED

    @cached_property
    def recording(self) -> Recording:
        """The recording as the estimator is told it; made where it is asked for, which takes longer than a run."""
        return with_r_scale(self.reported, self.r_scale)
