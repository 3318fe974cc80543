"""The nominal state, and where its errors stand in the error state."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.rotation import orthonormal, rotation_exp

STATES = 15
P, V, PHI, BG, BA = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)


class NavigationState(NamedTuple):
    """Nominal state of the inertial navigation.

    Attributes:
        position_m: (3,) p of the IMU, ENU.
        velocity_mps: (3,) v of the IMU, ENU.
        dcm: (3, 3) C, body FLU -> ENU.
        gyro_bias_radps: (3,) b_g, body.
        accel_bias_mps2: (3,) b_a, body.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    dcm: FloatArray
    gyro_bias_radps: FloatArray
    accel_bias_mps2: FloatArray


def corrected(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` with the estimated error dx (15,) put into it."""
    return NavigationState(
        state.position_m + dx[P],
        state.velocity_mps + dx[V],
        orthonormal(rotation_exp(dx[PHI]) @ state.dcm),
        state.gyro_bias_radps + dx[BG],
        state.accel_bias_mps2 + dx[BA],
    )


def is_finite(state: NavigationState) -> bool:
    """Whether every number of the state is finite."""
    return all(bool(np.isfinite(part).all()) for part in state)
