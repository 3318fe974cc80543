"""Strapdown mechanisation: the nominal state over some samples of the IMU."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.earth import Earth, gravity_enu
from jerkbench.inertial.rotation import cross, rotation_exp
from jerkbench.inertial.state import NavigationState


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
        _, _, _, gyro_bias, accel_bias, deformation, scale = start
        moved = self.position_m[k], self.velocity_mps[k], self.dcm[k]
        return NavigationState(*moved, gyro_bias, accel_bias, deformation, scale)


def calibrated(state: NavigationState, accel_mps2: FloatArray, gyro_radps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return specific force f and rate w (k, 3) without what is known of the sensors' errors.

    Of a sensor that shows y = (I + M) true + b: true = (I - M)(y - b), M to the first order.
    """
    force, rate = accel_mps2 - state.accel_bias_mps2, gyro_radps - state.gyro_bias_radps
    if state.deformation is None:
        return force, rate
    return force - force @ state.deformation.accel.T, rate - rate @ state.deformation.gyro.T


def advance(
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
