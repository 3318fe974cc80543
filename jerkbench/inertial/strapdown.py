"""A step of the compiled navigation: nominal state and covariance of its error, of one run or of several.

`jerkbench.inertial.mechanisation` has the equations.
"""

import math
from collections.abc import Callable

from jerkbench.compilation.views import Lanes, View, lane, room
from jerkbench.inertial.state import ACCEL, ATTITUDE, GYRO, POSITION, VELOCITY
from jerkbench.recording import GRAVITY_MPS2

# Rotations, one of each run.

SMALL = 0.01
"""Square of an angle below which a series to the tenth power gives sine and cosine to the last digit."""


def fill_turn(run: Lanes, x: float, y: float, z: float) -> None:
    """Make ``turn`` = Exp of the rotation vector (x, y, z), as in `jerkbench.inertial.state.rotation_exp`."""
    square = x * x + y * y + z * z
    run.square_of_angle = square
    run.sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    run.cosine = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    for k in range(run.width):
        if lane(run, k).square_of_angle >= SMALL:
            _fill_large(lane(run, k))
    fill_by_factors(run, x, y, z)


def _fill_large(alone: Lanes) -> None:
    a = math.sqrt(alone.square_of_angle)
    half = math.sin(0.5 * a) / (0.5 * a)
    alone.sine = math.sin(a) / a
    alone.cosine = 0.5 * half * half


def fill_by_factors(run: Lanes, x: float, y: float, z: float) -> None:
    """Make ``turn`` = I + sine [(x, y, z)] + cosine [(x, y, z)]^2."""
    s, c, turn = run.sine, run.cosine, run.turn
    turn[0, 0], turn[1, 1], turn[2, 2] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    turn[0, 1], turn[1, 0] = c * x * y - s * z, c * x * y + s * z
    turn[0, 2], turn[2, 0] = c * x * z + s * y, c * x * z - s * y
    turn[1, 2], turn[2, 1] = c * y * z - s * x, c * y * z + s * x


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


# The nominal state.


def sense(run: Lanes, accel: View, gyro: View) -> None:
    """Make specific force and rate of a sample, without the biases of the sensors."""
    for i in range(3):
        run.force[i] = accel[i] - run.accel_bias[i]
        run.rate[i] = gyro[i] - run.gyro_bias[i]


def mechanise(run: Lanes, earth: View, rotates: bool, dt: float) -> None:
    """Carry the nominal states over a step of ``dt``; ``earth`` (4,) is the Earth's rate and 1/R."""
    fill_turn(run, dt * run.rate[0], dt * run.rate[1], dt * run.rate[2])
    multiply(run.C, run.turn, run.next)
    if rotates:
        fill_turn(run, -dt * earth[0], -dt * earth[1], -dt * earth[2])
        for i in range(3):
            for j in range(3):
                run.before[i, j] = run.next[i, j]
        multiply(run.turn, run.before, run.next)
    for i in range(3):  # C in the middle of the step
        for j in range(3):
            run.lever[i, j] = 0.5 * (run.C[i, j] + run.next[i, j])
            run.C[i, j] = run.next[i, j]
    for i in range(3):
        run.twist[i] = run.lever[i, 0] * run.force[0] + run.lever[i, 1] * run.force[1] + run.lever[i, 2] * run.force[2]
    _move(run, earth, rotates, dt)
    for i in range(3):
        run.twist[i] *= 0.0 - dt
        for j in range(3):
            run.lever[i, j] *= 0.0 - dt


