"""The estimated error, put into the nominal state, and the covariance of what is left.

`jerkbench.inertial.state` and `jerkbench.inertial.update` have the equations; of an invariant error
`jerkbench.inertial.update` has them.
"""

import math

from jerkbench.compilation.views import RunView, View, lane, room
from jerkbench.inertial.strapdown import congruence, fill_by_factors, fill_turn, multiply, multiply_transposed
from jerkbench.recording import GRAVITY_MPS2

TINY = 1e-12
"""A smaller angle counts as this one: to the last digit there is no difference."""


def feed_back(run: RunView) -> None:
    """Put the error into the nominal state, whose position and velocity are corrected by addition already."""
    for i in range(3):
        for j in range(3):
            run.before[i, j] = run.C[i, j]
    _turn(run)
    for i in range(3):
        run.gyro_bias[i] += run.x[9 + i]
    if run.deformed == 1:
        for i in range(3):
            for j in range(3):
                run.gyro_matrix[i, j] += run.x[15 + 3 * j + i]
                run.accel_matrix[i, j] += run.x[24 + 3 * j + i]
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


def _turn(run: RunView) -> None:
    """C+ = Exp(phi) C, orthogonal again: C (3 I - C'C)/2."""
    fill_turn(run, run.x[6], run.x[7], run.x[8])
    multiply(run.turn, run.before, run.next)
    multiply_transposed(run.next, run.next, run.turn)
    multiply(run.next, run.turn, run.C)
    for i in range(3):
        for j in range(3):
            run.C[i, j] = 1.5 * run.next[i, j] - 0.5 * run.C[i, j]


def _add_accel_bias(run: RunView) -> None:
    """The accelerometer's bias keeps the force that holds the body up."""
    g, up, c, shown = GRAVITY_MPS2, room(run, "3"), room(run, "3"), room(run, "3")
    for i in range(3):
        up[i], c[i] = g * run.before[2, i], run.x[12 + i]
    if run.deformed == 1:
        for i in range(3):
            c[i] += run.x[24 + i] * up[0] + run.x[27 + i] * up[1] + run.x[30 + i] * up[2]
    B = run.before
    e = g * run.x[7] - (B[0, 0] * c[0] + B[0, 1] * c[1] + B[0, 2] * c[2])
    n = 0.0 - g * run.x[6] - (B[1, 0] * c[0] + B[1, 1] * c[1] + B[1, 2] * c[2])
    u = g - (B[2, 0] * c[0] + B[2, 1] * c[1] + B[2, 2] * c[2])
    for i in range(3):
        shown[i] = run.C[0, i] * e + run.C[1, i] * n + run.C[2, i] * u
        run.accel_bias[i] += up[i] - shown[i]
    if run.deformed == 1:
        for i in range(3):
            run.accel_bias[i] -= run.x[24 + i] * shown[0] + run.x[27 + i] * shown[1] + run.x[30 + i] * shown[2]


def _carry_error(c: View, run: RunView, _dt: float) -> None:
    """Apply G of `jerkbench.inertial.update.reset`."""
    g = GRAVITY_MPS2
    x, y, z = 0.5 * run.x[6], 0.5 * run.x[7], 0.5 * run.x[8]
    p, q, r = y * c[8] - z * c[7], z * c[6] - x * c[8], x * c[7] - y * c[6]
    c[6] += p
    c[7] += q
    c[8] += r
    a, b, d = c[12], c[13], c[14]
    if run.deformed == 1:
        for j in range(3):
            up = g * run.before[2, j]
            a += up * c[24 + 3 * j]
            b += up * c[25 + 3 * j]
            d += up * c[26 + 3 * j]
    for i in range(3):
        turned = run.back[i, 0] * a + run.back[i, 1] * b + run.back[i, 2] * d
        c[12 + i] = turned + (g * run.C[0, i]) * q - (g * run.C[1, i]) * p
        if run.deformed == 1:
            for j in range(3):
                c[12 + i] -= (g * run.C[2, j]) * c[24 + 3 * j + i]


carry = congruence(_carry_error, 6, 15)


# An invariant error.


def _shift(run: RunView) -> None:
    """Make position and velocity p + J dp, v + J dv; the accelerometer's bias is added as it comes."""
    x, y, z = run.x[6], run.x[7], run.x[8]
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
        run.accel_bias[i] += run.x[12 + i]


def _fill_jacobian_factors(alone: RunView) -> None:
    """Of J of `jerkbench.inertial.state.left_jacobian`."""
    a = max(math.sqrt(alone.square_of_angle), TINY)
    half = math.sin(0.5 * a) / (0.5 * a)
    alone.sine = 0.5 * half * half
    alone.cosine = (a - math.sin(a)) / (a * a * a)


def _carry_error_on_group(c: View, run: RunView, _dt: float) -> None:
    """Apply G of `jerkbench.inertial.update.reset_on_group`: dp - [p+ - p] phi, dv - [v+ - v] phi."""
    for part in range(0, 6, 3):
        x, y, z = run.shift[part], run.shift[part + 1], run.shift[part + 2]
        c[part] -= y * c[8] - z * c[7]
        c[part + 1] -= z * c[6] - x * c[8]
        c[part + 2] -= x * c[7] - y * c[6]


carry_on_group = congruence(_carry_error_on_group, 0, 6)
