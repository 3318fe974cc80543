"""Rotations, the nominal state and its strapdown mechanisation, and the propagation of the error state."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import GRAVITY_MPS2, Origin

MIN_ANGLE_RAD = 1e-12
"""Smaller angles are replaced by this angle [rad] to avoid a division by zero. For this angle, sin(a)/a rounds to 1."""

_I3 = np.eye(3)


def skew(a: FloatArray) -> FloatArray:
    """Return the cross-product matrices [a] (..., 3, 3) of vectors a (..., 3), such that [a] b = a x b."""
    S = np.zeros((*a.shape, 3))
    S[..., 2, 1], S[..., 0, 2], S[..., 1, 0] = a[..., 0], a[..., 1], a[..., 2]
    S[..., 1, 2], S[..., 2, 0], S[..., 0, 1] = -a[..., 0], -a[..., 1], -a[..., 2]
    return S


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross product a x b of two vectors (3,)."""
    a1, a2, a3 = a.tolist()
    b1, b2, b3 = b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def rotation_exp(phi: FloatArray) -> FloatArray:
    """Return the rotation matrices Exp(phi) (..., 3, 3) of rotation vectors phi (..., 3) [rad].

    With a = |phi|, the matrix Exp(phi) is I + sin(a)/a [phi] + (1 - cos a)/a^2 [phi]^2. The factor of [phi]^2 is
    computed as (sin(a/2)/(a/2))^2/2, which is accurate for small angles a.
    """
    a = np.maximum(np.sqrt((phi * phi).sum(axis=-1)), MIN_ANGLE_RAD)[..., None, None]
    half = 0.5 * a
    S = skew(phi)
    return np.asarray(_I3 + (np.sin(a) / a) * S + (0.5 * (np.sin(half) / half) ** 2) * (S @ S))


def left_jacobian(phi: FloatArray) -> FloatArray:
    """Return the left Jacobian J (3, 3) of a rotation vector phi (3,) [rad], the mean of Exp(s phi) for s from 0 to 1.

    With a = |phi|, the left Jacobian is I + (1 - cos a)/a^2 [phi] + (a - sin a)/a^3 [phi]^2. For small angles a, the
    factor (a - sin a)/a^3 is inaccurate, but its product with [phi]^2 is negligible.
    """
    a = max(math.sqrt(float(phi @ phi)), MIN_ANGLE_RAD)
    half = 0.5 * a
    S = skew(phi)
    return np.asarray(_I3 + (0.5 * (math.sin(half) / half) ** 2) * S + ((a - math.sin(a)) / a**3) * (S @ S))


def orthonormal(C: FloatArray) -> FloatArray:
    """Return a matrix C that is nearly a rotation, made orthonormal by one Newton step: 1.5 C - 0.5 C C' C."""
    return np.asarray(1.5 * C - 0.5 * C @ (C.T @ C))


# The nominal state, and the order of the components of the error state.

STATES = 15
POSITION, VELOCITY, ATTITUDE, GYRO, ACCEL = range(0, STATES, 3)
"""Indices of the first of three components of the errors: position, velocity, attitude, gyro and accelerometer bias."""

WHEEL_SCALE = STATES
"""Index of the error of the wheel scale, the only optional state."""

P, V, PHI, BG, BA = (slice(first, first + 3) for first in (POSITION, VELOCITY, ATTITUDE, GYRO, ACCEL))


