"""Adaptive accelerometer update and rotation matrices of the Kalman filters `tilt` and `mekf`.

The loops of the filters, which numba compiles, call the functions of this module. In both filters, the accelerometer
depends only on the first three states, so the measurement matrix H of the accelerometer is (3, 3).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, FloatMatrix, FloatVector
from jerkbench.recording import GRAVITY_MPS2

ADAPTATIONS = ("none", "mtf", "scalar", "lee")
"""Methods that estimate Sigma, the variance of an external acceleration."""

MTF, SCALAR, LEE = 1, 2, 3


class GravityUpdate(NamedTuple):
    """State and buffers of the accelerometer update.

    Attributes:
        a_prev: (3,) estimated external acceleration at the previous sample [m/s2].
        squares: (mu, 3) ring buffer of the squared innovations of the latest mu samples.
        H: (3, 3) measurement matrix of the first three states.
        e: (3,) innovation of the accelerometer [m/s2].
        C0: (3,) diagonal of H P H' + N, where N is the noise variance of the accelerometer.
        M: (3,) diagonal of N + Sigma, where Sigma is the variance of the external acceleration.
        dx: (n,) correction of the n states.
        K: (n,) buffer for one column of P H', which is the Kalman gain times the innovation variance.
        memory: c_a, fraction of the external acceleration that persists until the next sample.
        adapt: index of the adaptation method in `ADAPTATIONS`.
    """

    a_prev: FloatVector
    squares: FloatMatrix
    H: FloatMatrix
    e: FloatVector
    C0: FloatVector
    M: FloatVector
    dx: FloatVector
    K: FloatVector
    memory: float
    adapt: int


def gravity_update(states: int, window: int, memory: float, adapt: str) -> GravityUpdate:
    """Return the buffers of the accelerometer update for a filter with ``states`` states; the initial H is g I."""
    (a_prev, e, C0, M), (dx, K) = np.zeros((4, 3)), np.zeros((2, states))
    H, which = GRAVITY_MPS2 * np.eye(3), ADAPTATIONS.index(adapt)
    return GravityUpdate(a_prev, np.zeros((window, 3)), H, e, C0, M, dx, K, float(memory), which)


def see_gravity(u: GravityUpdate, P: FloatArray, x: FloatArray, y: FloatArray, k: int, noise: float) -> float:
    """Compute the innovation e = y_A - c_a a_prev - g x and C0 = diag(H P H') + N, and return e'e - tr C0.

    The adaptation is triggered if the returned value is at least 0.
    """
    excess = 0.0
    for i in range(3):
        u.e[i] = y[i] - u.memory * u.a_prev[i] - GRAVITY_MPS2 * x[i]
        u.C0[i] = noise
        for r in range(3):
            u.C0[i] += u.H[i, r] * (P[r, 0] * u.H[i, 0] + P[r, 1] * u.H[i, 1] + P[r, 2] * u.H[i, 2])
        u.squares[k % len(u.squares), i] = u.e[i] ** 2
        excess += u.e[i] ** 2 - u.C0[i]
    return excess


def fill_noise(u: GravityUpdate, k: int, excess: float, noise: float, factor: float) -> None:
    """Compute the measurement covariance M = N + factor diag(Sigma) of the adaptation method.

    The method determines the variance Sigma_i of the external acceleration, where w_i is the mean of the latest e_i^2::

        mtf:    Sigma_i = max(0, w_i - C0_ii) if e'e >= tr C0, else 0
        scalar: Sigma_i = (e'e - tr C0)/3 if e'e >= tr C0, else 0
        lee:    Sigma_i = |c_a a_prev|^2/3
    """
    recent = min(k + 1, len(u.squares))
    expected = u.memory**2 * (u.a_prev[0] ** 2 + u.a_prev[1] ** 2 + u.a_prev[2] ** 2)
    for i in range(3):
        sigma = 0.0
        if u.adapt == MTF and excess >= 0.0:
            for r in range(recent):
                sigma += u.squares[r, i]
            sigma = max(sigma / recent - u.C0[i], 0.0)
        elif u.adapt == SCALAR and excess >= 0.0:
            sigma = excess / 3.0
        elif u.adapt == LEE:
            sigma = expected / 3.0
        u.M[i] = noise + factor * sigma


def updating(states: int) -> Callable[[GravityUpdate, FloatArray], None]:
    """Return the measurement update of a filter with ``states`` states: dx = K e and P = (I - K H) P."""

    def update(u: GravityUpdate, P: FloatArray) -> None:
        """Process the rows of H sequentially. No matrix inversion is necessary, because M is diagonal."""
        u.dx[:] = 0.0
        for i in range(3):
            S, residual = u.M[i], u.e[i]
            for r in range(states):
                u.K[r] = P[r, 0] * u.H[i, 0] + P[r, 1] * u.H[i, 1] + P[r, 2] * u.H[i, 2]
            for r in range(3):
                S += u.H[i, r] * u.K[r]
                residual -= u.H[i, r] * u.dx[r]
            for r in range(states):
                gain = u.K[r] / S
                u.dx[r] += gain * residual
                for s in range(r + 1):
                    P[r, s] -= gain * u.K[s]
                    P[s, r] = P[r, s]

    return update


def fill_rotation(C: FloatArray, t: FloatArray, scale: float, exact: bool) -> None:
    """Write the rotation Exp(scale t) to ``C`` by Rodrigues' formula, or I + skew(scale t) if ``exact`` is false.

    Rodrigues' formula contains the square of the skew matrix, skew(t)^2 = t t' - t't I.
    """
    a, b, c = scale * t[0], scale * t[1], scale * t[2]
    square = a * a + b * b + c * c
    first, second = 1.0, 0.5 if exact else 0.0
    if exact and square > 0.0:
        angle = math.sqrt(square)
        first, second = math.sin(angle) / angle, 0.5 * (math.sin(angle / 2) / (angle / 2)) ** 2
    turn = (a, b, c)
    for i in range(3):
        for j in range(3):
            C[i, j] = second * (turn[i] * turn[j] - (square if i == j else 0.0)) + (1.0 if i == j else 0.0)
    for i, j, m in ((1, 2, 0), (2, 0, 1), (0, 1, 2)):
        C[i, j] -= first * turn[m]
        C[j, i] += first * turn[m]
