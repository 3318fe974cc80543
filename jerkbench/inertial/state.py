"""The nominal state, and where its errors stand in the error state."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.rotation import orthonormal, rotation_exp

STATES = 15
WHEEL = 15
"""Where the error of the wheel's scale stands, when there is one; the error state then has 16."""
P, V, PHI, BG, BA = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)


class NavigationState(NamedTuple):
    """Nominal state of the inertial navigation.

    Attributes:
        position_m: (3,) p of the IMU, ENU.
        velocity_mps: (3,) v of the IMU, ENU.
        dcm: (3, 3) C, body FLU -> ENU.
        gyro_bias_radps: (3,) b_g, body.
        accel_bias_mps2: (3,) b_a, body.
        wheel_scale: k; a wheel shows 1 + k times the speed.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    dcm: FloatArray
    gyro_bias_radps: FloatArray
    accel_bias_mps2: FloatArray
    wheel_scale: float = 0.0


def corrected(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` with the estimated error dx (15,), or (16,) with the wheel's scale, put into it."""
    return NavigationState(
        state.position_m + dx[P],
        state.velocity_mps + dx[V],
        orthonormal(rotation_exp(dx[PHI]) @ state.dcm),
        state.gyro_bias_radps + dx[BG],
        state.accel_bias_mps2 + dx[BA],
        state.wheel_scale + float(dx[WHEEL]) if len(dx) > WHEEL else state.wheel_scale,
    )


def is_finite(state: NavigationState) -> bool:
    """Whether every number of the state is finite."""
    return all(bool(np.isfinite(part).all()) for part in state)
