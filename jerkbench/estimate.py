"""The results of a run: the attitude, the navigation solution at the stamps of the reference, and sums of errors."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Attitude:
    """Orientation and gravity-compensated acceleration at the stamps of the IMU.

    Attributes:
        t_s: (n,) stamps of the IMU [s].
        dcm: (n, 3, 3) rotation matrix Omega from body (FLU) to ENU.
        euler_rad: (n, 3) roll, pitch and yaw [rad], with Omega = Rz(yaw) Ry(pitch) Rx(roll).
        accel_enu_mps2: (n, 3) acceleration in ENU [m/s2], the input u of the navigation filter.
        triggered: (n,) mask of the samples at which the tilt filter detected an external acceleration.
        yaw_sigma_rad: (n,) standard deviation of yaw [rad], or None if the attitude filter does not compute it. Without
            information about yaw, the standard deviation is pi/sqrt(3), as for a uniform distribution.
    """

    t_s: FloatArray
    dcm: FloatArray
    euler_rad: FloatArray
    accel_enu_mps2: FloatArray
    triggered: BoolArray
    yaw_sigma_rad: FloatArray | None = None


def no_attitude(t_s: FloatArray) -> Attitude:
    """Return the attitude of a recording without an IMU: all angles are NaN, and the input u is zero."""
    n = len(t_s)
    never = np.zeros(n, dtype=np.bool_)
    return Attitude(t_s, np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan), np.zeros((n, 3)), never)


@dataclass(frozen=True, eq=False)
class Updates:
    """The innovations of the measurement updates, from which consistency metrics are computed.

    Columns 0 to 2 are the position [m] and columns 3 to 5 are the velocity [m/s] in ENU.

    Attributes:
        t_s: (m,) times of the updates [s].
        rows: (m,) number of measured rows of each update.
        nis: (m,) NIS y' (H P- H' + R)^-1 y with the reported R and the prior covariance P- before fading.
        nis_used: (m,) NIS y' S^-1 y with the innovation covariance S after the adaptation, or NaN if all rows were
            dropped.
        innovation: (m, 6) innovation y, with NaN in rows that were not measured.
        R_diagonal: (m, 6) diagonal of the adapted R: NaN in rows that were not measured, infinite in dropped rows.
        log_det: (m,) log det (H P- H' + R) with the matrices of ``nis``, or NaN if it was not computed.
    """

    t_s: FloatArray
    rows: FloatArray
    nis: FloatArray
    nis_used: FloatArray
    innovation: FloatArray
    R_diagonal: FloatArray
    log_det: FloatArray = None  # type: ignore[assignment]  # `__post_init__` replaces None

    def __post_init__(self) -> None:
        """Replace a missing ``log_det`` by NaN."""
        if self.log_det is None:
            object.__setattr__(self, "log_det", np.full(len(self.t_s), np.nan))

    @classmethod
    def empty(cls) -> "Updates":
        """Return updates of length zero, for an estimator that stores no updates."""
        none = np.empty(0)
        return cls(none, none, none, none, np.empty((0, 6)), np.empty((0, 6)))


@dataclass(frozen=True, eq=False)
class Estimate:
    """The navigation solution, at the stamps of the reference that the run has reached.

    Attributes:
        index: (k,) increasing row numbers of the reference.
        position_m: (k, 3) position in ENU [m].
        velocity_mps: (k, 3) velocity in ENU [m/s].
        covariance: (k, 6, 6) covariance of position and velocity [m2, m2/s, m2/s2].
        euler_rad: (k, 3) roll, pitch, yaw that the run used [rad].
        updates: Data of the measurement updates.
        failure: Reason why the run stopped early, or an empty string.
        attitude_only: True if only the attitude was estimated, so that position, velocity and covariance are NaN.
        position_only: True if no velocity was estimated, so that the velocity is NaN.
    """

    index: "np.ndarray[tuple[int], np.dtype[np.int64]]"
    position_m: FloatArray
    velocity_mps: FloatArray
    covariance: FloatArray
    euler_rad: FloatArray
    updates: Updates = field(default_factory=Updates.empty)
    failure: str = ""
    attitude_only: bool = False
    position_only: bool = False

    def __repr__(self) -> str:
        stopped = f", stopped early: {' '.join(self.failure.split())}" if self.failure else ""
        return f"Estimate({len(self.index)} estimates, {len(self.updates.t_s)} updates{stopped})"

    def to_frame(self, t_s: FloatArray | None = None) -> "pd.DataFrame":
        """Return a data frame in ENU with one row for each estimate.

        Args:
            t_s: Stamps of the reference (``recording.reference.t_s``) for the optional column ``t_s`` [s].

        Returns:
            Columns with position, velocity and their standard deviations (``east_m``, ``velocity_east_mps``,
            ``sigma_east_m``, ``sigma_velocity_east_mps``, ...), and ``roll_rad``, ``pitch_rad``, ``yaw_rad``. The index
            of the frame is the row number of the reference.
        """
        import pandas as pd

        sigma = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        names = ("{}_m", "velocity_{}_mps", "sigma_{}_m", "sigma_velocity_{}_mps")
        columns = [name.format(axis) for name in names for axis in ("east", "north", "up")]
        values = np.hstack([self.position_m, self.velocity_mps, sigma, self.euler_rad])
        index = pd.Index(self.index, name="reference_row")
        frame = pd.DataFrame(values, index, [*columns, "roll_rad", "pitch_rad", "yaw_rad"])
        if t_s is not None:
            frame.insert(0, "t_s", t_s[self.index])
        return frame


@dataclass(frozen=True, eq=False)
class ErrorWeights:
    """The true position and velocity at the k stamps of the reference, and the weights of the errors in the sums.

    Attributes:
        truth: (k, 6) position [m] and velocity [m/s] of the reference in ENU, with 0 for an unknown velocity.
        counted: (k,) 1 if the errors at the stamp count, otherwise 0.
        with_burn_in: (k,) 1 if the error at the stamp counts in sums that include the burn-in, otherwise 0.
        moving: (k,) 1 if the velocity error at the stamp counts, otherwise 0.
        outage: (k,) 1 if the error at the stamp counts as an error during an outage, otherwise 0.
        marks: (j,) rows of the reference at which the position errors are stored.
        start_s: Updates before this time are not counted [s].
        consistency: True if the sums of e' P^-1 e and the covariances of the marked rows are needed. The computation of
            these sums takes a quarter of the time of a run that stores no trajectory.
        limit_m: A run whose position error exceeds this limit has diverged [m].
    """

    truth: FloatArray
    counted: FloatArray
    with_burn_in: FloatArray
    moving: FloatArray
    outage: FloatArray
    marks: IntArray
    start_s: float
    consistency: bool = True
    limit_m: float = math.inf


SUMS = 17
"""Number of sums of a run, which are the first 13 fields of `Streamed`. The next constants are indices of the sums."""
POSITION_SQUARES, VELOCITY_SQUARES = 0, 3
WITH_BURN_IN, OUTAGE, MAX_ERROR, DIVERGED, ROWS_LEFT, NEES, NEES_POSITION = range(6, 13)
NIS, UPDATES, NIS_USED, UPDATES_USED = range(13, SUMS)


class Streamed(NamedTuple):
    """Sums over a run whose trajectory is not stored, and the data of its updates.

    Attributes:
        position_m2: (3,) sums of the squared position errors (east, north, up) [m2].
        velocity_m2ps2: (3,) sums of the squared velocity errors (east, north, up) [m2/s2].
        with_burn_in_m2: Sum of the squared position errors, including the burn-in [m2].
        outage_m2: Sum of the squared position errors during outages [m2].
        largest_m2: Largest squared position error of a row that counts [m2].
        diverged_m2: First squared position error beyond the limit, or 0 if the run has not diverged [m2].
        rows_left: Number of rows of the reference from the divergence to the end of the run.
        nees: Sum of e' P^-1 e over the errors e of position and velocity, or NaN if the sum was not needed.
        nees_position: Sum of e' P^-1 e over the position errors e, or NaN if the sum was not needed.
        nis_per_row: Sum of NIS/m over the updates that count, with the reported R and m measured rows.
        nis_updates: Number of updates in ``nis_per_row``.
        nis_used_per_row: Sum of NIS/m over the updates that count, with the adapted S and without dropped rows.
        nis_used_updates: Number of updates in ``nis_used_per_row``.
        marked_m: (j, 3) position errors in the rows ``ErrorWeights.marks`` [m].
        marked_m2: (j, 6) upper triangle of the position covariance in the rows ``ErrorWeights.marks``, row by row, or
            NaN if the covariance was not needed [m2].
        updates: Data of the updates, with arrays of length zero if the data were not stored.
        euler_rad: (k, 3) roll, pitch, yaw that the run has estimated [rad], or None if the run used the angles of the
            timeline or did not store the angles.
    """

    position_m2: FloatArray
    velocity_m2ps2: FloatArray
    with_burn_in_m2: float
    outage_m2: float
    largest_m2: float
    diverged_m2: float
    rows_left: float
    nees: float
    nees_position: float
    nis_per_row: float
    nis_updates: float
    nis_used_per_row: float
    nis_used_updates: float
    marked_m: FloatArray
    marked_m2: FloatArray
    updates: Updates
    euler_rad: FloatArray | None = None

    @classmethod
    def of(cls, sums: FloatArray, marked: FloatArray, updates: Updates, euler_rad: FloatArray | None = None) -> Self:
        """Create an object from ``sums`` (SUMS,) and ``marked`` (j, 9), the errors and covariances at marked rows."""
        squares, numbers = sums[:WITH_BURN_IN], sums[WITH_BURN_IN:].tolist()
        return cls._make([squares[:3], squares[3:], *numbers, marked[:, :3], marked[:, 3:], updates, euler_rad])


# The sums of a stored trajectory, which may contain NaN at stamps whose errors are not scored.

UPPER = np.triu_indices(3)


@np.errstate(all="ignore")
def scored_trajectory(estimate: Estimate, scoring: ErrorWeights) -> Streamed:
    """Return the error sums of a trajectory. A sum is NaN if one of the scored errors is NaN."""
    k, sums = len(estimate.index), np.zeros(SUMS)
    errors = np.hstack([estimate.position_m, estimate.velocity_mps]) - scoring.truth[:k]
    counted, with_burn_in, moving, outage = (
        weights[:k] > 0.0 for weights in (scoring.counted, scoring.with_burn_in, scoring.moving, scoring.outage)
    )
    square = (errors[:, :3] ** 2).sum(axis=1)
    sums[POSITION_SQUARES : POSITION_SQUARES + 3] = (errors[counted, :3] ** 2).sum(axis=0)
    sums[VELOCITY_SQUARES : VELOCITY_SQUARES + 3] = (errors[moving, 3:] ** 2).sum(axis=0)
    sums[WITH_BURN_IN], sums[OUTAGE] = square[with_burn_in].sum(), square[outage].sum()
    sums[MAX_ERROR] = square[counted].max(initial=0.0)
    position, both = _squared_distances(errors[counted], estimate.covariance[counted])
    sums[NEES_POSITION], sums[NEES] = position.sum(), both[moving[counted]].sum()
    _add_updates(sums, estimate.updates, scoring.start_s)
    marked = np.zeros((len(scoring.marks), 9))
    reached = scoring.marks < k
    rows = scoring.marks[reached]
    marked[reached] = np.hstack([errors[rows, :3], estimate.covariance[rows][:, UPPER[0], UPPER[1]]])
    return Streamed.of(sums, marked, estimate.updates, estimate.euler_rad)


def _squared_distances(errors: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the NEES (n,) of position, and of position and velocity, with NaN if P is not positive definite."""
    C, e = covariance.transpose(1, 2, 0).copy(), errors.T.copy()
    total = np.zeros(len(errors))
    for c in range(6):
        pivot = np.where(C[c, c] > 0.0, C[c, c], np.nan)
        total = total + e[c] * e[c] / pivot
        for r in range(c + 1, 6):
            factor = C[r, c] / pivot
            e[r] -= factor * e[c]
            C[r, c + 1 :] -= factor * C[c, c + 1 :]
        if c == 2:
            position = total
    return position, total


def _add_updates(sums: FloatArray, updates: Updates, start_s: float) -> None:
    """Add the NIS per measurement row to the sums, with the reported R and with the R and rows after the adaptation."""
    used_rows = updates.rows - np.isinf(updates.R_diagonal).sum(axis=1)
    for rows, nis, total, count in (
        (updates.rows, updates.nis, NIS, UPDATES),
        (used_rows, updates.nis_used, NIS_USED, UPDATES_USED),
    ):
        counts = (updates.t_s >= start_s) & (rows > 0)
        sums[total], sums[count] = (nis[counts] / rows[counts]).sum(), counts.sum()


# The sums that the metrics read.


class Sums(NamedTuple):
    """Sums of the errors e of a run over the rows of the reference that count (`jerkbench.evaluation.counted_rows`).

    Attributes:
        position_m2: (5,) sum of the squared position errors for each set of axes in POSITION_AXES [m2].
        position_rows: (5,) number of rows in each sum of ``position_m2``.
        position_max_m: Largest |e| of the position, or NaN if no row counts [m].
        with_burn_in_m2: Sum of |e|^2 of the position, including the burn-in [m2].
        rows_with_burn_in: Number of rows in ``with_burn_in_m2``.
        velocity_m2ps2: (3,) sum of the squared velocity errors for each set of axes in VELOCITY_AXES [m2/s2].
        velocity_rows: (3,) number of rows in each sum of ``velocity_m2ps2``.
        nees: Sum of e' P^-1 e over the errors e of position and velocity.
        nees_rows: Number of rows in ``nees``.
        nees_position: Sum of e' P^-1 e over the position errors e in ``position_rows[0]`` rows.
        nis_per_row: Sum of NIS/m over the updates, with the reported R and m measured rows.
        nis_updates: Number of updates in ``nis_per_row``.
        nis_used_per_row: Sum of NIS/m over the updates, with the adapted S and without dropped rows.
        nis_used_updates: Number of updates in ``nis_used_per_row``.
        outage_m2: Sum of |e|^2 of the position during outages [m2].
        outage_rows: Number of rows in ``outage_m2``.
        outage_ends_m: (j,) |e| of the position at the end of each outage [m].
        outage_driven_m: (j,) distance that the reference covers during each outage [m].
        outage_drifts_mps: (j,) length of the change of the position error from the first to the last row of each
            outage, divided by the time between these rows, or NaN if an outage has only one row [m/s].
        outages: Number of outages in the recording, including outages that the run did not reach.
        sampled_m: (s, 3) position error in the first counted row of each second [m].
        sampled_m2: (s, 6) upper triangle of the position covariance in the rows of ``sampled_m``, row by row [m2].
    """

    position_m2: FloatArray
    position_rows: FloatArray
    position_max_m: float
    with_burn_in_m2: float
    rows_with_burn_in: float
    velocity_m2ps2: FloatArray
    velocity_rows: FloatArray
    nees: float
    nees_rows: float
    nees_position: float
    nis_per_row: float
    nis_updates: float
    nis_used_per_row: float
    nis_used_updates: float
    outage_m2: float
    outage_rows: float
    outage_ends_m: FloatArray
    outage_driven_m: FloatArray
    outage_drifts_mps: FloatArray
    outages: int
    sampled_m: FloatArray
    sampled_m2: FloatArray

    @property
    def sampled_covariance_m2(self) -> FloatArray:
        """Covariances (s, 3, 3) of the position in the rows of ``sampled_m`` [m2]."""
        return self.sampled_m2[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
