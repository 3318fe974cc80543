"""What aids the compiled navigation: position and velocity of a point, yaw, and what the vehicle cannot do.

The kernel of kinematic filters takes measurements of the first six states. So for an update these states become what is
measured, h = [position; velocity], and the covariance that of its error: with T of the error state, which is regular,

    dh = T dx,    P_h = T P T',    and after the update    dx = T^-1 dh,    P = T^-1 P_h T^-1'

`jerkbench.inertial.update` has the rows of T; the other states stay as they are. What the update finds is then put into
the nominal state.
"""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Lanes, View, lane, room, row
from jerkbench.inertial.state import ACCEL, ATTITUDE, GYRO, POSITION, STATES, VELOCITY
from jerkbench.inertial.strapdown import congruence, fill_by_factors, fill_turn, multiply, multiply_transposed
from jerkbench.kinematic.correction import correct, mahalanobis
from jerkbench.recording import GRAVITY_MPS2


def observe(run: Lanes, arm: View, velocity_arm: View, frame: View) -> None:
    """Put what is measured in the place of position and velocity.

    Args:
        run: the runs.
        arm: (3,) of the point whose position is measured.
        velocity_arm: (3,) of that whose velocity is.
        frame: (2,) 1 where the velocity is along the body, else 0 (ENU); 1 where a wheel shows it, else 0.
    """
    C, a, w = run.C, velocity_arm, run.rate
    swing, v, in_enu = room(run, "3"), room(run, "3"), room(run, "3")
    swing[0], swing[1], swing[2] = w[1] * a[2] - w[2] * a[1], w[2] * a[0] - w[0] * a[2], w[0] * a[1] - w[1] * a[0]
    for i in range(3):
        v[i] = run.x[VELOCITY + i]
        in_enu[i] = C[i, 0] * swing[0] + C[i, 1] * swing[1] + C[i, 2] * swing[2]  # C (w x l)
        run.arm[i] = C[i, 0] * arm[0] + C[i, 1] * arm[1] + C[i, 2] * arm[2]
        run.x[i] += run.arm[i]
    levers, by_gyro, skewed, tilted = room(run, "3 3"), room(run, "3 3"), room(run, "3 3"), room(run, "3 3")
    _fill_skew(levers, a)
    multiply(C, levers, by_gyro)  # C [l]
    _fill_skew(skewed, v)
    multiply_transposed(C, skewed, tilted)  # C' [v]
    _fill_skew(skewed, in_enu)
    body, scale = frame[0], 1.0 + frame[1] * run.wheel_scale
    for i in range(3):
        along = C[0, i] * v[0] + C[1, i] * v[1] + C[2, i] * v[2] + swing[i]  # C' v + w x l
        shown = scale if i == 0 else run.zero + 1.0
        if i == 0:
            run.wheel_slope = frame[1] * along
        run.x[VELOCITY + i] = chosen(body, 0.5, shown * along, v[i] + in_enu[i])
        for j in range(3):
            same = 1.0 if i == j else 0.0
            run.of_velocity[i, j] = chosen(body, 0.5, shown * C[j, i], same)
            run.from_velocity[j, i] = chosen(body, 0.5, C[j, i] / shown, same)
            run.of_attitude[i, j] = chosen(body, 0.5, shown * tilted[i, j], 0.0 - skewed[i, j])
            run.of_gyro[i, j] = chosen(body, 0.5, shown * levers[i, j], by_gyro[i, j])
    for s in range(6):
        run.expected[s] = run.x[s]
    to_measured(run, 0.0)


def _fill_skew(S: View, a: View) -> None:
    """Make S b = a x b."""
    for i in range(3):
        S[i, i] = a[i] * 0.0
    S[2, 1], S[0, 2], S[1, 0] = a[0], a[1], a[2]
    S[1, 2], S[2, 0], S[0, 1] = 0.0 - a[0], 0.0 - a[1], 0.0 - a[2]


