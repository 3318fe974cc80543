"""Compiled propagation of the nominal states and the covariances of a batch of runs over a time step.

The equations are documented in `jerkbench.inertial.state`.
"""

import math
from collections.abc import Callable

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import not_inlined
from jerkbench.compilation.vectors import anywhere, each_run
from jerkbench.inertial.state import ACCEL, ATTITUDE, GYRO, POSITION, VELOCITY
from jerkbench.kinematic.arguments import Runs, copy_matrix
from jerkbench.recording import GRAVITY_MPS2

# Rotation matrices.

SMALL = 0.01
"""Square of an angle [rad2]. For smaller squares, a power series that is exact to rounding replaces sine and cosine."""


@not_inlined
def fill_rotation_exp(run: Runs, x: float, y: float, z: float) -> None:
    """Write Exp of the rotation vector (x, y, z) to ``rotation``, as in `jerkbench.inertial.state.rotation_exp`."""
    square = x * x + y * y + z * z
    sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    cosine = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    if anywhere(square - SMALL):
        sine, cosine = each_run(_sine, square, sine), each_run(_cosine, square, cosine)
    fill_from_factors(run, sine, cosine, x, y, z)


def _sine(square: float, series: float) -> float:
    """Return sin(a)/a for the squared angle ``square`` = a^2, or the value ``series`` if the angle is small."""
    a = math.sqrt(square)
    return math.sin(a) / a if square >= SMALL else series


def _cosine(square: float, series: float) -> float:
    """Return (1 - cos(a))/a^2 for the squared angle ``square`` = a^2, or the value ``series`` if the angle is small."""
    half = 0.5 * math.sqrt(square)
    return 0.5 * (math.sin(half) / half) * (math.sin(half) / half) if square >= SMALL else series


def fill_from_factors(run: Runs, s: float, c: float, x: float, y: float, z: float) -> None:
    """Write the matrix I + s [(x, y, z)] + c [(x, y, z)]^2 to ``rotation``."""
    C = run.rotation
    C[0, 0], C[1, 1], C[2, 2] = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    C[0, 1], C[1, 0] = c * x * y - s * z, c * x * y + s * z
    C[0, 2], C[2, 0] = c * x * z + s * y, c * x * z - s * y
    C[1, 2], C[2, 1] = c * y * z - s * x, c * y * z + s * x


def multiply(left: FloatArray, right: FloatArray, into: FloatArray) -> None:
    """Write the product of the matrices ``left`` and ``right`` (3, 3) to ``into``."""
    for i in range(3):
        for j in range(3):
            into[i, j] = left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]


def multiply_transposed(left: FloatArray, right: FloatArray, into: FloatArray) -> None:
    """Write the product of the transposed matrix ``left`` and the matrix ``right`` (3, 3) to ``into``."""
    for i in range(3):
        for j in range(3):
            into[i, j] = left[0, i] * right[0, j] + left[1, i] * right[1, j] + left[2, i] * right[2, j]


# Propagation of the nominal state.


def sense(run: Runs, accel: FloatArray, gyro: FloatArray) -> None:
    """Write specific force and angular rate of an IMU sample to ``run``, with the estimated biases subtracted."""
    for i in range(3):
        run.force[i] = accel[i] - run.accel_bias[i]
        run.rate[i] = gyro[i] - run.gyro_bias[i]


def mechanise(run: Runs, earth: FloatArray, rotates: bool, dt: float) -> None:
    """Propagate the nominal states over a step, and compute ``dt_C`` and ``dt_force`` for the covariance propagation.

    Args:
        run: record with the states of the eight runs.
        earth: (4,) angular rate of the Earth in ENU [rad/s], and the inverse 1/R of the Earth radius [1/m].
        rotates: whether at least one run includes the Earth's rotation.
        dt: length of the step [s].
    """
    fill_rotation_exp(run, dt * run.rate[0], dt * run.rate[1], dt * run.rate[2])
    multiply(run.C, run.rotation, run.C_next)
    if rotates:
        fill_rotation_exp(run, -dt * earth[0], -dt * earth[1], -dt * earth[2])
        copy_matrix(run.C_next, run.C_before)
        multiply(run.rotation, run.C_before, run.C_next)
    mean, force = run.dt_C, run.dt_force
    for i in range(3):
        for j in range(3):
            mean[i, j] = 0.5 * (run.C[i, j] + run.C_next[i, j])
    copy_matrix(run.C_next, run.C)
    for i in range(3):
        force[i] = mean[i, 0] * run.force[0] + mean[i, 1] * run.force[1] + mean[i, 2] * run.force[2]
    _integrate(run, force, earth, rotates, dt)
    for i in range(3):
        force[i] *= 0.0 - dt
        for j in range(3):
            mean[i, j] *= 0.0 - dt


