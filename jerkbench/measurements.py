"""(Recording, Attitude) -> Measurements: position and velocity as rows of z = [p; v]."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude
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
    streams = []
    if recording.position is not None:
        p = recording.position
        true = p.covariance_m2 if p.true_covariance_m2 is None else p.true_covariance_m2
        streams.append((0, p.t_s, p.enu_m, p.covariance_m2, true))
    if recording.velocity is not None:
        v = velocity_in_enu(recording.velocity, attitude)
        true = v.covariance_m2ps2 if v.true_covariance_m2ps2 is None else v.true_covariance_m2ps2
        streams.append((3, v.t_s, v.mps, v.covariance_m2ps2, true))
    stamps = [np.round(t_s * 1e9).astype(np.int64) for _, t_s, *_ in streams]
    t_ns = np.unique(np.concatenate([*stamps, np.empty(0, dtype=np.int64)]))
    z, R, R_true = np.full((len(t_ns), 6), np.nan), *np.tile(np.eye(6), (2, len(t_ns), 1, 1))
    for (at, _, values, reported, true), stamp in zip(streams, stamps, strict=True):
        rows, block = np.searchsorted(t_ns, stamp), slice(at, at + 3)
        z[rows, block], R[rows, block, block], R_true[rows, block, block] = values, reported, true
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


# Position and velocity at the start of a run, and their covariance.

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
