"""Gravity compensation: specific force of the body -> acceleration in ENU."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import GRAVITY_MPS2

COMPENSATIONS = ("midpoint", "endpoint")


def compensate_gravity(dcm: FloatArray, accel_mps2: FloatArray, compensation: str) -> FloatArray:
    """Return u (n, 3), the acceleration in ENU [m/s2].

    u_k = mean(Omega_{k-1}, Omega_k) y_A + (0, 0, -g) with ``midpoint`` (a sample is the mean over the interval
    between the two; the first one has Omega_0 alone), Omega_k y_A + (0, 0, -g) with ``endpoint``.

    Args:
        dcm: (n, 3, 3) Omega, body -> ENU, at the end of each sample.
        accel_mps2: (n, 3) y_A, specific force, body.
        compensation: one of `COMPENSATIONS`.
    """
    turn = dcm
    if compensation == "midpoint":
        turn = dcm.copy()
        turn[1:] = 0.5 * (dcm[:-1] + dcm[1:])
    rotated: FloatArray = np.einsum("kij,kj->ki", turn, accel_mps2)
    return np.asarray(rotated - np.array([0.0, 0.0, GRAVITY_MPS2]))
