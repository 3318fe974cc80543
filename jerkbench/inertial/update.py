"""The measurements and what they do to the error state: h(x) and H, the update, the correction and what it leaves."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.state import (
    BA,
    BG,
    PHI,
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
    """Position and velocity (6,) in ENU of a point of the body, and H (6, n).

    With the lever arm l from the IMU and w = ``rate_radps``, the rate less its bias::

        h = [p + C l; v + C (w x l)]
        dh = [dp - [C l] phi; dv - [C (w x l)] phi + C [l] db_g]
    """
    H = np.zeros((6, state.layout.size))
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
    """Velocity (3,) of a point of the body, in the body frame, and H (3, n).

    h = C' v + w x l;  dh = C' dv + C' [v] phi + [l] db_g, with l and w as in `point_in_enu`.
    """
    H = np.zeros((3, state.layout.size))
    turn = state.dcm.T
    H[:, V], H[:, PHI], H[:, BG] = turn, turn @ skew(state.velocity_mps), skew(lever_arm_m)
    return turn @ state.velocity_mps + cross(rate_radps, lever_arm_m), H


def wheel_speed(
    state: NavigationState, rate_radps: FloatArray, lever_arm_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What a wheel shows of the velocity (3,) of a point of the body, and H (3, n).

    With u as in `velocity_in_body`: h = [(1 + k) u_x, u_y, u_z]; dh_x = (1 + k) du_x + u_x dk.
    """
    h, H = velocity_in_body(state, rate_radps, lever_arm_m)
    shown = 1.0 + (state.wheel_scale or 0.0)
    H[0] *= shown
    H[0, state.layout.blocks["wheel_scale"]] = h[0]
    h[0] *= shown
    return h, H


def heading(state: NavigationState) -> tuple[float, FloatArray]:
    """Yaw [rad] from east towards north, and H (1, n)."""
    yaw_rad, slope = yaw_of(state.dcm)
    H = np.zeros((1, state.layout.size))
    H[0, PHI] = slope
    return yaw_rad, H


def yaw_of(dcm: FloatArray) -> tuple[float, FloatArray]:
    """Yaw [rad] of an attitude from east towards north, and its slope (3,) in phi.

    With c the first column of C: h = atan2(c_n, c_e); dh = phi_u - c_u (c_e phi_e + c_n phi_n)/(c_e^2 + c_n^2).
    """
    e, n, u = dcm[:, 0].tolist()
    level = e * e + n * n
    return math.atan2(n, e), np.array([-u * e / level, -u * n / level, 1.0])


# The measurement update of the error state.

UP_MPS2 = np.array([0.0, 0.0, GRAVITY_MPS2])
"""a, the force that holds the body up, in ENU."""


def carried_over(covariance: FloatArray, G: FloatArray) -> FloatArray:
    """Return G P G', symmetrised: the covariance of an error that has other numbers after a correction."""
    carried = G @ covariance @ G.T
    return np.asarray(0.5 * (carried + carried.T))


def reset(before: NavigationState, after: NavigationState, turn_rad: FloatArray) -> FloatArray:
    """Return G (n, n), from an error of ``before`` that the correction has left, to the same one as ``after`` has it.

    The same error has other numbers there. With a the force that holds the body up::

        phi+ = (I + [turn]/2) phi;  db_a+ = C+' C db_a + C+' ((phi+ - phi) x a)

    so that the error of that force in ENU, phi x a - C db_a, stays what it is: levelling has made it known well, while
    tilt and bias are not. That a correction changes the force itself is left out.
    """
    G = np.eye(before.layout.size)
    half = 0.5 * skew(turn_rad)
    G[PHI, PHI] += half
    G[BA, BA] = after.dcm.T @ before.dcm
    G[BA, PHI] = -after.dcm.T @ skew(UP_MPS2) @ half
    return G


def correction(
    covariance: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the estimated error dx (n,), and the covariance after the update.

    S = H P H' + R;  K = P H' S^-1;  dx = K y;  P = (I - K H) P (I - K H)' + K R K', symmetrised. The prior dx is 0:
    every estimated error goes into the nominal state at once.
    """
    PHt = covariance.dot(H.T)
    S = H.dot(PHt) + R
    solved = np.linalg.solve(S, np.column_stack([PHt.T, innovation]))
    K, y = solved[:, :-1].T, solved[:, -1]
    rest = np.eye(len(covariance)) - K.dot(H)
    posterior = rest.dot(covariance).dot(rest.T) + K.dot(R).dot(K.T)
    return PHt.dot(y), 0.5 * (posterior + posterior.T)


# The update of an invariant error: the correction on the group SE_2(3), and the covariance of what is left.
#
# The error is eta = X Xh^-1 = Exp(xi), truth over estimate, of X = [[C, v, p], [0, 1, 0], [0, 0, 1]]; xi = [phi, rho,
# pi] is the additive error dx of `jerkbench.inertial.state` in other numbers, to the first order::
#
# T: phi = phi; rho = dv + [vh] phi; pi = dp + [ph] phi
#
# so that both have the same gain. What follows a correction differs: it goes in by the exponential of the group, and
# the covariance of xi, not that of dx, stays as it is. Biases, and what else is known of the sensors, are additive.


def corrected_on_group(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` with the estimated error dx (n,) put into it: Exp(T dx) Xh.

    With the left Jacobian J of phi, for which J [phi] = Exp(phi) - I::

        C+ = Exp(phi) Ch;  v+ = Exp(phi) vh + J rho = vh + J dv;  p+ = Exp(phi) ph + J pi = ph + J dp

    so that it does not matter where the origin lies.
    """
    J = left_jacobian(dx[PHI])
    moved = state.position_m + J @ dx[P], state.velocity_mps + J @ dx[V]
    return added(state, dx)._replace(position_m=moved[0], velocity_mps=moved[1])


def reset_on_group(before: NavigationState, after: NavigationState) -> FloatArray:
    """Return G (n, n) = T(after)^-1 T(before), from an additive error of ``before`` to the same xi as ``after`` has it.

    dp+ = dp - [p+ - p] phi;  dv+ = dv - [v+ - v] phi.
    """
    G = np.eye(before.layout.size)
    G[P, PHI] = -skew(after.position_m - before.position_m)
    G[V, PHI] = -skew(after.velocity_mps - before.velocity_mps)
    return G
