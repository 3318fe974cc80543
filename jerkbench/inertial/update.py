"""Measurement functions h(x) and their Jacobians H, the measurement update, and the covariance after a correction."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.state import (
    BA,
    BG,
    PHI,
    WHEEL_SCALE,
    NavigationState,
    P,
    V,
    added,
    cross,
    left_jacobian,
    skew,
)
from jerkbench.recording import GRAVITY_MPS2


def point_in_enu(
    state: NavigationState, rate_radps: FloatArray, lever_arm_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (6,) of a point of the body in ENU, and the Jacobian H (6, n).

    In the following equations, l is the lever arm from the IMU to the point, and w = ``rate_radps`` is the
    bias-corrected angular rate::

        h = [p + C l; v + C (w x l)]
        dh = [dp - [C l] phi; dv - [C (w x l)] phi + C [l] db_g]
    """
    H = np.zeros((6, state.size))
    H[:, :6] = np.eye(6)
    if not lever_arm_m.any():
        return np.concatenate([state.position_m, state.velocity_mps]), H
    C = state.dcm
    arm, swing = C @ lever_arm_m, C @ cross(rate_radps, lever_arm_m)
    H[P, PHI], H[V, PHI] = -skew(arm), -skew(swing)
    H[V, BG] = C @ skew(lever_arm_m)
    return np.concatenate([state.position_m + arm, state.velocity_mps + swing]), H


def velocity_in_body(
    state: NavigationState, rate_radps: FloatArray, lever_arm_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the velocity (3,) of a point of the body in the body frame, and the Jacobian H (3, n).

    In the following equations, l is the lever arm and w is the angular rate, as in `point_in_enu`::

        h = C' v + w x l;  dh = C' dv + C' [v] phi + [l] db_g
    """
    H = np.zeros((3, state.size))
    to_body = state.dcm.T
    H[:, V], H[:, PHI], H[:, BG] = to_body, to_body @ skew(state.velocity_mps), skew(lever_arm_m)
    return to_body @ state.velocity_mps + cross(rate_radps, lever_arm_m), H


def wheel_speed(
    state: NavigationState, rate_radps: FloatArray, lever_arm_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the velocity (3,) of a point of the body as a wheel measures it, and the Jacobian H (3, n).

    In the following equations, u is the velocity in the body frame (`velocity_in_body`), and k is the scale error of
    the wheel::

        h = [(1 + k) u_x, u_y, u_z];  dh_x = (1 + k) du_x + u_x dk
    """
    h, H = velocity_in_body(state, rate_radps, lever_arm_m)
    scale = 1.0 + (state.wheel_scale or 0.0)
    H[0] *= scale
    if state.wheel_scale is not None:
        H[0, WHEEL_SCALE] = h[0]
    h[0] *= scale
    return h, H


def heading(state: NavigationState) -> tuple[float, FloatArray]:
    """Return the yaw [rad], measured from east towards north, and the Jacobian H (1, n).

    The yaw is computed from the first column c of the rotation matrix C::

        h = atan2(c_n, c_e);  dh = phi_u - c_u (c_e phi_e + c_n phi_n)/(c_e^2 + c_n^2)
    """
    e, n, u = state.dcm[:, 0].tolist()
    level = e * e + n * n
    H = np.zeros((1, state.size))
    H[0, PHI] = -u * e / level, -u * n / level, 1.0
    return math.atan2(n, e), H


# The measurement update of the error state.

FORCE_AT_REST_MPS2 = np.array([0.0, 0.0, GRAVITY_MPS2])
"""a, the specific force at rest in ENU."""


def transformed(covariance: FloatArray, G: FloatArray) -> FloatArray:
    """Return the symmetrised covariance G P G' of the error G dx, where ``covariance`` is the covariance P of dx."""
    product = G @ covariance @ G.T
    return np.asarray(0.5 * (product + product.T))


def reset(before: NavigationState, after: NavigationState, turn_rad: FloatArray) -> FloatArray:
    """Return the reset matrix G (n, n) after a correction of the attitude by the rotation vector ``turn_rad`` (3,).

    The matrix G transforms an error about the nominal state ``before`` into the error of the same true state about the
    nominal state ``after``. In the following equations, a is the specific force at rest::

        phi+ = (I + [turn]/2) phi;  db_a+ = C+' C db_a + C+' ((phi+ - phi) x a)

    With this matrix G, the error phi x a - C db_a of the specific force in ENU does not change. Levelling determines
    this specific force accurately, but cannot separate tilt and accelerometer bias. G neglects the change of the
    specific force that the correction causes.
    """
    G = np.eye(before.size)
    half = 0.5 * skew(turn_rad)
    G[PHI, PHI] += half
    G[BA, BA] = after.dcm.T @ before.dcm
    G[BA, PHI] = -after.dcm.T @ skew(FORCE_AT_REST_MPS2) @ half
    return G


def correction(
    covariance: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the estimated error dx (n,) and the posterior covariance.

    The prior error has the mean zero, because every correction is applied to the nominal state immediately. The
    covariance is symmetrised after the update::

        S = H P H' + R;  K = P H' S^-1;  dx = K y;  P = (I - K H) P (I - K H)' + K R K'
    """
    PHt = covariance.dot(H.T)
    S = H.dot(PHt) + R
    solved = np.linalg.solve(S, np.column_stack([PHt.T, innovation]))
    K, y = solved[:, :-1].T, solved[:, -1]
    rest = np.eye(len(covariance)) - K.dot(H)
    posterior = rest.dot(covariance).dot(rest.T) + K.dot(R).dot(K.T)
    return PHt.dot(y), 0.5 * (posterior + posterior.T)


# The update of the invariant filter: the correction on the group SE_2(3), and the reset of the covariance.
#
# The error on the group is eta = X Xh^-1 = Exp(xi), with the true state X, the estimate Xh and xi = [phi, rho, pi].
# X is the matrix [[C, v, p], [0, 1, 0], [0, 0, 1]].
# To first order, xi = T dx with the additive error dx: phi = phi, rho = dv + [vh] phi, pi = dp + [ph] phi.
# The Kalman gain is the same for the errors xi and dx, but the correction uses the exponential map of the group.
# The correction does not change the covariance of xi, whereas it changes the covariance of dx.
# The errors of biases and wheel scale are additive.


def corrected_on_group(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return the nominal state Xh = ``state``, corrected by the estimated error dx (n,): Exp(T dx) Xh.

    In the following equations, J is the left Jacobian of phi, which satisfies J [phi] = Exp(phi) - I::

        C+ = Exp(phi) Ch;  v+ = Exp(phi) vh + J rho = vh + J dv;  p+ = Exp(phi) ph + J pi = ph + J dp

    The correction does not depend on the origin of the coordinates.
    """
    J = left_jacobian(dx[PHI])
    return added(state, dx)._replace(
        position_m=state.position_m + J @ dx[P], velocity_mps=state.velocity_mps + J @ dx[V]
    )


def reset_on_group(before: NavigationState, after: NavigationState) -> FloatArray:
    """Return the reset matrix G (n, n) = T(after)^-1 T(before), which preserves the error xi on the group.

    The matrix G transforms the errors of position and velocity, and preserves all other errors::

        dp+ = dp - [p+ - p] phi;  dv+ = dv - [v+ - v] phi
    """
    G = np.eye(before.size)
    G[P, PHI] = -skew(after.position_m - before.position_m)
    G[V, PHI] = -skew(after.velocity_mps - before.velocity_mps)
    return G
