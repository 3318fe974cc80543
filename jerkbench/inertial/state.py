"""Rotations, the nominal state of the inertial navigation, and the order of the components of the error state."""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import GRAVITY_MPS2

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
