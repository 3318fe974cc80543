"""The lowest position error that any filter can reach: Riccati's recursion behind noisy inputs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import known_axes, on_all
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Velocity

FLAT_M, FLAT_MPS = 1e4, 1e3
"""One sigma of position and of velocity before anything was measured: nothing is known of them."""


class NoiseRows(NamedTuple):
    """Noise of a measurement, one row an update.

    Attributes:
        white: (m, 3) variance of what is new each time; infinite: the axis was not measured.
        lasting: (m, 3) standard deviation of the Gauss-Markov process; 0: there is none.
        time_s: its correlation time.
    """

    white: FloatArray
    lasting: FloatArray
    time_s: float


class Motion(NamedTuple):
    """Four states an axis, each axis alike: position, velocity, and the lasting noise of each in its own sigmas.

    Attributes:
        dt_s: interval of the input.
        accel_sigma_mps2: one sigma of the white noise of an input.
        times_s: correlation times of the lasting noise of position and velocity.
    """

    dt_s: float
    accel_sigma_mps2: float
    times_s: tuple[float, float]

    def over(self, steps: int) -> tuple[FloatArray, FloatArray]:
        """Return A (4, 4) and Q (4, 4) of as many inputs."""
        t, A, Q = steps * self.dt_s, np.eye(4), np.zeros((4, 4))
        keep = np.exp(-t / np.array(self.times_s))
        A[0, 1] = t
        A[[2, 3], [2, 3]] = keep
        power = self.accel_sigma_mps2**2 * self.dt_s
        Q[0, 0] = self.grown(np.array(steps))
        Q[0, 1] = Q[1, 0] = power * t**2 / 2
        Q[1, 1] = power * t
        Q[[2, 3], [2, 3]] = 1 - keep**2
        return A, Q

    def grown(self, steps: IntArray) -> FloatArray:
        """Return the variance of the position that as many inputs bring; their sum, done: the squares of j + 1/2."""
        squares = steps**3 / 3 - steps / 12
        return np.asarray(self.accel_sigma_mps2**2 * self.dt_s**4 * squares)


def position_variances(
    motion: Motion, updates: IntArray, position: NoiseRows, velocity: NoiseRows, steps: int
) -> FloatArray:
    """Return (steps + 1, 3): the variance of each axis's position after each input, and after the update there.

    Between updates P = A P A' + Q; at one, for position and then velocity, with h = [1, 0, l, 0] or [0, 1, 0, l]::

        P = P - P h' h P/(h P h' + r)

    It asks nothing of the measured values, for the recursion is linear; l is the sigma of the lasting noise.

    Args:
        motion: the model.
        updates: (m,) after how many inputs each update is, increasing.
        position: noise of position in each update.
        velocity: alike.
        steps: how many inputs there are.

    Source: Tichavsky, Muravchik and Nehorai, "Posterior Cramer-Rao bounds for discrete-time nonlinear filtering", IEEE
    Transactions on Signal Processing 46 (1998), doi:10.1109/78.668800: of a linear system it is Riccati's recursion.
    """
    variances = np.empty((steps + 1, 3))
    P = np.tile(np.diag([FLAT_M**2, FLAT_MPS**2, 1.0, 1.0]), (3, 1, 1))
    begin = 0
    for row, end in enumerate(updates.tolist()):
        P = _carried(variances, motion, P, begin, end)
        P = _updated(P, 0, position.white[row], position.lasting[row])
        P = _updated(P, 1, velocity.white[row], velocity.lasting[row])
        variances[end], begin = P[:, 0, 0], end
    _carried(variances, motion, P, begin, steps)
    return variances


def _carried(variances: FloatArray, motion: Motion, P: FloatArray, begin: int, end: int) -> FloatArray:
    """Return P after the inputs up to ``end``, and put the variances on the way into their places."""
    steps = np.arange(end - begin + 1)
    t_s = (steps * motion.dt_s)[:, None]
    ways = P[:, 0, 0] + 2 * t_s * P[:, 0, 1] + t_s**2 * P[:, 1, 1]
    variances[begin : end + 1] = ways + motion.grown(steps)[:, None]
    A, Q = motion.over(end - begin)
    return np.asarray(A @ P @ A.T + Q)


def _updated(P: FloatArray, state: int, white: FloatArray, lasting: FloatArray) -> FloatArray:
    """Return P (3, 4, 4) after a scalar measurement of each axis."""
    gathered = P[:, :, state] + lasting[:, None] * P[:, :, state + 2]
    S = gathered[:, state] + lasting * gathered[:, state + 2] + white
    return np.asarray(P - gathered[:, :, None] * gathered[:, None, :] / S[:, None, None])


# The posterior Cramer-Rao bound of the position.

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

    columns: ClassVar[Mapping[str, Column]] = {
        "position_bound_m": Column("Posterior Cramér-Rao bound of the position RMSE (3-D)", judged=False),
    }

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
) -> NoiseRows | None:
    """Return the noise of ``stream`` at ``t_s`` (m,); None where a value in it is not one that was ``drawn``."""
    white, lasting = np.full((len(t_s), 3), np.inf), np.zeros((len(t_s), 3))
    if stream is None:
        return NoiseRows(white, lasting, time_s)
    rows = np.minimum(np.searchsorted(drawn.t_s, stream.t_s), len(drawn.t_s) - 1)
    measured = np.isfinite(stream.values)
    same = (drawn.t_s[rows] == stream.t_s)[:, None] & ((drawn.values[rows] == stream.values) | ~measured)
    if not same.all() or (isinstance(stream, Velocity) and stream.frame != "enu"):
        return None
    variance, at = np.diagonal(drawn.reported[rows], axis1=1, axis2=2), np.searchsorted(t_s, stream.t_s)
    white[at] = np.where(measured, (1 - share) * variance, np.inf)
    lasting[at] = np.where(measured, np.sqrt(share * variance), 0.0)
    return NoiseRows(white, lasting, time_s)
