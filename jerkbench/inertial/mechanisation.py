"""Strapdown mechanisation: one step of the nominal state from one mean specific force and one mean rate."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.earth import Earth, gravity_enu
from jerkbench.inertial.rotation import cross, rotation_exp
from jerkbench.inertial.state import NavigationState

_HALF = np.full((3, 3), 0.5)


def calibrated(state: NavigationState, accel_mps2: FloatArray, gyro_radps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return specific force f and rate w (3,) without what is known of the sensors' errors.

    Of a sensor that shows y = (I + M) true + b: true = (I - M)(y - b), M to the first order.
    """
    force, rate = accel_mps2 - state.accel_bias_mps2, gyro_radps - state.gyro_bias_radps
    if state.deformation is None:
        return force, rate
    return force - state.deformation.accel @ force, rate - state.deformation.gyro @ rate


def advance(
    state: NavigationState, force_mps2: FloatArray, rate_radps: FloatArray, dt_s: float, earth: Earth
) -> tuple[NavigationState, FloatArray, FloatArray]:
    """Carry ``state`` over dt and return it with C_mean and the mean specific force in ENU, C_mean f.

    With the Earth's rate w_e and gravity g(p)::

        C+ = Exp(-w_e dt) C Exp(w dt)
        C_mean = (C + C+)/2
        v+ = v + (C_mean f + g(p) - 2 w_e x v) dt
        p+ = p + (v + v+)/2 dt

    Args:
        state: at the begin of the step.
        force_mps2: (3,) f, mean over the step, body.
        rate_radps: (3,) w, mean over the step, body.
        dt_s: length of the step.
        earth: gravity and the Earth's rotation.
    """
    p, v, C, gyro_bias, accel_bias, deformation, scale = state
    turned = C.dot(rotation_exp(rate_radps * dt_s))  # dot: for matrices as small as these in a third of the time of @
    accel = gravity_enu(p, earth.per_radius)
    if earth.rotates:
        turned = rotation_exp(-earth.rate_radps * dt_s) @ turned
        accel = accel - 2.0 * cross(earth.rate_radps, v)
    mean = (C + turned) * _HALF
    force = mean.dot(force_mps2)
    v_end = v + (force + accel) * dt_s
    p_end = p + (v + v_end) * (0.5 * dt_s)
    return NavigationState(p_end, v_end, turned, gyro_bias, accel_bias, deformation, scale), mean, force
