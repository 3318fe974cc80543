"""The estimates: the attitude at the IMU's stamps, and the navigation solution at the reference's stamps."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
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
