"""The estimated error, put into the nominal state, and the covariance of what is left.

`jerkbench.inertial.state` and `jerkbench.inertial.update` have the equations; of an invariant error
`jerkbench.inertial.update` has them.
"""

import math

from jerkbench.compilation.views import Lanes, View, lane, room
from jerkbench.inertial.state import ACCEL, ACCEL_MATRIX, ATTITUDE, GYRO, GYRO_MATRIX, POSITION, STATES, VELOCITY
from jerkbench.inertial.strapdown import congruence, fill_by_factors, fill_turn, multiply, multiply_transposed
from jerkbench.recording import GRAVITY_MPS2

TINY = 1e-12
"""A smaller angle counts as this one: to the last digit there is no difference."""


def feed_back(run: Lanes) -> None:
    """Put the error into the nominal state, whose position and velocity are corrected by addition already."""
    for i in range(3):
        for j in range(3):
            run.before[i, j] = run.C[i, j]
    _turn(run)
    for i in range(3):
        run.gyro_bias[i] += run.x[GYRO + i]
    if run.deformed == 1:
        for i in range(3):
            for j in range(3):
                run.gyro_matrix[i, j] += run.x[GYRO_MATRIX + 3 * j + i]
                run.accel_matrix[i, j] += run.x[ACCEL_MATRIX + 3 * j + i]
    if run.wheeled == 1:
        run.wheel += run.x[run.s - 1]
    if run.invariant == 1:
        _shift(run)
        carry_on_group(run, 0.0)
    else:
        _add_accel_bias(run)
        multiply_transposed(run.C, run.before, run.back)
        carry(run, 0.0)
    for s in range(6, run.s):
        run.x[s] = run.x[s] * 0.0


def _turn(run: Lanes) -> None:
    """C+ = Exp(phi) C, orthogonal again: C (3 I - C'C)/2."""
    fill_turn(run, run.x[ATTITUDE], run.x[ATTITUDE + 1], run.x[ATTITUDE + 2])
    multiply(run.turn, run.before, run.next)
    multiply_transposed(run.next, run.next, run.turn)
    multiply(run.next, run.turn, run.C)
    for i in range(3):
        for j in range(3):
            run.C[i, j] = 1.5 * run.next[i, j] - 0.5 * run.C[i, j]


def _add_accel_bias(run: Lanes) -> None:
    """The accelerometer's bias keeps the force that holds the body up: `jerkbench.inertial.state.corrected`."""
    g, B, phi, M = GRAVITY_MPS2, run.before, ATTITUDE, ACCEL_MATRIX
    up, change, force = room(run, "3"), room(run, "3"), room(run, "3")
    for i in range(3):
        up[i], change[i] = g * B[2, i], run.x[ACCEL + i]
    if run.deformed == 1:
        for i in range(3):
            change[i] += run.x[M + i] * up[0] + run.x[M + 3 + i] * up[1] + run.x[M + 6 + i] * up[2]
    force[0], force[1], force[2] = g * run.x[phi + 1], 0.0 - g * run.x[phi], run.zero + g
    for i in range(3):
        force[i] -= B[i, 0] * change[0] + B[i, 1] * change[1] + B[i, 2] * change[2]
    shown = room(run, "3")
    for i in range(3):
        shown[i] = run.C[0, i] * force[0] + run.C[1, i] * force[1] + run.C[2, i] * force[2]
        run.accel_bias[i] += up[i] - shown[i]
    if run.deformed == 1:
        for i in range(3):
            run.accel_bias[i] -= run.x[M + i] * shown[0] + run.x[M + 3 + i] * shown[1] + run.x[M + 6 + i] * shown[2]


def _carry_error(c: View, run: Lanes, _dt: float) -> None:
    """Apply G of `jerkbench.inertial.update.reset` to an error of the state.

    With phi+ - phi = [turn]/2 phi = d, C of before, C+ of after and the force a = g e3 that holds the body up::

        phi+ = phi + d
        db_a+ = C+' C (db_a + dM_a C' a) + C+' (d x a) - dM_a C+' a
    """
    g, turn, back = GRAVITY_MPS2, room(run, "3"), run.back
    d, error = room(run, "3"), room(run, "3")
    for i in range(3):
        turn[i] = 0.5 * run.x[ATTITUDE + i]
        error[i] = c[ACCEL + i]
        if run.deformed == 1:
            for j in range(3):
                error[i] += g * run.before[2, j] * c[ACCEL_MATRIX + 3 * j + i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        d[i] = turn[j] * c[ATTITUDE + k] - turn[k] * c[ATTITUDE + j]
    for i in range(3):
        c[ATTITUDE + i] += d[i]
        turned = back[i, 0] * error[0] + back[i, 1] * error[1] + back[i, 2] * error[2]
        c[ACCEL + i] = turned + (g * run.C[0, i]) * d[1] - (g * run.C[1, i]) * d[0]
        if run.deformed == 1:
            for j in range(3):
                c[ACCEL + i] -= (g * run.C[2, j]) * c[ACCEL_MATRIX + 3 * j + i]


carry = congruence(_carry_error, ATTITUDE, STATES)


# An invariant error.


def _shift(run: Lanes) -> None:
    """Make position and velocity p + J dp, v + J dv; the accelerometer's bias is added as it comes."""
    x, y, z = run.x[ATTITUDE], run.x[ATTITUDE + 1], run.x[ATTITUDE + 2]
    run.square_of_angle = x * x + y * y + z * z
    for k in range(run.width):
        _fill_jacobian_factors(lane(run, k))
    fill_by_factors(run, x, y, z)
    d, J = room(run, "3"), run.turn
    for part in range(0, 6, 3):
        for i in range(3):
            d[i] = run.x[part + i] - run.nominal[part + i]
        for i in range(3):
            run.shift[part + i] = J[i, 0] * d[0] + J[i, 1] * d[1] + J[i, 2] * d[2]
            run.x[part + i] = run.nominal[part + i] + run.shift[part + i]
    for i in range(3):
        run.accel_bias[i] += run.x[ACCEL + i]


def _fill_jacobian_factors(alone: Lanes) -> None:
    """Of J of `jerkbench.inertial.state.left_jacobian`."""
    a = max(math.sqrt(alone.square_of_angle), TINY)
    half = math.sin(0.5 * a) / (0.5 * a)
    alone.sine = 0.5 * half * half
    alone.cosine = (a - math.sin(a)) / (a * a * a)


def _carry_error_on_group(c: View, run: Lanes, _dt: float) -> None:
    """Apply G of `jerkbench.inertial.update.reset_on_group`: dp - [p+ - p] phi, dv - [v+ - v] phi."""
    for part in (POSITION, VELOCITY):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            c[part + i] -= run.shift[part + j] * c[ATTITUDE + k] - run.shift[part + k] * c[ATTITUDE + j]


carry_on_group = congruence(_carry_error_on_group, POSITION, ATTITUDE)