def _move(run: Lanes, earth: View, rotates: bool, dt: float) -> None:
    """Position and velocity; ``twist`` holds the specific force in ENU."""
    v, a, g = room(run, "3"), room(run, "3"), GRAVITY_MPS2
    for i in range(3):
        v[i] = run.x[VELOCITY + i]
    a[0] = run.twist[0] - g * run.x[0] * earth[3]
    a[1] = run.twist[1] - g * run.x[1] * earth[3]
    a[2] = run.twist[2] - g * (1.0 - 2.0 * run.x[2] * earth[3])
    if rotates:
        a[0] -= 2.0 * (earth[1] * v[2] - earth[2] * v[1])
        a[1] -= 2.0 * (earth[2] * v[0] - earth[0] * v[2])
        a[2] -= 2.0 * (earth[0] * v[1] - earth[1] * v[0])
    for i in range(3):
        run.x[VELOCITY + i] = v[i] + a[i] * dt
        run.x[i] += (v[i] + run.x[VELOCITY + i]) * (0.5 * dt)


# The covariance.


def congruence(apply: Callable[..., None], first: int, last: int) -> Callable[[Lanes, float], None]:
    """Return a kernel that makes P = T P T'.

    Args:
        apply: (c, run, dt) makes T c of a column c.
        first: of the states whose rows T changes, at most nine.
        last: the state behind them.
    """

    def transform_covariance(run: Lanes, dt: float) -> None:
        """First the columns, of which those of the changed states wait, then the rows."""
        c, half = room(run, "s"), room(run, "9 9")
        for t in range(first, last):
            _load_column(c, run, t)
            apply(c, run, dt)
            for k in range(first, last):
                half[k - first, t - first] = c[k]
        for t in range(run.s):
            if t < first or t >= last:
                _load_column(c, run, t)
                apply(c, run, dt)
                for k in range(first, last):
                    run.P[k, t] = c[k]
        for r in range(first, last):
            for k in range(run.s):
                c[k] = half[r - first, k - first] if first <= k < last else run.P[r, k]
            apply(c, run, dt)
            for k in range(r, last):
                run.P[r, k] = c[k]

    return transform_covariance


def _load_column(c: View, run: Lanes, t: int) -> None:
    for k in range(run.s):
        c[k] = run.P[k, t]


def _grow_error(c: View, run: Lanes, dt: float) -> None:
    """Apply Phi to an error of the state, by its blocks that are not zero.

    With D = -dt C and [E] = -dt [a], a = C f, g the error of the gyro's bias and h that of the accelerometer's::

        d = D g,  q = E x phi + D h,  r = E x d
        phi+ = phi + d
        dv+ = dv + q + r/2
        dp+ = dp + dt dv + dt/2 q + dt/6 r
    """
    D, E = run.lever, run.twist
    g, h, d, q, r = room(run, "3"), room(run, "3"), room(run, "3"), room(run, "3"), room(run, "3")
    for i in range(3):
        g[i], h[i] = c[GYRO + i], c[ACCEL + i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        d[i] = D[i, 0] * g[0] + D[i, 1] * g[1] + D[i, 2] * g[2]
        q[i] = E[j] * c[ATTITUDE + k] - E[k] * c[ATTITUDE + j] + (D[i, 0] * h[0] + D[i, 1] * h[1] + D[i, 2] * h[2])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        r[i] = E[j] * d[k] - E[k] * d[j]
        c[POSITION + i] += dt * c[VELOCITY + i] + (0.5 * dt) * q[i] + (dt / 6.0) * r[i]
        c[VELOCITY + i] += q[i] + 0.5 * r[i]
        c[ATTITUDE + i] += d[i]


grow = congruence(_grow_error, POSITION, GYRO)


def propagate(run: Lanes, noise: View, dt: float) -> None:
    """Carry the covariances over a step: Phi P Phi' + Q, as in `jerkbench.inertial.mechanisation.process_noise`."""
    grow(run, dt)
    for i in range(3):
        p, v, phi, gyro, accel = POSITION + i, VELOCITY + i, ATTITUDE + i, GYRO + i, ACCEL + i
        run.P[p, p] += noise[1] * (dt * dt * dt / 3.0)
        run.P[p, v] += noise[1] * (dt * dt / 2.0)
        run.P[v, v] += noise[1] * dt
        run.P[phi, phi] += noise[0] * dt
        run.P[gyro, gyro] += noise[2] * dt
        run.P[accel, accel] += noise[3] * dt
