"""The loop of the multiplicative extended Kalman filter, in the form that numba compiles; equations: `Mekf`."""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolVector, FloatArray, FloatMatrix, FloatVector
from jerkbench.recording import GRAVITY_MPS2

ADAPTATIONS = ("none", "mtf", "lee")
"""The ways to find Sigma."""

MTF, LEE = 1, 2


class Settings(NamedTuple):
    """The parameters of `jerkbench.attitude.mekf.Mekf` in numbers.

    Attributes:
        gyro_density: N_G.
        accel_density: N_A.
        bias_density: N_b.
        window_s: T.
        external_memory: c_a.
        adapt: 0, MTF or LEE.
    """

    gyro_density: float
    accel_density: float
    bias_density: float
    window_s: float
    external_memory: float
    adapt: int


class Room(NamedTuple):
    """What passes from one sample to the next, and room for one step.

    Attributes:
        C: (3, 3) the rotation from the body to ENU.
        b: (3,) the gyro's bias.
        P: (6, 6) covariance of the errors of both.
        a_prev: (3,) external acceleration [m/s2].
        squares: (mu, 3) ring of the latest e_i^2.
        turn: (3, 3) the rotation of one step.
        top: (3, 6) upper half of F P.
        e: (3,) innovation.
        noise: (3,) diagonal of M.
        dx: (6,).
        K: (6,) one column of the gain.
    """

    C: FloatMatrix
    b: FloatVector
    P: FloatMatrix
    a_prev: FloatVector
    squares: FloatMatrix
    turn: FloatMatrix
    top: FloatMatrix
    e: FloatVector
    noise: FloatVector
    dx: FloatVector
    K: FloatVector


def make_room(C: FloatArray, tilt_variance: float, bias_sigma: float, window: int) -> Room:
    """Return the room before the first sample: the rotation C (3, 3), no bias, no external acceleration."""
    P = np.diag([tilt_variance] * 3 + [bias_sigma**2] * 3)
    state = np.array(C, dtype=np.float64), np.zeros(3), P, np.zeros(3), np.zeros((window, 3))
    matrices, vectors = (np.zeros((3, 3)), np.zeros((3, 6))), (np.zeros(3), np.zeros(3))
    return Room(*state, *matrices, *vectors, np.zeros(6), np.zeros(6))


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
    g = GRAVITY_MPS2
    for k in range(len(dt)):
        _predict(room, gyro, dt[k], k, settings)
        triggered[k] = _fill_noise(room, accel, dt[k], k, settings)
        _correct(room)
        for i in range(3):
            x[k, i] = room.C[2, i]
            room.a_prev[i] = accel[k, i] - g * x[k, i]


def _predict(room: Room, gyro: FloatMatrix, dt: float, k: int, settings: Settings) -> None:
    """Turn Omega by the gyro less its bias; P = F P F' + Q, block by block: F is zero below, and I on the right."""
    P, A, top = room.P, room.turn, room.top
    for i in range(3):
        room.dx[i] = dt * (gyro[k, i] - room.b[i])
    _turn(room)
    for i in range(3):  # top rows of F P, with Exp(-w dt) = A'
        for j in range(6):
            top[i, j] = A[0, i] * P[0, j] + A[1, i] * P[1, j] + A[2, i] * P[2, j] - dt * P[i + 3, j]
    for i in range(3):
        for j in range(3):
            P[i, j] = top[i, 0] * A[0, j] + top[i, 1] * A[1, j] + top[i, 2] * A[2, j] - dt * top[i, j + 3]
            P[i, j + 3] = P[j + 3, i] = top[i, j + 3]
        P[i, i] += dt * settings.gyro_density**2
        P[i + 3, i + 3] += dt * settings.bias_density**2


def _turn(room: Room) -> None:
    """C = C Exp(theta) with theta = dx[:3], by Rodrigues; Exp(theta) stays in ``turn``."""
    t, turn, C = room.dx, room.turn, room.C
    square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    first, second = 1.0, 0.5
    if square > 0.0:
        angle = math.sqrt(square)
        first, second = math.sin(angle) / angle, 0.5 * (math.sin(angle / 2) / (angle / 2)) ** 2
    for i in range(3):
        for j in range(3):
            turn[i, j] = second * (t[i] * t[j] - (square if i == j else 0.0)) + (1.0 if i == j else 0.0)
    for i, j, m in ((1, 2, 0), (2, 0, 1), (0, 1, 2)):
        turn[i, j] -= first * t[m]
        turn[j, i] += first * t[m]
    for i in range(3):
        c0, c1, c2 = C[i, 0], C[i, 1], C[i, 2]
        for j in range(3):
            C[i, j] = c0 * turn[0, j] + c1 * turn[1, j] + c2 * turn[2, j]


def _fill_noise(room: Room, accel: FloatMatrix, dt: float, k: int, settings: Settings) -> bool:
    """Fill e and the diagonal of M; returns whether e'e >= tr C0."""
    g, P, x = GRAVITY_MPS2, room.P, room.C[2]
    white = settings.accel_density**2 / dt
    memory = settings.external_memory if settings.adapt == LEE else 0.0
    energy, threshold, external = 0.0, 0.0, 0.0
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        room.e[i] = accel[k, i] - memory * room.a_prev[i] - g * x[i]
        # row i of H is g times row i of [x]: -x_m for theta_j, x_j for theta_m
        room.noise[i] = g * g * (x[m] ** 2 * P[j, j] - 2.0 * x[j] * x[m] * P[j, m] + x[j] ** 2 * P[m, m]) + white
        room.squares[k % len(room.squares), i] = room.e[i] ** 2
        energy += room.e[i] ** 2
        threshold += room.noise[i]
        external += (memory * room.a_prev[i]) ** 2
    correlated = max(1.0, settings.window_s / dt)
    recent = min(k + 1, len(room.squares))
    for i in range(3):
        extra = 0.0
        if settings.adapt == MTF and energy >= threshold:
            total = 0.0
            for r in range(recent):
                total += room.squares[r, i]
            extra = correlated * max(total / recent - room.noise[i], 0.0)
        elif settings.adapt == LEE:
            extra = correlated * external / 3.0
        room.noise[i] = white + extra
    return energy >= threshold


def _correct(room: Room) -> None:
    """One axis of the accelerometer after the other: dx = K e, P = (I - K H) P; then Omega and b take dx."""
    g, P, K, dx = GRAVITY_MPS2, room.P, room.K, room.dx
    x0, x1, x2 = room.C[2, 0], room.C[2, 1], room.C[2, 2]
    dx[:] = 0.0
    for i, j, m, xj, xm in ((0, 1, 2, x1, x2), (1, 2, 0, x2, x0), (2, 0, 1, x0, x1)):
        hj, hm = -g * xm, g * xj
        for r in range(6):
            K[r] = P[r, j] * hj + P[r, m] * hm
        S = hj * K[j] + hm * K[m] + room.noise[i]
        y = room.e[i] - hj * dx[j] - hm * dx[m]
        for r in range(6):
            dx[r] += K[r] * y / S
            for s in range(r + 1):
                P[r, s] -= K[r] * K[s] / S
                P[s, r] = P[r, s]
    _turn(room)
    for i in range(3):
        room.b[i] += dx[i + 3]