def conclude(run: Lanes) -> None:
    """Put position and velocity back into their place, with the estimated error."""
    error = room(run, "s")
    for s in range(run.s):
        error[s] = run.x[s]
    for s in range(6):
        error[s] = run.x[s] - run.expected[s]
    _from_measured(error, run, 0.0)
    for s in range(6):
        run.x[s] = run.nominal[s] + error[s]
    to_states(run, 0.0)


def _to_measured(c: View, run: Lanes, _dt: float) -> None:
    """Apply T."""
    dv, other = room(run, "3"), room(run, "3")
    _fill_others(other, c, run)
    for i in range(3):
        dv[i] = c[VELOCITY + i]
    for i in range(3):
        A = run.of_velocity
        c[VELOCITY + i] = A[i, 0] * dv[0] + A[i, 1] * dv[1] + A[i, 2] * dv[2] + other[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        c[POSITION + i] -= run.arm[j] * c[ATTITUDE + k] - run.arm[k] * c[ATTITUDE + j]


def _from_measured(c: View, run: Lanes, _dt: float) -> None:
    """Apply T^-1."""
    dh, other = room(run, "3"), room(run, "3")
    _fill_others(other, c, run)
    for i in range(3):
        dh[i] = c[VELOCITY + i] - other[i]
    for i in range(3):
        A = run.from_velocity
        c[VELOCITY + i] = A[i, 0] * dh[0] + A[i, 1] * dh[1] + A[i, 2] * dh[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        c[POSITION + i] += run.arm[j] * c[ATTITUDE + k] - run.arm[k] * c[ATTITUDE + j]


def _fill_others(other: View, c: View, run: Lanes) -> None:
    """What errors of the attitude, the gyro and the wheel's scale do to a measured velocity."""
    B, D, g = run.of_attitude, run.of_gyro, room(run, "3")
    for i in range(3):
        g[i] = c[GYRO + i]
    for i in range(3):
        by_attitude = B[i, 0] * c[ATTITUDE] + B[i, 1] * c[ATTITUDE + 1] + B[i, 2] * c[ATTITUDE + 2]
        other[i] = by_attitude + (D[i, 0] * g[0] + D[i, 1] * g[1] + D[i, 2] * g[2])
    if run.at_wheel_scale > 0:
        other[0] += run.wheel_slope * c[run.at_wheel_scale]


to_measured = congruence(_to_measured, POSITION, ATTITUDE)
to_states = congruence(_from_measured, POSITION, ATTITUDE)


# What the vehicle cannot do.


def constrain(run: Lanes, held: View, limits: View, point: View, states: int) -> None:
    """Take a velocity of zero when it stands still, else none sideways and upwards.

    Args:
        run: the runs.
        held: () 2 where the IMU stands still, 1 where it does not, 0 where no constraint is due.
        limits: (3,) still_below_mps, still_sigma_mps, sideways_sigma_mps of `run_inputs.Constraints`.
        point: (3,) where nothing moves sideways.
        states: their number, as for `correct`.
    """
    square = run.x[3] * run.x[3] + run.x[4] * run.x[4] + run.x[5] * run.x[5]
    rests = chosen(held[0], 1.5, chosen(limits[0] * limits[0], square, 1.0, 0.0), 0.0)
    sideways = (1.0 - rests) * chosen(held[0], 0.5, chosen(limits[2], 0.0, 1.0, 0.0), 0.0)
    arm, here, frame = room(run, "3"), room(run, "3"), room(run, "2")
    frame[0], frame[1] = sideways, run.zero
    for i in range(3):
        arm[i], here[i] = sideways * point[i], run.zero
    observe(run, here, arm, frame)
    sigma = chosen(rests, 0.5, limits[1], limits[2])
    for r in range(6):
        run.used[r] = run.zero if r < 3 else rests if r == 3 else rests + sideways
        run.y[r] = chosen(run.used[r], 0.0, 0.0 - run.x[r], 0.0)
        for c in range(6):
            run.R[r, c] = run.used[r] * (sigma * sigma) if r == c else run.zero
    mahalanobis(run)
    correct(run, states)
    conclude(run)


# The update with a measured yaw; `jerkbench.inertial.update.heading` has the equations.


def take_heading(run: Lanes, yaw: FloatArray, which: int) -> None:
    """Estimate the error from row ``which`` of the yaws, in the runs that have one: K = P H'/S, P - K S K'.

    Args:
        run: the runs, whose error is zero; of position and velocity it is put into the nominal state.
        yaw: (rows, 2, WIDTH) measured yaw [rad], NaN where there is none, and its sigma.
        which: the row.
    """
    for k in range(run.width):
        _innovate(lane(run, k), yaw[which, 0, k])
    e, n, u = run.C[0, 0], run.C[1, 0], run.C[2, 0]
    level = e * e + n * n
    of_east, of_north = 0.0 - u * e / level, 0.0 - u * n / level
    sigma, column = row(yaw, which, run, "2")[1], room(run, "s")
    phi = ATTITUDE
    for s in range(run.s):  # P H'
        column[s] = of_east * run.P[s, phi] + of_north * run.P[s, phi + 1] + run.P[s, phi + 2]
    share = run.measured / (of_east * column[phi] + of_north * column[phi + 1] + column[phi + 2] + sigma * sigma)
    for s in range(run.s):
        gain = share * column[s]
        run.x[s] += gain * run.innovation
        for t in range(s + 1):
            run.P[s, t] = run.P[s, t] - gain * column[t]


def _innovate(alone: Lanes, yaw: float) -> None:
    """Fill the innovation, between -pi and pi, and 1 in ``measured``; both are 0 where nothing is measured."""
    measured = np.isfinite(yaw)
    apart = yaw - math.atan2(alone.C[1, 0], alone.C[0, 0]) + math.pi
    wrapped = apart - 2.0 * math.pi * math.floor(apart / (2.0 * math.pi)) - math.pi if measured else 0.0
    alone.innovation = wrapped
    alone.measured = 1.0 if measured else 0.0


# The estimated error, put into the nominal state, and the covariance of what is left: `jerkbench.inertial.state` and
# `jerkbench.inertial.update` have the equations.


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
    for s in range(STATES, run.s):  # what else is estimated
        run.state[6 + s] += run.x[s]
    if run.invariant == 1:
        _shift(run)
        carry_on_group(run, 0.0)
    else:
        _add_accel_bias(run)
        multiply_transposed(run.C, run.before, run.back)
        carry(run, 0.0)
    for s in range(ATTITUDE, run.s):
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
    g, B, phi = GRAVITY_MPS2, run.before, ATTITUDE
    up, change, force = room(run, "3"), room(run, "3"), room(run, "3")
    for i in range(3):
        up[i], change[i] = g * B[2, i], run.x[ACCEL + i]
    force[0], force[1], force[2] = g * run.x[phi + 1], 0.0 - g * run.x[phi], run.zero + g
    for i in range(3):
        force[i] -= B[i, 0] * change[0] + B[i, 1] * change[1] + B[i, 2] * change[2]
    shown = room(run, "3")
    for i in range(3):
        shown[i] = run.C[0, i] * force[0] + run.C[1, i] * force[1] + run.C[2, i] * force[2]
        run.accel_bias[i] += up[i] - shown[i]


def _carry_error(c: View, run: Lanes, _dt: float) -> None:
    """Apply G of `jerkbench.inertial.update.reset` to an error of the state.

    With phi+ - phi = [turn]/2 phi = d, C of before, C+ of after and the force a = g e3 that holds the body up::

        phi+ = phi + d
        db_a+ = C+' C db_a + C+' (d x a)
    """
    g, turn, back = GRAVITY_MPS2, room(run, "3"), run.back
    d, error = room(run, "3"), room(run, "3")
    for i in range(3):
        turn[i] = 0.5 * run.x[ATTITUDE + i]
        error[i] = c[ACCEL + i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        d[i] = turn[j] * c[ATTITUDE + k] - turn[k] * c[ATTITUDE + j]
    for i in range(3):
        c[ATTITUDE + i] += d[i]
        turned = back[i, 0] * error[0] + back[i, 1] * error[1] + back[i, 2] * error[2]
        c[ACCEL + i] = turned + (g * run.C[0, i]) * d[1] - (g * run.C[1, i]) * d[0]


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
