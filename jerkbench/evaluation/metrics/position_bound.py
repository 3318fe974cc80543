"""The posterior Cramer-Rao bound of the position error, by Riccati's recursion with noisy inputs."""

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
"""Initial sigmas of position [m] and velocity [m/s]. They are large, because the initial state is unknown."""


class NoiseRows(NamedTuple):
    """The noise of a measured position or velocity in m updates.

    Attributes:
        white: (m, 3) variance of the white noise on each axis, infinite if the axis was not measured.
        lasting: (m, 3) standard deviation of the Gauss-Markov noise on each axis, 0 without this noise.
        time_s: correlation time of the Gauss-Markov noise [s].
    """

    white: FloatArray
    lasting: FloatArray
    time_s: float


class Motion(NamedTuple):
    """Model of one axis with four states: position, velocity, and the Gauss-Markov noises of their measurements.

    The states of the noises are normalised by their standard deviations. The input is the acceleration.

    Attributes:
        dt_s: interval between inputs [s].
        accel_sigma_mps2: standard deviation of the white noise of an input [m/s2].
        times_s: correlation times of the Gauss-Markov noises of position and velocity [s].
    """

    dt_s: float
    accel_sigma_mps2: float
    times_s: tuple[float, float]

    def over(self, steps: int) -> tuple[FloatArray, FloatArray]:
        """Return the transition matrix A (4, 4) and the noise covariance Q (4, 4) over ``steps`` inputs."""
        t, A, Q = steps * self.dt_s, np.eye(4), np.zeros((4, 4))
        decay = np.exp(-t / np.array(self.times_s))
        A[0, 1] = t
        A[[2, 3], [2, 3]] = decay
        power = self.accel_sigma_mps2**2 * self.dt_s
        Q[0, 0] = self.grown(np.array(steps))
        Q[0, 1] = Q[1, 0] = power * t**2 / 2
        Q[1, 1] = power * t
        Q[[2, 3], [2, 3]] = 1 - decay**2
        return A, Q

    def grown(self, steps: IntArray) -> FloatArray:
        """Return the variance of the position [m2] that the noise of the number ``steps`` of inputs causes.

        The formula contains the closed form of the sum of (j + 1/2)^2 over the inputs.
        """
        squares = steps**3 / 3 - steps / 12
        return np.asarray(self.accel_sigma_mps2**2 * self.dt_s**4 * squares)


