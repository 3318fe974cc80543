"""The growth of the error state over a step: Phi and Q."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.rotation import skew
from jerkbench.inertial.state import BA, BG, MA, MG, PHI, STATES, P, V, has_deformation


class SensorNoise(NamedTuple):
    """Power densities of the process noise, the same for each axis.

    Attributes:
        angle: q_g, square of the angle random walk [rad2/s].
        velocity: q_a, square of the velocity random walk [m2/s3].
        gyro_bias: drive of the gyro bias [rad2/s3].
        accel_bias: drive of the accelerometer bias [m2/s5].
    """

    angle: float
    velocity: float
    gyro_bias: float
    accel_bias: float


def transition(
    dt_s: FloatArray,
    dcm: FloatArray,
    force_enu_mps2: FloatArray,
    states: int = STATES,
    sensed: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return Phi (k, n, n) of k steps, with C in the middle of each and the mean specific force a = C f.

    Of dp' = dv, dv' = -[a] phi - C db_a, phi' = -C db_g, db' = 0, with a and C as constants::

        dp+  = dp + dt dv - dt^2/2 [a] phi + dt^3/6 [a] C db_g - dt^2/2 C db_a
        dv+  = dv - dt [a] phi + dt^2/2 [a] C db_g - dt C db_a
        phi+ = phi - dt C db_g

    Coriolis and the turning of phi with the Earth (1e-4 a second) are left out: they are far below the noise.

    Args:
        dt_s: (k,) lengths.
        dcm: (k, 3, 3) C.
        force_enu_mps2: (k, 3) a.
        states: n, as in `jerkbench.inertial.state.error_states`; what is not named above is constant.
        sensed: f and w (k, 3) in the body, for the deformations only: dM y acts as a bias, so column j of dM_g as db_g
            times w_j, and column j of dM_a as db_a times f_j.
    """
    dt, a = dt_s[:, None, None], skew(force_enu_mps2)
    aC = a @ dcm
    Phi = np.zeros((len(dt_s), states, states))
    Phi[:, range(states), range(states)] = 1.0
    Phi[:, range(3), range(3, 6)] = dt_s[:, None]
    Phi[:, V, PHI], Phi[:, V, BG], Phi[:, V, BA] = -dt * a, (dt**2 / 2.0) * aC, -dt * dcm
    Phi[:, P, PHI], Phi[:, P, BG], Phi[:, P, BA] = (-(dt**2) / 2.0) * a, (dt**3 / 6.0) * aC, (-(dt**2) / 2.0) * dcm
    Phi[:, PHI, BG] = -dt * dcm
    if sensed is not None and has_deformation(states):
        Phi[:, :9, MG], Phi[:, :9, MA] = by_column(Phi[:, :9, BG], sensed[1]), by_column(Phi[:, :9, BA], sensed[0])
    return Phi


def by_column(block: FloatArray, seen: FloatArray) -> FloatArray:
    """Return (..., m, 9) what a deformation does, column by column of dM, where a bias does ``block`` (..., m, 3)."""
    return np.asarray((block[..., :, None, :] * seen[..., None, :, None]).reshape(*block.shape[:-1], 9))


def step_noise(noise: SensorNoise, dt_s: float, states: int = STATES) -> FloatArray:
    """Return Q (n, n) of a step; states after the fifteenth are constant."""
    Q = np.zeros((states, states))
    Q[:STATES, :STATES] = process_noise(noise, dt_s)
    return Q


def process_noise(noise: SensorNoise, dt_s: float) -> FloatArray:
    """Return Q (15, 15) of a step; that of two halves adds up to that of the whole.

    White accelerometer noise reaches position and velocity as [[dt^3/3, dt^2/2], [dt^2/2, dt]] q_a, the gyro's phi as
    dt q_g; each bias walks. What gyro noise and walking biases do to velocity within one step is left out.
    """
    q = np.zeros((5, 5))
    q[0, 0], q[1, 1] = noise.velocity * dt_s**3 / 3.0, noise.velocity * dt_s
    q[0, 1] = q[1, 0] = noise.velocity * dt_s**2 / 2.0
    q[2, 2], q[3, 3], q[4, 4] = noise.angle * dt_s, noise.gyro_bias * dt_s, noise.accel_bias * dt_s
    return np.asarray(np.kron(q, np.eye(3)), dtype=np.float64)


def propagated(covariance: FloatArray, Phi: FloatArray, Q: FloatArray) -> FloatArray:
    """Return Phi P Phi' + Q."""
    return np.asarray(Phi.dot(covariance).dot(Phi.T) + Q)
