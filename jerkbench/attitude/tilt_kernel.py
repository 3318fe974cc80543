"""The loop of the tilt filter, in the form that numba compiles.

One sample: x- = Phi x+ and P- = Phi P+ Phi' + Q;  e = y_A - c_a a_prev - g x-;  C0 = g^2 P- + sigma_A^2 I;  with the
variance Sigma_acc of an external acceleration, M = sigma_A^2 I + Sigma_acc;  K = g P- (g^2 P- + M)^-1;  x+ = x- + K e;
P+ = (I - gK) P- (I - gK)' + K M K'.
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolVector, FloatArray, FloatMatrix, FloatVector
from jerkbench.recording import GRAVITY_MPS2

ADAPTATIONS = ("none", "mtf", "scalar", "lee")
"""The ways to find Sigma_acc."""

NONE, MTF, SCALAR, LEE = 0, 1, 2, 3


class Settings(NamedTuple):
    """`jerkbench.attitude.tilt_filter.TiltParameters` in numbers.

    Attributes:
        sigma_gyro_radps: noise of one gyro sample.
        sigma_accel_mps2: noise of one accelerometer sample.
        external_memory: c_a.
        normalise: whether x is brought back to length 1.
        exact: whether Phi is the rotation itself.
        adapt: NONE, MTF, SCALAR or LEE.
    """

    sigma_gyro_radps: float
    sigma_accel_mps2: float
    external_memory: float
    normalise: bool
    exact: bool
    adapt: int


class Room(NamedTuple):
    """What passes from one sample to the next, and room for one step.

    Attributes:
        x: (3,) Omega^T e3.
        P: (3, 3) its covariance.
        a_prev: (3,) external acceleration [m/s2].
        squares: (mu, 3) ring of the latest e_i^2.
        Phi: (3, 3).
        spare: (3, 3).
        K: (3, 3).
        e: (3,) innovation.
        C0: (3,) diagonal.
        noise: (3,) diagonal of M.
    """

    x: FloatVector
    P: FloatMatrix
    a_prev: FloatVector
    squares: FloatMatrix
    Phi: FloatMatrix
    spare: FloatMatrix
    K: FloatMatrix
    e: FloatVector
    C0: FloatVector
    noise: FloatVector


def run_samples(
    room: Room,
    gyro: FloatMatrix,
    accel: FloatMatrix,
    dt: FloatVector,
    settings: Settings,
    x: FloatMatrix,
    triggered: BoolVector,
) -> None:
    """Fill x (n, 3) and triggered (n,)."""
    for k in range(len(dt)):
        _predict(room, gyro[k, 0] * dt[k], gyro[k, 1] * dt[k], gyro[k, 2] * dt[k], dt[k], settings)
        energy, threshold = 0.0, 0.0
        for i in range(3):
            predicted = settings.external_memory * room.a_prev[i]
            room.e[i] = accel[k, i] - predicted - GRAVITY_MPS2 * room.x[i]
            room.C0[i] = GRAVITY_MPS2**2 * room.P[i, i] + settings.sigma_accel_mps2**2
            energy += room.e[i] * room.e[i]
            threshold += room.C0[i]
            room.squares[k % len(room.squares), i] = room.e[i] * room.e[i]
        triggered[k] = energy >= threshold
        _fill_noise(room, k + 1, energy - threshold, triggered[k], settings)
        _correct(room)
        _finish(room, accel, k, settings, x)


def _predict(room: Room, a: float, b: float, c: float, dt: float, settings: Settings) -> None:
    """Turn x and P by (a, b, c) rad; Q = (dt sigma_G)^2 (x'x I - x x')."""
    _fill_transition(room.Phi, a, b, c, settings.exact)
    Phi, x, P, FP = room.Phi, room.x, room.P, room.spare
    for i in range(3):
        for j in range(3):
            FP[i, j] = Phi[i, 0] * P[0, j] + Phi[i, 1] * P[1, j] + Phi[i, 2] * P[2, j]
    scale = (dt * settings.sigma_gyro_radps) ** 2
    length = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    for i in range(3):
        for j in range(3):
            noise = (length if i == j else 0.0) - x[i] * x[j]
            P[i, j] = FP[i, 0] * Phi[j, 0] + FP[i, 1] * Phi[j, 1] + FP[i, 2] * Phi[j, 2] + scale * noise
    for i in range(3):
        room.C0[i] = Phi[i, 0] * x[0] + Phi[i, 1] * x[1] + Phi[i, 2] * x[2]
    for i in range(3):
        x[i] = room.C0[i]


def _fill_transition(Phi: FloatArray, a: float, b: float, c: float, exact: bool) -> None:
    """Phi = I - skew, or exp(-skew) by Rodrigues with skew^2 = t t' - t't I."""
    first, second = 1.0, 0.0
    square = a * a + b * b + c * c
    if exact and square > 0.0:
        angle = math.sqrt(square)
        first = math.sin(angle) / angle
        second = 0.5 * (math.sin(angle / 2) / (angle / 2)) ** 2
    elif exact:
        second = 0.5
    t = (a, b, c)
    for i in range(3):
        for j in range(3):
            Phi[i, j] = second * (t[i] * t[j] - (square if i == j else 0.0)) + (1.0 if i == j else 0.0)
    for i, j, turn in ((1, 2, a), (2, 0, b), (0, 1, c)):
        Phi[i, j] += first * turn
        Phi[j, i] -= first * turn


def _fill_noise(room: Room, samples: int, excess: float, triggered: bool, settings: Settings) -> None:
    """The diagonal of M = sigma_A^2 I + Sigma_acc.

    none: 0;  mtf: max(0, w_i - C0_ii) if triggered, w_i the mean of the last mu e_i^2;  scalar: (e'e - tr C0)/3 if
    triggered;  lee: |c_a a_prev|^2/3, always (Lee et al. 2012).
    """
    recent = min(samples, len(room.squares))
    expected = 0.0
    for i in range(3):
        expected += (settings.external_memory * room.a_prev[i]) ** 2
    for i in range(3):
        extra = 0.0
        if settings.adapt == MTF and triggered:
            total = 0.0
            for j in range(recent):
                total += room.squares[j, i]
            extra = max(total / recent - room.C0[i], 0.0)
        elif settings.adapt == SCALAR and triggered:
            extra = excess / 3
        elif settings.adapt == LEE:
            extra = expected / 3
        room.noise[i] = settings.sigma_accel_mps2**2 + extra


def _correct(room: Room) -> None:
    """K = g P (g^2 P + M)^-1;  x = x + K e."""
    g, P, K, A, S = GRAVITY_MPS2, room.P, room.K, room.spare, room.Phi
    for i in range(3):
        for j in range(3):
            S[i, j] = g * g * P[i, j] + (room.noise[i] if i == j else 0.0)
    _fill_gain(S, P, K)
    for i in range(3):
        room.x[i] += K[i, 0] * room.e[0] + K[i, 1] * room.e[1] + K[i, 2] * room.e[2]
        for j in range(3):
            A[i, j] = (1.0 if i == j else 0.0) - g * K[i, j]
    _update_covariance(room)


def _update_covariance(room: Room) -> None:
    """P = A P A' + K M K', symmetrised, with A = I - g K in the spare room."""
    P, K, A, AP = room.P, room.K, room.spare, room.Phi
    for i in range(3):
        for j in range(3):
            AP[i, j] = A[i, 0] * P[0, j] + A[i, 1] * P[1, j] + A[i, 2] * P[2, j]
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += AP[i, k] * A[j, k] + K[i, k] * room.noise[k] * K[j, k]
            P[i, j] = total
    for i in range(3):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


def _fill_gain(S: FloatArray, P: FloatArray, K: FloatArray) -> None:
    """K = g P S^-1, with the cofactors of the symmetric S."""
    a, b, c, d, e, f = S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2]
    A, B, C, D, E, F = d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b
    scale = GRAVITY_MPS2 / (a * A + b * B + c * C)
    for i in range(3):
        p, q, r = P[i, 0] * scale, P[i, 1] * scale, P[i, 2] * scale
        K[i, 0], K[i, 1], K[i, 2] = p * A + q * B + r * C, p * B + q * D + r * E, p * C + q * E + r * F


def _finish(room: Room, accel: FloatArray, k: int, settings: Settings, x: FloatArray) -> None:
    """Normalise, keep the external acceleration, store x."""
    length = 1.0
    if settings.normalise:
        length = math.sqrt(room.x[0] ** 2 + room.x[1] ** 2 + room.x[2] ** 2)
    for i in range(3):
        room.x[i] /= length
        room.a_prev[i] = accel[k, i] - GRAVITY_MPS2 * room.x[i]
        x[k, i] = room.x[i]


def make_room(x: FloatArray, variance: float, window: int) -> Room:
    """Return the room before the first sample: P = ``variance`` I, no external acceleration."""
    matrices = (np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)))
    vectors = (np.zeros(3), np.zeros(3), np.zeros(3))
    start = np.array(x, dtype=np.float64), variance * np.eye(3), np.zeros(3)
    return Room(*start, np.zeros((window, 3)), *matrices, *vectors)