def position_variances(
    motion: Motion, updates: IntArray, position: NoiseRows, velocity: NoiseRows, steps: int
) -> FloatArray:
    """Return the variances of the position on each axis [m2], shape (steps + 1, 3): at the start and after each input.

    If an update follows an input, the variance is the variance after the update. Between updates, the covariance is
    propagated by P = A P A' + Q. An update with the position has h = [1, 0, l, 0], and the following update with the
    velocity has h = [0, 1, 0, l]::

        P = P - P h' h P/(h P h' + r)

    Here r is the variance of the white noise, and l is the standard deviation of the Gauss-Markov noise. The measured
    values are not needed, because the system is linear.

    Args:
        motion: linear model of each axis.
        updates: (m,) number of inputs before each update, in increasing order.
        position: noise of the position in each update.
        velocity: noise of the velocity in each update.
        steps: number of inputs.

    Source: Tichavsky, Muravchik and Nehorai, "Posterior Cramer-Rao bounds for discrete-time nonlinear filtering", IEEE
    Transactions on Signal Processing 46 (1998), doi:10.1109/78.668800. For a linear system, the bound is given by
    Riccati's recursion.
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
    """Return P after the inputs ``begin`` to ``end``, and store the position variances after each input."""
    steps = np.arange(end - begin + 1)
    t_s = (steps * motion.dt_s)[:, None]
    ways = P[:, 0, 0] + 2 * t_s * P[:, 0, 1] + t_s**2 * P[:, 1, 1]
    variances[begin : end + 1] = ways + motion.grown(steps)[:, None]
    A, Q = motion.over(end - begin)
    return np.asarray(A @ P @ A.T + Q)


def _updated(P: FloatArray, state: int, white: FloatArray, lasting: FloatArray) -> FloatArray:
    """Return P (3, 4, 4) of the axes after a scalar measurement of the position (``state`` 0) or the velocity (1)."""
    gathered = P[:, :, state] + lasting[:, None] * P[:, :, state + 2]
    S = gathered[:, state] + lasting * gathered[:, state + 2] + white
    return np.asarray(P - gathered[:, :, None] * gathered[:, None, :] / S[:, None, None])


# The posterior Cramer-Rao bound of the position.

NEAR_STEPS = 1e-6
"""Maximum distance of a stamp from a simultaneous IMU sample, in IMU intervals per IMU sample of the recording."""


@register("metric", "position_bound")
@dataclass(frozen=True)
class PositionBound:
    """Posterior Cramer-Rao bound of the position RMSE, from the true noises. No filter is better on average.

    The distributions of the sensor errors of a simulation are known. Each axis is then the following linear system::

        p' = p + dt v + dt^2/2 (u - w),   v' = v + dt (u - w),   w ~ N(0, sigma_a^2) in each sample of the IMU
        z_p = p + sqrt(1 - s) n + sqrt(s) b,   same for z_v,   b' = exp(-dt/T) b + sqrt(1 - exp(-2 dt/T)) n'

    The noise of position and velocity is modelled as in the data set `field`, and is white for s = 0. The posterior
    covariance P of this system, computed by Riccati's recursion over the stamps of the recording, is a lower bound of
    the mean square error. The metric is computed over the N counted rows i::

        position_bound_m = sqrt(1/N sum tr P_pos,i),   mean square of position_rmse_m over seeds >= position_bound_m^2

    The bound does not depend on the estimate, so it is the same for all methods of a scenario. Position and velocity
    are unknown at the start. Attitude, latency and lever arm are assumed to be known, which makes the bound lower. The
    bound is valid for causal estimators without a model of the motion. The RMSE of a smoother, or of an estimator that
    models the motion of the vehicle, may be below the bound. The RMSE of a single run may be below the bound by chance.

    The bound is NaN if the true noises are unknown, or if the system is not linear and Gaussian. The bound is therefore
    NaN for real recordings, IMU grades, false forces (ruts, impacts), clipped samples, and disturbances that change the
    measurements of a sensor. Outages and missing fixes are taken into account. The metric is computed only on request:
    ``metrics=[position_rmse,position_bound]``.

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
    """Return the bound of the position variances [m2], shape (n + 1, 3): at the start and after each of n IMU samples.

    Return None if the true noises are unknown, or if the system is not linear and Gaussian.
    """
    true_noise, position, velocity = recording.drawn, recording.position, recording.velocity
    if true_noise is None or recording.imu is not true_noise.imu:
        return None
    streams = [stream for stream in (position, velocity) if stream is not None]
    t_s = np.unique(np.concatenate([stream.t_s for stream in streams] or [np.empty(0)]))
    steps = _steps(t_s, true_noise.imu.t_s)
    of_position = _noise(true_noise.position, true_noise.position_share, true_noise.position_time_s, position, t_s)
    of_velocity = _noise(true_noise.velocity, true_noise.velocity_share, true_noise.velocity_time_s, velocity, t_s)
    if steps is None or of_position is None or of_velocity is None:
        return None
    motion = Motion(
        _interval_s(true_noise.imu.t_s),
        true_noise.accel_sigma_mps2,
        (true_noise.position_time_s, true_noise.velocity_time_s),
    )
    return position_variances(motion, steps, of_position, of_velocity, len(true_noise.imu.t_s))


def _interval_s(t_s: FloatArray) -> float:
    return float(t_s[-1] - t_s[0]) / (len(t_s) - 1)


def _steps(t_s: FloatArray, imu_s: FloatArray) -> IntArray | None:
    """Return the number of IMU samples up to each time, or None if a time is not the stamp of a sample."""
    places = (t_s - imu_s[0]) / _interval_s(imu_s) + 1
    steps = np.round(places).astype(np.int64)
    at_samples = np.abs(places - steps) < NEAR_STEPS * len(imu_s)
    return steps if at_samples.all() and (steps >= 0).all() and (steps <= len(imu_s)).all() else None


def _noise(
    drawn: Position | Velocity, share: float, time_s: float, stream: Position | Velocity | None, t_s: FloatArray
) -> NoiseRows | None:
    """Return the noise of the measurements ``stream`` at the times ``t_s`` (m,) of the updates.

    Return None if the measurements contain values that differ from the simulated values ``drawn``.
    """
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
