"""A step of the navigation: the Earth, the nominal state over samples of the IMU, and the growth of its error."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.state import (
    BA,
    BG,
    PHI,
    STATES,
    NavigationState,
    P,
    V,
    cross,
    rotation_exp,
    skew,
)
from jerkbench.recording import GRAVITY_MPS2, Origin

RATE_RADPS = 7.292115e-5
"""The Earth's rate (WGS-84)."""

RADIUS_M = 6_371_000.0
"""Mean radius: that of the ellipsoid differs by .3 %, which turns gravity by 1e-6 rad over 2 km."""


class Earth(NamedTuple):
    """What the navigation equations know of the Earth.

    Attributes:
        rotates: whether it turns.
        rate_radps: (3,) the Earth's rate in ENU at the origin.
        per_radius: 1/R [1/m]; 0: gravity is the same everywhere.
    """

    rotates: bool
    rate_radps: FloatArray
    per_radius: float


FLAT = Earth(rotates=False, rate_radps=np.zeros(3), per_radius=0.0)
"""A plane that does not turn, with gravity straight down."""


def earth_at(origin: Origin | None, *, rotates: bool, curved: bool) -> Earth:
    """Return the Earth at ``origin``; without a known origin it does not turn."""
    if not rotates or origin is None:
        return FLAT._replace(per_radius=1.0 / RADIUS_M if curved else 0.0)
    latitude = np.deg2rad(origin.latitude_deg)
    rate = RATE_RADPS * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    return Earth(rotates=True, rate_radps=rate, per_radius=1.0 / RADIUS_M if curved else 0.0)


STRAIGHT_DOWN = np.array([0.0, 0.0, -GRAVITY_MPS2])
STRAIGHT_DOWN.flags.writeable = False


def gravity_enu(position_m: FloatArray, per_radius: float) -> FloatArray:
    """Return g(p) = -g [e/R, n/R, 1 - 2 u/R]: in the tangent plane it points to the Earth's centre."""
    if per_radius == 0.0:
        return STRAIGHT_DOWN
    e, n, u = position_m.tolist()
    g = GRAVITY_MPS2
    return np.array([-g * e * per_radius, -g * n * per_radius, -g * (1.0 - 2.0 * u * per_radius)])


# Strapdown mechanisation: the nominal state over some samples of the IMU.


class Passage(NamedTuple):
    """The nominal state over k steps.

    Attributes:
        position_m: (k, 3) at the end of each.
        velocity_mps: (k, 3) at the end of each.
        dcm: (k, 3, 3) at the end of each.
        mean_dcm: (k, 3, 3) C_mean, between begin and end.
        force_enu_mps2: (k, 3) the mean specific force, C_mean f.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    dcm: FloatArray
    mean_dcm: FloatArray
    force_enu_mps2: FloatArray

    def state(self, start: NavigationState, k: int) -> NavigationState:
        """The state at the end of step k; what is known of the sensors is that of the start."""
        return NavigationState(self.position_m[k], self.velocity_mps[k], self.dcm[k], *start[3:])


def calibrated(state: NavigationState, accel_mps2: FloatArray, gyro_radps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return specific force f and rate w (k, 3) without the biases of the sensors."""
    return accel_mps2 - state.accel_bias_mps2, gyro_radps - state.gyro_bias_radps


def advance_navigation(
    state: NavigationState, force_mps2: FloatArray, rate_radps: FloatArray, dt_s: FloatArray, earth: Earth
) -> Passage:
    """Carry ``state`` over k steps.

    With the Earth's rate w_e and gravity g(p), for each step::

        C+ = Exp(-w_e dt) C Exp(w dt)
        C_mean = (C + C+)/2
        v+ = v + (C_mean f + g(p) - 2 w_e x v) dt
        p+ = p + (v + v+)/2 dt

    Args:
        state: at the begin.
        force_mps2: (k, 3) f, mean over each step, body.
        rate_radps: (k, 3) w, mean over each step, body.
        dt_s: (k,) their lengths.
        earth: gravity and the Earth's rotation.
    """
    dcm = _turned(state.dcm, rate_radps, dt_s, earth)
    mean = 0.5 * (dcm[:-1] + dcm[1:])
    force = (mean @ force_mps2[:, :, None])[:, :, 0]
    move = _moved_flat if not earth.rotates and earth.per_radius == 0.0 else _moved
    return Passage(*move(state, force, dt_s, earth), dcm[1:], mean, force)


def _turned(dcm: FloatArray, rate_radps: FloatArray, dt_s: FloatArray, earth: Earth) -> FloatArray:
    """Return C (k + 1, 3, 3) at the begin and at the end of each step."""
    turned = np.empty((len(dt_s) + 1, 3, 3))
    turned[0] = dcm
    for k, turn in enumerate(rotation_exp(rate_radps * dt_s[:, None])):
        np.dot(turned[k], turn, out=turned[k + 1])
    if earth.rotates:  # all of the Earth's turns are about one axis, so they can wait
        turned[1:] = rotation_exp(-earth.rate_radps * np.cumsum(dt_s)[:, None]) @ turned[1:]
    return turned


def _moved_flat(
    state: NavigationState, force: FloatArray, dt_s: FloatArray, earth: Earth
) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (k, 3) where gravity is the same everywhere and nothing turns: sums."""
    gains = (force + gravity_enu(state.position_m, earth.per_radius)) * dt_s[:, None]
    v = state.velocity_mps + np.cumsum(gains, axis=0)
    return state.position_m + np.cumsum((v - 0.5 * gains) * dt_s[:, None], axis=0), v


def _moved(state: NavigationState, force: FloatArray, dt_s: FloatArray, earth: Earth) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (k, 3), step by step."""
    p, v = np.empty((2, len(dt_s), 3))
    at, moving = state.position_m, state.velocity_mps
    for k, dt in enumerate(dt_s.tolist()):
        before = moving
        accel = force[k] + gravity_enu(at, earth.per_radius) - 2.0 * cross(earth.rate_radps, before)
        moving = before + accel * dt
        at = at + (before + moving) * (0.5 * dt)
        p[k], v[k] = at, moving
    return p, v


# The growth of the error state over a step: Phi and Q.


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


def transition(dt_s: FloatArray, dcm: FloatArray, force_enu_mps2: FloatArray, states: int = STATES) -> FloatArray:
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
        states: n; what is not named above is constant.
    """
    dt, a = dt_s[:, None, None], skew(force_enu_mps2)
    aC = a @ dcm
    Phi = np.zeros((len(dt_s), states, states))
    Phi[:, range(states), range(states)] = 1.0
    Phi[:, range(3), range(3, 6)] = dt_s[:, None]
    Phi[:, V, PHI], Phi[:, V, BG], Phi[:, V, BA] = -dt * a, (dt**2 / 2.0) * aC, -dt * dcm
    Phi[:, P, PHI], Phi[:, P, BG], Phi[:, P, BA] = (-(dt**2) / 2.0) * a, (dt**3 / 6.0) * aC, (-(dt**2) / 2.0) * dcm
    Phi[:, PHI, BG] = -dt * dcm
    return Phi


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
