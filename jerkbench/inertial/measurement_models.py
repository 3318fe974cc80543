"""The measurement models: h(x), and H with h(x + dx) = h(x) + H dx."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.error_model import by_column
from jerkbench.inertial.rotation import cross, skew
from jerkbench.inertial.state import BG, MG, PHI, STATES, NavigationState, P, V, has_deformation, has_wheel


def point_in_enu(
    state: NavigationState, rate_radps: FloatArray, lever_arm_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (6,) in ENU of a point of the body, and H (6, 15).

    With the lever arm l from the IMU and w = ``rate_radps``, the rate less its bias::

        h = [p + C l; v + C (w x l)]
        dh = [dp - [C l] phi; dv - [C (w x l)] phi + C [l] db_g]
    """
    H = np.zeros((6, STATES))
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
    """Velocity (3,) of a point of the body, in the body frame, and H (3, 15).

    h = C' v + w x l;  dh = C' dv + C' [v] phi + [l] db_g, with l and w as in `point_in_enu`.
    """
    H = np.zeros((3, STATES))
    turn = state.dcm.T
    H[:, V], H[:, PHI], H[:, BG] = turn, turn @ skew(state.velocity_mps), skew(lever_arm_m)
    return turn @ state.velocity_mps + cross(rate_radps, lever_arm_m), H


def wheel_speed(
    state: NavigationState, rate_radps: FloatArray, lever_arm_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What a wheel shows of the velocity (3,) of a point of the body, and H (3, 16), by k last.

    With u as in `velocity_in_body`: h = [(1 + k) u_x, u_y, u_z]; dh_x = (1 + k) du_x + u_x dk.
    """
    h, of_velocity = velocity_in_body(state, rate_radps, lever_arm_m)
    H = np.hstack([of_velocity, [[h[0]], [0.0], [0.0]]])
    H[0, :STATES] *= 1.0 + state.wheel_scale
    h[0] *= 1.0 + state.wheel_scale
    return h, H


def widened(H: FloatArray, states: int, rate_radps: FloatArray) -> FloatArray:
    """Return H (m, n) of rows (m, 15), or (m, 16) with the wheel's scale last.

    A deformation of the gyro is a wrong rate, as its bias is; one of the accelerometer is in no measurement.
    """
    if H.shape[1] == states:
        return H
    wide = np.zeros((len(H), states))
    wide[:, :STATES] = H[:, :STATES]
    if has_deformation(states):
        wide[:, MG] = by_column(H[:, BG], rate_radps)
    if has_wheel(states) and H.shape[1] > STATES:
        wide[:, -1] = H[:, -1]
    return wide


def heading(state: NavigationState) -> tuple[float, FloatArray]:
    """Yaw [rad] from east towards north, and H (1, 15)."""
    yaw_rad, slope = yaw_of(state.dcm)
    H = np.zeros((1, STATES))
    H[0, PHI] = slope
    return yaw_rad, H


def yaw_of(dcm: FloatArray) -> tuple[float, FloatArray]:
    """Yaw [rad] of an attitude from east towards north, and its slope (3,) in phi.

    With c the first column of C: h = atan2(c_n, c_e); dh = phi_u - c_u (c_e phi_e + c_n phi_n)/(c_e^2 + c_n^2).
    """
    e, n, u = dcm[:, 0].tolist()
    level = e * e + n * n
    return math.atan2(n, e), np.array([-u * e / level, -u * n / level, 1.0])
