"""The results of a run: the attitude, the navigation solution at the stamps of the reference, or sums of its errors."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.recording import shown, stamps_text

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Attitude:
    """Orientation and gravity-compensated acceleration at the IMU's stamps.

    Attributes:
        t_s: (n,) stamps of the IMU.
        dcm: (n, 3, 3) Omega, body FLU -> ENU.
        euler_rad: (n, 3) roll, pitch, yaw; Omega = Rz(yaw) Ry(pitch) Rx(roll).
        accel_enu_mps2: (n, 3) the input u of the navigation filter.
        triggered: (n,) whether the tilt filter saw an external acceleration.
        yaw_sigma_rad: (n,) one standard deviation of yaw as its filter sees it, or None: it has none. Where nothing
            shows yaw it is that of any direction, pi/sqrt(3).
    """

    t_s: FloatArray
    dcm: FloatArray
    euler_rad: FloatArray
    accel_enu_mps2: FloatArray
    triggered: BoolArray
    yaw_sigma_rad: FloatArray | None = None


def no_attitude(t_s: FloatArray) -> Attitude:
    """Return the attitude of a recording without an IMU: unknown (NaN) at ``t_s`` (n,), and no input."""
    n = len(t_s)
    never = np.zeros(n, dtype=np.bool_)
    return Attitude(t_s, np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan), np.zeros((n, 3)), never)


@dataclass(frozen=True, eq=False)
class Updates:
    """The innovations of the measurement updates; the basis of consistency checks.

    Attributes:
        t_s: (m,) times of the updates.
        rows: (m,) how many rows the update had.
        nis: (m,) y' (H P- H' + R)^-1 y with the reported R and the prior before any fading.
        nis_used: (m,) the same with the S that was used; NaN where every row was dropped.
        innovation: (m, 6) y, NaN where a row was absent.
        R_diagonal: (m, 6) diagonal of the adapted R, NaN where a row was absent, infinite where it was dropped.
        log_det: (m,) log det (H P- H' + R), as in nis; NaN where it was not kept.
    """

    t_s: FloatArray
    rows: FloatArray
    nis: FloatArray
    nis_used: FloatArray
    innovation: FloatArray
    R_diagonal: FloatArray
    log_det: FloatArray = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        """Fill in ``log_det``."""
        if self.log_det is None:
            object.__setattr__(self, "log_det", np.full(len(self.t_s), np.nan))

    @classmethod
    def empty(cls) -> "Updates":
        """No update at all (an estimator that has none)."""
        none = np.empty(0)
        return cls(none, none, none, none, np.empty((0, 6)), np.empty((0, 6)))


@dataclass(frozen=True, eq=False)
class Estimate:
    """The navigation solution at the reference's stamps (only those that the run reached).

    Attributes:
        index: (k,) which rows of the reference these are.
        position_m: (k, 3) ENU.
        velocity_mps: (k, 3) ENU.
        covariance: (k, 6, 6) of position and velocity.
        euler_rad: (k, 3) roll, pitch, yaw that the run used.
        updates: what the measurement updates saw.
        failure: why the run stopped early, or an empty string.
        attitude_only: whether only the attitude was estimated; position, velocity and covariance are NaN then.
        position_only: whether no velocity was estimated; it is NaN then.
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
        """Return how many estimates and updates it has, and why it stopped early."""
        stopped = f", stopped early: {' '.join(self.failure.split())}" if self.failure else ""
        return f"Estimate({len(self.index)} estimates, {len(self.updates.t_s)} updates{stopped})"

    def to_frame(self, t_s: FloatArray | None = None) -> "pd.DataFrame":
        """Return a data frame with a row for each estimate, in ENU.

        Args:
            t_s: the reference's stamps (``recording.reference.t_s``): the frame has a column of them then.

        Returns:
            Columns position, velocity and one sigma of each (``east_m``, ``velocity_east_mps``, ``sigma_east_m``,
            ``sigma_velocity_east_mps``, ...), and ``roll_rad``, ``pitch_rad``, ``yaw_rad``. The index is the row of the
            reference.
        """
        import pandas as pd

        sigma = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        axes = ("east", "north", "up")
        parts = {
            tuple(f"{axis}_m" for axis in axes): self.position_m,
            tuple(f"velocity_{axis}_mps" for axis in axes): self.velocity_mps,
            tuple(f"sigma_{axis}_m" for axis in axes): sigma[:, :3],
            tuple(f"sigma_velocity_{axis}_mps" for axis in axes): sigma[:, 3:],
            ("roll_rad", "pitch_rad", "yaw_rad"): self.euler_rad,
        }
        columns = {name: values[:, k] for names, values in parts.items() for k, name in enumerate(names)}
        stamps = {} if t_s is None else {"t_s": t_s[self.index]}
        return pd.DataFrame({**stamps, **columns}, index=pd.Index(self.index, name="reference_row"))

    def _repr_html_(self) -> str:
        """Return how far it went and how sure it is, as a notebook shows it."""
        lines = {"estimates": str(len(self.index)), "updates": stamps_text(self.updates.t_s)}
        if len(self.index) and not self.attitude_only:
            sigma = np.sqrt(np.diagonal(self.covariance[-1])[:3])
            lines["at its end"] = "sigma of the position " + ", ".join(f"{value:.3g}" for value in sigma) + " m"
        return shown("Estimate", lines | ({"stopped early": self.failure} if self.failure else {}))


@dataclass(frozen=True, eq=False)
class ErrorWeights:
    """The weights of a run's errors, at the k stamps of the reference that it visits.

    Attributes:
        truth: (k, 6) position and velocity of the reference; 0 where a velocity is not known.
        counted: (k,) 1 where the errors count, else 0.
        whole: (k,) 1 where they count with the burn-in, else 0.
        moving: (k,) 1 where the velocity errors count, else 0.
        outage: (k,) 1 where they count for the outages, else 0.
        marks: (j,) rows whose position errors are kept.
        start_s: from when on updates count.
        consistency: whether covariances are asked for: the sums of e' P^-1 e, and those of the marked rows. They take a
            quarter of a run without a trajectory.
        limit_m: a run with a larger position error strays.
    """

    truth: FloatArray
    counted: FloatArray
    whole: FloatArray
    moving: FloatArray
    outage: FloatArray
    marks: IntArray
    start_s: float
    consistency: bool = True
    limit_m: float = math.inf


SUMS = 17
"""Sums that a run adds up, the first thirteen parts of `Streamed`: each has a place in the array of them."""
POSITION_SQUARES, VELOCITY_SQUARES = 0, 3
WHOLE, OUTAGE, MAX_ERROR, STRAYED, ROWS_LEFT, NEES, NEES_POSITION, NIS, UPDATES, NIS_USED, UPDATES_USED = range(6, SUMS)


class Streamed(NamedTuple):
    """Sums over a run, of squares where nothing else is said, and what its updates saw.

    Attributes:
        position_m2: (3,) east, north, up.
        velocity_m2ps2: (3,) likewise.
        whole_m2: of the position, with the burn-in.
        outage_m2: of the position, inside the outages.
        largest_m2: the largest of the position, where it counts.
        strayed_m2: the first of the position beyond the limit; 0: there is none.
        rows_left: how many rows there were from that one on.
        nees: sum of e' P^-1 e; NaN where it was not wanted.
        nees_position: the same of the position alone.
        nis_per_row: sum of nis/m over the updates that count.
        nis_updates: their number.
        nis_used_per_row: the same with the S that was used and the rows that were kept.
        nis_used_updates: their number.
        marked_m: (j, 3) position errors at the marks.
        marked_m2: (j, 6) the upper triangle of their covariance, row by row; NaN where it was not wanted.
        updates: what the updates saw, or none where they were not kept.
        euler_rad: (k, 3) roll, pitch, yaw of the run itself; None: those of the timeline, or not kept.
    """

    position_m2: FloatArray
    velocity_m2ps2: FloatArray
    whole_m2: float
    outage_m2: float
    largest_m2: float
    strayed_m2: float
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
        """Return these from ``sums`` (SUMS,) and ``marked`` (j, 9), error and covariance at the marks."""
        squares, numbers = sums[:WHOLE], sums[WHOLE:].tolist()
        return cls._make([squares[:3], squares[3:], *numbers, marked[:, :3], marked[:, 3:], updates, euler_rad])


class Sums(NamedTuple):
    """Sums over the rows of a run; which rows, `jerkbench.evaluation.counted_rows` says.

    Attributes:
        position_m2: (5,) sum of |e|^2 over the axes of each of POSITION_AXES.
        position_rows: (5,) their number.
        position_max_m: the largest |e|; NaN without rows.
        whole_m2: sum of |e|^2, the burn-in too.
        whole_rows: their number.
        velocity_m2ps2: (3,) sum of |e|^2 over the axes of each of VELOCITY_AXES.
        velocity_rows: (3,) their number.
        nees: sum of e' P^-1 e, position and velocity.
        nees_rows: their number.
        nees_position: sum of e' P^-1 e of position, over ``position_rows[0]`` rows.
        nis_per_row: sum over updates of nis/m, reported R.
        nis_updates: their number.
        nis_used_per_row: the same with the S that was used and the rows that were not dropped.
        nis_used_updates: their number.
        outage_m2: sum of |e|^2 of position inside outages.
        outage_rows: their number.
        outage_ends_m: (j,) |e| at the end of each outage.
        outage_driven_m: (j,) how far the reference went in each.
        outage_drifts_mps: (j,) change of e from its first to its last row, per second; NaN where they are one.
        outages: number of outages of the recording, reached or not.
        sampled_m: (s, 3) position errors once a second, at the first row that counts.
        sampled_m2: (s, 6) the upper triangle of their covariance, row by row.
    """

    position_m2: FloatArray
    position_rows: FloatArray
    position_max_m: float
    whole_m2: float
    whole_rows: float
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
        """(s, 3, 3) covariances of the position once a second."""
        return self.sampled_m2[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