def _integrate(run: Runs, force: FloatArray, earth: FloatArray, rotates: bool, dt: float) -> None:
    """Propagate position and velocity over a time step with the specific force ``force`` in ENU."""
    v, a, g = run.vectors[0], run.vectors[1], GRAVITY_MPS2
    for i in range(3):
        v[i] = run.x[VELOCITY + i]
    a[0] = force[0] - g * run.x[0] * earth[3]
    a[1] = force[1] - g * run.x[1] * earth[3]
    a[2] = force[2] - g * (1.0 - 2.0 * run.x[2] * earth[3])
    if rotates:
        a[0] -= 2.0 * (earth[1] * v[2] - earth[2] * v[1])
        a[1] -= 2.0 * (earth[2] * v[0] - earth[0] * v[2])
        a[2] -= 2.0 * (earth[0] * v[1] - earth[1] * v[0])
    for i in range(3):
        run.x[VELOCITY + i] = v[i] + a[i] * dt
        run.x[i] += (v[i] + run.x[VELOCITY + i]) * (0.5 * dt)


# Propagation of the covariance.


def congruence(apply: Callable[..., None], first: int, last: int) -> Callable[[Runs, float], None]:
    """Return a function that replaces P by T P T', where T changes only the states ``first`` to ``last`` - 1.

    Args:
        apply: function (c, run, dt) that replaces a vector c by T c.
        first: index of the first state that T changes.
        last: index after the last state that T changes. T may change at most nine states.
    """

    @not_inlined
    def transform_covariance(run: Runs, dt: float) -> None:
        c, half, P, s = run.column, run.half, run.P, len(run.x)
        for t in range(s):
            for k in range(s):
                c[k] = P[k, t]
            apply(c, run, dt)
            for k in range(first, last):
                half[k - first, t] = c[k]
        for r in range(first, last):
            for k in range(s):
                c[k] = half[r - first, k]
            apply(c, run, dt)
            for k in range(s):
                half[r - first, k] = c[k]
        for r in range(first, last):
            for k in range(s):
                if k < first or k >= last or k >= r:
                    P[r, k] = P[k, r] = half[r - first, k]

    return transform_covariance


def _propagate_error(c: FloatArray, run: Runs, dt: float) -> None:
    """Multiply an error of the state by the nonzero blocks of the transition matrix Phi.

    In the following equations, D = -dt C, E = -dt C f, g is the error of the gyro bias, and h is the error of the
    accelerometer bias::

        d = D g,  q = E x phi + D h,  r = E x d
        phi+ = phi + d
        dv+ = dv + q + r/2
        dp+ = dp + dt dv + dt/2 q + dt/6 r
    """
    D, E, d, q, r = run.dt_C, run.dt_force, run.vectors[0], run.vectors[1], run.vectors[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        d[i] = D[i, 0] * c[GYRO] + D[i, 1] * c[GYRO + 1] + D[i, 2] * c[GYRO + 2]
        by_accel = D[i, 0] * c[ACCEL] + D[i, 1] * c[ACCEL + 1] + D[i, 2] * c[ACCEL + 2]
        q[i] = E[j] * c[ATTITUDE + k] - E[k] * c[ATTITUDE + j] + by_accel
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        r[i] = E[j] * d[k] - E[k] * d[j]
        c[POSITION + i] += dt * c[VELOCITY + i] + (0.5 * dt) * q[i] + (dt / 6.0) * r[i]
        c[VELOCITY + i] += q[i] + 0.5 * r[i]
        c[ATTITUDE + i] += d[i]


transform_by_transition = congruence(_propagate_error, POSITION, GYRO)


def propagate(run: Runs, noise: FloatArray, dt: float) -> None:
    """Propagate the covariances over a time step: Phi P Phi' + Q (`jerkbench.inertial.state.process_noise`)."""
    transform_by_transition(run, dt)
    for i in range(3):
        p, v, phi, gyro, accel = POSITION + i, VELOCITY + i, ATTITUDE + i, GYRO + i, ACCEL + i
        run.P[p, p] += noise[1] * (dt * dt * dt / 3.0)
        run.P[p, v] += noise[1] * (dt * dt / 2.0)
        run.P[v, p] = run.P[p, v]
        run.P[v, v] += noise[1] * dt
        run.P[phi, phi] += noise[0] * dt
        run.P[gyro, gyro] += noise[2] * dt
        run.P[accel, accel] += noise[3] * dt
