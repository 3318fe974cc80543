"""Strapdown mechanisation: one step of the nominal state from one mean specific force and one mean rate."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.earth import Earth, gravity_enu
from jerkbench.inertial.rotation import cross, rotation_exp
from jerkbench.inertial.state import NavigationState


def mechanise(
    state: NavigationState, accel_mps2: FloatArray, gyro_radps: FloatArray, dt_s: float, earth: Earth
) -> tuple[NavigationState, FloatArray, FloatArray]:
    """Carry ``state`` over dt and return it with C_mean and the mean specific force in ENU, C_mean f.

    With w = y_G - b_g, f = y_A - b_a, the Earth's rate w_e and gravity g(p)::

        C+ = Exp(-w_e dt) C Exp(w dt)
        C_mean = (C + C+)/2
        v+ = v + (C_mean f + g(p) - 2 w_e x v) dt
        p+ = p + (v + v+)/2 dt

    Args:
        state: at the begin of the step.
        accel_mps2: (3,) y_A, mean over the step, body.
        gyro_radps: (3,) y_G, mean over the step, body.
        dt_s: length of the step.
        earth: gravity and the Earth's rotation.
    """
    p, v, C, bg, ba, scale = state
    turned = C @ rotation_exp((gyro_radps - bg) * dt_s)
    accel = gravity_enu(p, earth.per_radius)
    if earth.rotates:
        turned = rotation_exp(-earth.rate_radps * dt_s) @ turned
        accel -= 2.0 * cross(earth.rate_radps, v)
    mean = 0.5 * (C + turned)
    force = mean @ (accel_mps2 - ba)
    v_end = v + (force + accel) * dt_s
    p_end = p + (0.5 * dt_s) * (v + v_end)
    return NavigationState(p_end, v_end, np.asarray(turned), bg, ba, scale), mean, np.asarray(force)