class NavigationState(NamedTuple):
    """The nominal state of the inertial navigation.

    Attributes:
        position_m: (3,) p, position of the IMU in ENU [m].
        velocity_mps: (3,) v, velocity of the IMU in ENU [m/s].
        dcm: (3, 3) C, rotation matrix from the body frame (forward, left, up) to ENU.
        gyro_bias_radps: (3,) b_g, gyro bias in the body frame [rad/s].
        accel_bias_mps2: (3,) b_a, accelerometer bias in the body frame [m/s2].
        wheel_scale: scale error k of a wheel that measures 1 + k times the speed, or None if k is not estimated.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    dcm: FloatArray
    gyro_bias_radps: FloatArray
    accel_bias_mps2: FloatArray
    wheel_scale: float | None = None

    @property
    def size(self) -> int:
        """Number of components of the error state."""
        return STATES if self.wheel_scale is None else STATES + 1


def added(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` plus the error dx (n,), where phi rotates the attitude: C+ = Exp(phi) C."""
    return NavigationState(
        state.position_m + dx[P],
        state.velocity_mps + dx[V],
        orthonormal(rotation_exp(dx[PHI]) @ state.dcm),
        state.gyro_bias_radps + dx[BG],
        state.accel_bias_mps2 + dx[BA],
        None if state.wheel_scale is None else state.wheel_scale + dx[WHEEL_SCALE],
    )


