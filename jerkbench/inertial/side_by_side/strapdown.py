"""Strapdown mechanisation of a step; `jerkbench.inertial.mechanisation` has the equations."""

import math

from jerkbench.compilation.views import RunView, View, lane, room
from jerkbench.recording import GRAVITY_MPS2

# Rotations, one of each run.

SMALL = 0.01
"""Square of an angle below which a series to the tenth power gives sine and cosine to the last digit."""


def fill_turn(run: RunView, x: float, y: float, z: float) -> None:
    """Make ``turn`` = Exp of the rotation vector (x, y, z), as in `jerkbench.inertial.rotation.rotation_exp`."""
    square = x * x + y * y + z * z
    run.square_of_angle = square
    run.sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    run.cosine = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    for k in range(run.width):
        if lane(run, k).square_of_angle >= SMALL:
            _fill_large(lane(run, k))
    s, c, turn = run.sine, run.cosine, run.turn
    turn[0, 0], turn[1, 1], turn[2, 2] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    turn[0, 1], turn[1, 0] = c * x * y - s * z, c * x * y + s * z
    turn[0, 2], turn[2, 0] = c * x * z + s * y, c * x * z - s * y
    turn[1, 2], turn[2, 1] = c * y * z - s * x, c * y * z + s * x


def _fill_large(alone: RunView) -> None:
    a = math.sqrt(alone.square_of_angle)
    half = math.sin(0.5 * a) / (0.5 * a)
    alone.sine = math.sin(a) / a
    alone.cosine = 0.5 * half * half


def multiply(left: View, right: View, into: View) -> None:
    """Put the product of two matrices into a third."""
    for i in range(3):
        for j in range(3):
            into[i, j] = left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]


def multiply_transposed(left: View, right: View, into: View) -> None:
    """Put the product of the transposed left and the right matrix into a third."""
    for i in range(3):
        for j in range(3):
            into[i, j] = left[0, i] * right[0, j] + left[1, i] * right[1, j] + left[2, i] * right[2, j]


def mechanise(run: RunView, accel: View, gyro: View, dt: float) -> None:
    """Carry the nominal states over a step of ``dt``, with one sample of the IMU."""
    for i in range(3):
        run.force[i] = accel[i] - run.accel_bias[i]
        run.rate[i] = gyro[i] - run.gyro_bias[i]
    fill_turn(run, dt * run.rate[0], dt * run.rate[1], dt * run.rate[2])
    multiply(run.C, run.turn, run.next)
    for i in range(3):  # C in the middle of the step
        for j in range(3):
            run.lever[i, j] = 0.5 * (run.C[i, j] + run.next[i, j])
            run.C[i, j] = run.next[i, j]
    for i in range(3):
        run.twist[i] = run.lever[i, 0] * run.force[0] + run.lever[i, 1] * run.force[1] + run.lever[i, 2] * run.force[2]
    for i in range(3):
        before = run.x[3 + i]
        pull = GRAVITY_MPS2 if i == 2 else 0.0
        run.x[3 + i] = before + (run.twist[i] - pull) * dt
        run.x[i] += (before + run.x[3 + i]) * (0.5 * dt)
    for i in range(3):
        run.twist[i] *= 0.0 - dt
        for j in range(3):
            run.lever[i, j] *= 0.0 - dt


# P = Phi P Phi' + Q by the blocks of Phi that are not zero (`jerkbench.inertial.error_model`).

MOVED = 9
"""Error states that move: all but the biases."""


def propagate(run: RunView, noise: View, dt: float) -> None:
    """Carry the covariances over a step of ``dt``, first their columns, then their rows."""
    c, half = room(run, "s"), room(run, "9 9")
    for t in range(MOVED):
        for k in range(run.s):
            c[k] = run.P[k, t]
        _move(c, run, dt)
        for k in range(MOVED):
            half[k, t] = c[k]
    _move_biases(run, dt)
    _move_rows(run, half, dt)
    _add_noise(run, noise, dt)


def _move_biases(run: RunView, dt: float) -> None:
    """The columns of the biases, whose rows stay as they are."""
    c = room(run, "s")
    for t in range(MOVED, run.s):
        for k in range(run.s):
            c[k] = run.P[k, t]
        _move(c, run, dt)
        for k in range(MOVED):
            run.P[k, t] = c[k]


def _move_rows(run: RunView, half: View, dt: float) -> None:
    """The rows of what moves, of which ``half`` has the columns that move too."""
    c = room(run, "s")
    for r in range(MOVED):
        for k in range(MOVED):
            c[k] = half[r, k]
        for k in range(MOVED, run.s):
            c[k] = run.P[r, k]
        _move(c, run, dt)
        for k in range(r, MOVED):
            run.P[r, k] = c[k]


def _move(c: View, run: RunView, dt: float) -> None:
    """Apply Phi to an error of the state: position, velocity, attitude, gyro and accelerometer bias."""
    L, (x, y, z) = run.lever, (run.twist[0], run.twist[1], run.twist[2])
    da = L[0, 0] * c[9] + L[0, 1] * c[10] + L[0, 2] * c[11]  # turned by the gyro's bias
    db = L[1, 0] * c[9] + L[1, 1] * c[10] + L[1, 2] * c[11]
    dc = L[2, 0] * c[9] + L[2, 1] * c[10] + L[2, 2] * c[11]
    qa = y * c[8] - z * c[7] + (L[0, 0] * c[12] + L[0, 1] * c[13] + L[0, 2] * c[14])  # pushed by tilt and bias
    qb = z * c[6] - x * c[8] + (L[1, 0] * c[12] + L[1, 1] * c[13] + L[1, 2] * c[14])
    qc = x * c[7] - y * c[6] + (L[2, 0] * c[12] + L[2, 1] * c[13] + L[2, 2] * c[14])
    ra, rb, rc = y * dc - z * db, z * da - x * dc, x * db - y * da
    half, sixth = 0.5 * dt, dt / 6.0
    c[0] += dt * c[3] + half * qa + sixth * ra
    c[1] += dt * c[4] + half * qb + sixth * rb
    c[2] += dt * c[5] + half * qc + sixth * rc
    c[3] += qa + 0.5 * ra
    c[4] += qb + 0.5 * rb
    c[5] += qc + 0.5 * rc
    c[6] += da
    c[7] += db
    c[8] += dc


def _add_noise(run: RunView, noise: View, dt: float) -> None:
    """Add Q of a step of ``dt``, as in `jerkbench.inertial.error_model.process_noise`."""
    for i in range(3):
        run.P[i, i] += noise[1] * (dt * dt * dt / 3.0)
        run.P[i, 3 + i] += noise[1] * (dt * dt / 2.0)
        run.P[3 + i, 3 + i] += noise[1] * dt
        run.P[6 + i, 6 + i] += noise[0] * dt
        run.P[9 + i, 9 + i] += noise[2] * dt
        run.P[12 + i, 12 + i] += noise[3] * dt
