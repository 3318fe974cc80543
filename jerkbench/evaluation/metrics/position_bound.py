"""The posterior Cramer-Rao bound of the position."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import known_axes, on_all
from jerkbench.evaluation.riccati import Motion, Noise, position_variances
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Velocity

NEAR_STEPS = 1e-6
"""A stamp that is so near to a sample of the IMU, in its intervals, is at it."""


@register("metric", "position_bound")
@dataclass(frozen=True)
class PositionBound:
    """Posterior Cramer-Rao bound on the position RMSE: what no filter can expect to beat, from the true noises alone.

    A simulation knows what the errors of its sensors were drawn from. Each axis then is the linear system

        p' = p + dt v + dt^2/2 (u - w),   v' = v + dt (u - w),   w ~ N(0, sigma_a^2) in each sample of the IMU
        z_p = p + sqrt(1 - s) n + sqrt(s) b,   z_v alike,   b' = exp(-dt/T) b + sqrt(1 - exp(-2 dt/T)) n'

    with the noise of position and velocity as in `field` (s = 0: white), and its posterior covariance P, by Riccati's
    recursion over the recording's own stamps, bounds every error. Over the counted rows i::

        position_bound_m = sqrt(1/N sum tr P_pos,i),   mean square of position_rmse_m over seeds >= position_bound_m^2

    Nothing of an estimate enters: all methods of a scenario have the same. At the start nothing is known of position
    and velocity. The attitude, a latency and a lever arm count as known, so that it is the lower for those. It bounds
    estimators without hindsight that take the motion for unknown; a smoother, or one that knows how the vehicle drives,
    may be below it. A single run may be, too, by chance.

    NaN where the true noises are not known, or the system is not linear and Gaussian: real recordings, IMU grades,
    false forces (ruts, impacts), samples that were cut off, and disturbances that change what a sensor measured.
    Outages, and fixes that are left out, it takes into account. Not computed unless asked for:
    ``metrics=[position_rmse,position_bound]``; the table of the position RMSE then has it as a row.

    Source: doi:10.1109/78.668800 (Tichavsky, Muravchik and Nehorai, 1998).
    """

    default: ClassVar[bool] = False
    reads: ClassVar[Literal["attitude"]] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the bound by column name."""
        rows = estimate.index[counted & on_all(known_axes(recording.reference.enu_m, estimate.index), (0, 1, 2))]
        variances = _variances(recording)
        steps = None if variances is None else _steps(recording.reference.t_s[rows], recording.inertial.t_s)
        if variances is None or steps is None or not len(steps):
            return {"position_bound_m": np.nan}
        return {"position_bound_m": float(np.sqrt(variances[steps].sum(axis=1).mean()))}


def _variances(recording: Recording) -> FloatArray | None:
    """Return (n + 1, 3) after each sample of the IMU; None where the system is not known."""
    law, position, velocity = recording.drawn, recording.position, recording.velocity
    if law is None or recording.imu is not law.imu:
        return None
    streams = [stream for stream in (position, velocity) if stream is not None]
    t_s = np.unique(np.concatenate([stream.t_s for stream in streams] or [np.empty(0)]))
    steps = _steps(t_s, law.imu.t_s)
    of_position = _noise(law.position, law.position_share, law.position_time_s, position, t_s)
    of_velocity = _noise(law.velocity, law.velocity_share, law.velocity_time_s, velocity, t_s)
    if steps is None or of_position is None or of_velocity is None:
        return None
    motion = Motion(_interval_s(law.imu.t_s), law.accel_sigma_mps2, (law.position_time_s, law.velocity_time_s))
    return position_variances(motion, steps, of_position, of_velocity, len(law.imu.t_s))


def _interval_s(t_s: FloatArray) -> float:
    return float(t_s[-1] - t_s[0]) / (len(t_s) - 1)


def _steps(t_s: FloatArray, imu_s: FloatArray) -> IntArray | None:
    """Return how many samples of the IMU have ended by each time; None where one has not just ended."""
    places = (t_s - imu_s[0]) / _interval_s(imu_s) + 1
    steps = np.round(places).astype(np.int64)
    at_samples = np.abs(places - steps) < NEAR_STEPS * len(imu_s)
    return steps if at_samples.all() and (steps >= 0).all() and (steps <= len(imu_s)).all() else None


def _noise(
    drawn: Position | Velocity, share: float, time_s: float, stream: Position | Velocity | None, t_s: FloatArray
) -> Noise | None:
    """Return the noise of ``stream`` at ``t_s`` (m,); None where a value in it is not one that was ``drawn``."""
    white, lasting = np.full((len(t_s), 3), np.inf), np.zeros((len(t_s), 3))
    if stream is None:
        return Noise(white, lasting, time_s)
    (drawn_s, drawn_values, covariance), (own_s, values, _) = _parts(drawn), _parts(stream)
    rows = np.minimum(np.searchsorted(drawn_s, own_s), len(drawn_s) - 1)
    measured = np.isfinite(values)
    same = (drawn_s[rows] == own_s)[:, None] & ((drawn_values[rows] == values) | ~measured)
    if not same.all() or (isinstance(stream, Velocity) and stream.frame != "enu"):
        return None
    variance, at = np.diagonal(covariance[rows], axis1=1, axis2=2), np.searchsorted(t_s, own_s)
    white[at] = np.where(measured, (1 - share) * variance, np.inf)
    lasting[at] = np.where(measured, np.sqrt(share * variance), 0.0)
    return Noise(white, lasting, time_s)


def _parts(stream: Position | Velocity) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times, values and reported covariances."""
    if isinstance(stream, Position):
        return stream.t_s, stream.enu_m, stream.covariance_m2
    return stream.t_s, stream.mps, stream.covariance_m2ps2