def corrected(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return the nominal state ``state``, corrected by the estimated error dx (n,).

    The errors of tilt and accelerometer bias are correlated, because levelling cannot separate them. Let a be the
    specific force at rest in ENU, and C+ = Exp(phi) C. The accelerometer bias is corrected by a vector db such that the
    specific force changes exactly as the linear filter estimates, without a second-order term::

        C+ (C' a - db) = a + phi x a - C db_a

    A correction of the bias by db_a would leave an error of g phi^2/2 in the vertical acceleration (4 mm/s2 for 28
    mrad). The covariance P does not include this error of the vertical acceleration.
    """
    moved = added(state, dx)
    up = GRAVITY_MPS2 * state.dcm[2]  # C' a
    east, north, _ = dx[PHI].tolist()
    force = GRAVITY_MPS2 * np.array([north, -east, 1.0]) - state.dcm @ dx[BA]
    return moved._replace(accel_bias_mps2=state.accel_bias_mps2 + up - moved.dcm.T @ force)


def error_between(after: NavigationState, before: NavigationState) -> FloatArray:
    """Return the error dx (n,) by which `corrected` transforms ``before`` into ``after``.

    The following equations define the attitude error phi and the error db_a of the accelerometer bias::

        phi = Log(C+ C'),    f = C' a - (b+ - b),    db_a = C' (a + phi x a - C+ f)
    """
    from scipy.spatial.transform import Rotation

    dcm, up = before.dcm, GRAVITY_MPS2 * before.dcm[2]
    phi = Rotation.from_matrix(after.dcm @ dcm.T).as_rotvec()
    measured = up - (after.accel_bias_mps2 - before.accel_bias_mps2)
    force = GRAVITY_MPS2 * np.array([phi[1], -phi[0], 1.0])
    return np.concatenate(
        [
            after.position_m - before.position_m,
            after.velocity_mps - before.velocity_mps,
            phi,
            after.gyro_bias_radps - before.gyro_bias_radps,
            dcm.T @ (force - after.dcm @ measured),
            [] if after.wheel_scale is None or before.wheel_scale is None else [after.wheel_scale - before.wheel_scale],
        ]
    )


# Gravity and the Earth's rotation.


RATE_RADPS = 7.292115e-5
"""Angular rate of the Earth (WGS-84) [rad/s]."""

RADIUS_M = 6_371_000.0
"""Mean radius of the Earth [m]. Real radii differ by 0.3 %, which changes the tilt of gravity over 2 km by 1e-6 rad."""


class Earth(NamedTuple):
    """Parameters of the navigation equations for the rotation and curvature of the Earth.

    Attributes:
        rotates: whether the navigation equations include the Earth's rotation.
        rate_radps: (3,) angular rate of the Earth in ENU at the origin [rad/s].
        per_radius: 1/R with the radius R of the Earth, or 0 for constant gravity [1/m].
    """

    rotates: bool
    rate_radps: FloatArray
    per_radius: float


FLAT = Earth(rotates=False, rate_radps=np.zeros(3), per_radius=0.0)
"""A tangent plane that does not rotate, with constant gravity."""


def earth_at(origin: Origin | None, *, rotates: bool, curved: bool) -> Earth:
    """Return the Earth's rotation and curvature at ``origin``. Without an origin, the rotation is not included."""
    if not rotates or origin is None:
        return FLAT._replace(per_radius=1.0 / RADIUS_M if curved else 0.0)
    latitude = np.deg2rad(origin.latitude_deg)
    rate = RATE_RADPS * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    return Earth(rotates=True, rate_radps=rate, per_radius=1.0 / RADIUS_M if curved else 0.0)


def gravity_enu(position_m: FloatArray, per_radius: float) -> FloatArray:
    """Return gravity (3,) in ENU [m/s2], -g [e/R, n/R, 1 - 2 u/R], which points to the centre of the Earth."""
    e, n, u = position_m.tolist()
    g = GRAVITY_MPS2
    return np.array([-g * e * per_radius, -g * n * per_radius, -g * (1.0 - 2.0 * u * per_radius)])


# Strapdown mechanisation, which propagates the nominal state over several samples of the IMU.


class Propagation(NamedTuple):
    """The nominal state at the end of each of k time steps.

    Attributes:
        position_m: (k, 3) position in ENU at the end of each step [m].
        velocity_mps: (k, 3) velocity in ENU at the end of each step [m/s].
        dcm: (k, 3, 3) rotation matrix from the body frame to ENU at the end of each step.
        mean_dcm: (k, 3, 3) C_mean, the mean of the attitudes at the start and at the end of each step.
        force_enu_mps2: (k, 3) mean specific force C_mean f of each step in ENU [m/s2].
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    dcm: FloatArray
    mean_dcm: FloatArray
    force_enu_mps2: FloatArray

    def state(self, start: NavigationState, k: int) -> NavigationState:
        """Return the nominal state at the end of step ``k``, with the biases and the wheel scale of ``start``."""
        return NavigationState(self.position_m[k], self.velocity_mps[k], self.dcm[k], *start[3:])


def calibrated(state: NavigationState, accel_mps2: FloatArray, gyro_radps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return specific force f and angular rate w (k, 3), from which the estimated biases are subtracted."""
    return accel_mps2 - state.accel_bias_mps2, gyro_radps - state.gyro_bias_radps


def advance_navigation(
    state: NavigationState, force_mps2: FloatArray, rate_radps: FloatArray, dt_s: FloatArray, earth: Earth
) -> Propagation:
    """Propagate the nominal state ``state`` over k time steps.

    In the following equations of a step, w_e is the angular rate of the Earth and g(p) is gravity::

        C+ = Exp(-w_e dt) C Exp(w dt)
        C_mean = (C + C+)/2
        v+ = v + (C_mean f + g(p) - 2 w_e x v) dt
        p+ = p + (v + v+)/2 dt

    Args:
        state: nominal state at the start of the first step.
        force_mps2: (k, 3) mean specific force f of each step in the body frame [m/s2].
        rate_radps: (k, 3) mean angular rate w of each step in the body frame [rad/s].
        dt_s: (k,) lengths of the steps [s].
        earth: parameters of gravity and of the Earth's rotation.
    """
    dcm = _rotated(state.dcm, rate_radps, dt_s, earth)
    mean = 0.5 * (dcm[:-1] + dcm[1:])
    force = (mean @ force_mps2[:, :, None])[:, :, 0]
    return Propagation(*_integrated(state, force, dt_s, earth), dcm[1:], mean, force)


def _rotated(dcm: FloatArray, rate_radps: FloatArray, dt_s: FloatArray, earth: Earth) -> FloatArray:
    """Return the attitude C (k + 1, 3, 3) at the start of the first step and at the end of each step."""
    rotated = np.empty((len(dt_s) + 1, 3, 3))
    rotated[0] = dcm
    for k, turn in enumerate(rotation_exp(rate_radps * dt_s[:, None])):
        np.dot(rotated[k], turn, out=rotated[k + 1])
    if earth.rotates:  # rotations about the Earth's axis commute, so they can be applied at the end
        rotated[1:] = rotation_exp(-earth.rate_radps * np.cumsum(dt_s)[:, None]) @ rotated[1:]
    return rotated


def _integrated(
    state: NavigationState, force: FloatArray, dt_s: FloatArray, earth: Earth
) -> tuple[FloatArray, FloatArray]:
    """Integrate position and velocity, and return their values (k, 3) at the end of each step."""
    p, v = np.empty((2, len(dt_s), 3))
    position, velocity = state.position_m, state.velocity_mps
    for k, dt in enumerate(dt_s.tolist()):
        accel = force[k] + gravity_enu(position, earth.per_radius) - 2.0 * cross(earth.rate_radps, velocity)
        v[k] = velocity + accel * dt
        p[k] = position + (velocity + v[k]) * (0.5 * dt)
        position, velocity = p[k], v[k]
    return p, v


# Propagation of the error state over a time step, with the matrices Phi and Q.


class SensorNoise(NamedTuple):
    """Power spectral densities of the process noise of the inertial filters, which are equal on all axes.

    Attributes:
        angle: q_g, square of the angle random walk [rad2/s].
        velocity: q_a, square of the velocity random walk [m2/s3].
        gyro_bias: power spectral density of the random walk of the gyro bias [rad2/s3].
        accel_bias: power spectral density of the random walk of the accelerometer bias [m2/s5].
    """

    angle: float
    velocity: float
    gyro_bias: float
    accel_bias: float


def transition(dt_s: FloatArray, dcm: FloatArray, force_enu_mps2: FloatArray, states: int = STATES) -> FloatArray:
    """Return the transition matrices Phi (k, n, n) of the error state for k time steps.

    The matrix Phi is the solution of dp' = dv, dv' = -[a] phi - C db_a, phi' = -C db_g, db' = 0 with constant a and C::

        dp+  = dp + dt dv - dt^2/2 [a] phi + dt^3/6 [a] C db_g - dt^2/2 C db_a
        dv+  = dv - dt [a] phi + dt^2/2 [a] C db_g - dt C db_a
        phi+ = phi - dt C db_g

    Phi neglects the Coriolis acceleration and the rotation of phi with the Earth (1e-4 per second), because both are
    far below the noise.

    Args:
        dt_s: (k,) lengths of the steps [s].
        dcm: (k, 3, 3) attitude C in the middle of each step.
        force_enu_mps2: (k, 3) mean specific force a = C f of each step in ENU [m/s2].
        states: n, the number of error states. All states after the fifteenth state are constant.
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


@lru_cache(maxsize=256)  # most steps of a run have equal lengths
def process_noise(noise: SensorNoise, dt_s: float, states: int = STATES) -> FloatArray:
    """Return the process noise Q (n, n) of a time step. All states after the fifteenth state are constant.

    White accelerometer noise adds [[dt^3/3, dt^2/2], [dt^2/2, dt]] q_a to the covariance of position and velocity, and
    white gyro noise adds dt q_g to the covariance of phi. Each sensor bias is a random walk. Q neglects the effects of
    gyro noise and bias walks on the velocity within one step. The process noise of two half steps is equivalent to the
    process noise of the full step.
    """
    q = np.zeros((5, 5))
    q[0, 0], q[1, 1] = noise.velocity * dt_s**3 / 3.0, noise.velocity * dt_s
    q[0, 1] = q[1, 0] = noise.velocity * dt_s**2 / 2.0
    q[2, 2], q[3, 3], q[4, 4] = noise.angle * dt_s, noise.gyro_bias * dt_s, noise.accel_bias * dt_s
    Q = np.zeros((states, states))
    Q[:STATES, :STATES] = np.kron(q, np.eye(3))
    return Q
