"""Updates of the compiled navigation with positions, velocities, motion constraints and headings, and the correction.

The measurement update of the kinematic filters requires that the first six states are measured. Before an update, the
first six states are therefore replaced by the predicted measurement h = [position; velocity], and the covariance is
transformed to the covariance of the error of h. The transformation is linear, with an invertible matrix T::

    dh = T dx,    P_h = T P T',    and after the update    dx = T^-1 dh,    P = T^-1 P_h T^-1'

The module `jerkbench.inertial.update` documents the rows of T. The transformation T changes only the first six states.
After the update, the estimated error is added to the nominal state.
"""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import not_inlined
from jerkbench.compilation.vectors import each_run, select
from jerkbench.inertial.state import (
    ACCEL,
    ATTITUDE,
    GYRO,
    MIN_ANGLE_RAD,
    POSITION,
    STATES,
    VELOCITY,
    WHEEL_SCALE,
)
from jerkbench.inertial.strapdown import congruence, fill_from_factors, fill_rotation_exp, multiply, multiply_transposed
from jerkbench.kinematic.arguments import Runs, copy_matrix
from jerkbench.kinematic.update import correct
from jerkbench.recording import GRAVITY_MPS2


@not_inlined
def to_measurement(run: Runs, arm: FloatArray, velocity_arm: FloatArray, frame: FloatArray) -> None:
    """Replace position and velocity by the predicted measurement, and transform the covariance accordingly.

    Args:
        run: record with the states of the eight runs.
        arm: (3,) lever arm of the measured position.
        velocity_arm: (3,) lever arm of the measured velocity.
        frame: (2,) two flags of the measured velocity. The first flag is 1 for the body frame and 0 for ENU. The second
            flag is 1 for a wheel speed, otherwise 0.
    """
    C, a, w = run.C, velocity_arm, run.rate
    swing, v, swing_enu = run.vectors[0], run.vectors[1], run.vectors[2]
    swing[0], swing[1], swing[2] = w[1] * a[2] - w[2] * a[1], w[2] * a[0] - w[0] * a[2], w[0] * a[1] - w[1] * a[0]
    for i in range(3):
        v[i] = run.x[VELOCITY + i]
        swing_enu[i] = C[i, 0] * swing[0] + C[i, 1] * swing[1] + C[i, 2] * swing[2]  # compute C (w x l)
        run.arm[i] = C[i, 0] * arm[0] + C[i, 1] * arm[1] + C[i, 2] * arm[2]
        run.x[i] += run.arm[i]
    _fill_skew(run.skew_arm, a)
    multiply(C, run.skew_arm, run.C_skew_arm)  # C [l]
    _fill_skew(run.skew, v)
    multiply_transposed(C, run.skew, run.skew_body)  # C' [v]
    _fill_skew(run.skew, swing_enu)
    body, wheel_scale = frame[0], 1.0 + frame[1] * run.wheel_scale[0]
    for i in range(3):
        along = C[0, i] * v[0] + C[1, i] * v[1] + C[2, i] * v[2] + swing[i]  # compute C' v + w x l
        scale = wheel_scale if i == 0 else 1.0 + 0.0 * body
        if i == 0:
            run.dh_dscale[0] = frame[1] * along
        run.x[VELOCITY + i] = select(body, 0.5, scale * along, v[i] + swing_enu[i])
        for j in range(3):
            same = 1.0 if i == j else 0.0
            run.dh_dv[i, j] = select(body, 0.5, scale * C[j, i], same)
            run.dv_dh[j, i] = select(body, 0.5, C[j, i] / scale, same)
            run.dh_dphi[i, j] = select(body, 0.5, scale * run.skew_body[i, j], 0.0 - run.skew[i, j])
            run.dh_dgyro[i, j] = select(body, 0.5, scale * run.skew_arm[i, j], run.C_skew_arm[i, j])
    for s in range(6):
        run.predicted[s] = run.x[s]
    transform_to_measurement(run, 0.0)


def _fill_skew(S: FloatArray, a: FloatArray) -> None:
    """Write the cross-product matrix of the vector a (3,) to S (3, 3)."""
    for i in range(3):
        S[i, i] = 0.0
    S[2, 1], S[0, 2], S[1, 0] = a[0], a[1], a[2]
    S[1, 2], S[2, 0], S[0, 1] = 0.0 - a[0], 0.0 - a[1], 0.0 - a[2]


@not_inlined
def from_measurement(run: Runs) -> None:
    """Replace the updated measurement by position and velocity, and transform the covariance back."""
    error = run.column
    for s in range(len(run.x)):
        error[s] = run.x[s] - run.predicted[s] if s < 6 else run.x[s]
    _apply_inverse_transformation(error, run, 0.0)
    for s in range(6):
        run.x[s] = run.nominal[s] + error[s]
    transform_from_measurement(run, 0.0)


def _apply_transformation(c: FloatArray, run: Runs, _dt: float) -> None:
    """Replace the state error dx by T dx, the error of the predicted measurement."""
    A, dv, other = run.dh_dv, run.vectors[3], run.vectors[4]
    _fill_other_errors(other, c, run)
    for i in range(3):
        dv[i] = c[VELOCITY + i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        c[VELOCITY + i] = A[i, 0] * dv[0] + A[i, 1] * dv[1] + A[i, 2] * dv[2] + other[i]
        c[POSITION + i] -= run.arm[j] * c[ATTITUDE + k] - run.arm[k] * c[ATTITUDE + j]


def _apply_inverse_transformation(c: FloatArray, run: Runs, _dt: float) -> None:
    """Replace an error dh of the predicted measurement by the error T^-1 dh of the state."""
    A, dh, other = run.dv_dh, run.vectors[3], run.vectors[4]
    _fill_other_errors(other, c, run)
    for i in range(3):
        dh[i] = c[VELOCITY + i] - other[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        c[VELOCITY + i] = A[i, 0] * dh[0] + A[i, 1] * dh[1] + A[i, 2] * dh[2]
        c[POSITION + i] += run.arm[j] * c[ATTITUDE + k] - run.arm[k] * c[ATTITUDE + j]


def _fill_other_errors(other: FloatArray, c: FloatArray, run: Runs) -> None:
    """Compute the error of the predicted velocity due to the errors of attitude, gyro bias and wheel scale."""
    B, D = run.dh_dphi, run.dh_dgyro
    for i in range(3):
        by_attitude = B[i, 0] * c[ATTITUDE] + B[i, 1] * c[ATTITUDE + 1] + B[i, 2] * c[ATTITUDE + 2]
        other[i] = by_attitude + (D[i, 0] * c[GYRO] + D[i, 1] * c[GYRO + 1] + D[i, 2] * c[GYRO + 2])
    if len(c) > STATES:
        other[0] += run.dh_dscale[0] * c[WHEEL_SCALE]


transform_to_measurement = congruence(_apply_transformation, POSITION, ATTITUDE)
transform_from_measurement = congruence(_apply_inverse_transformation, POSITION, ATTITUDE)


# Updates with motion constraints.


@not_inlined
def constrain(run: Runs, kind: float, limits: FloatArray, point: FloatArray) -> None:
    """Apply a zero-velocity update if the vehicle is stationary, otherwise the non-holonomic constraint.

    Args:
        run: record with the states of the eight runs.
        kind: 2 if the IMU is stationary, 1 if the IMU is moving, or 0 if no constraint is applied.
        limits: (3,) the fields still_below_mps, still_sigma_mps and sideways_sigma_mps of `run_inputs.Constraints`.
        point: (3,) lever arm of the non-holonomic constraint.
    """
    square = run.x[3] * run.x[3] + run.x[4] * run.x[4] + run.x[5] * run.x[5]
    rests = select(kind, 1.5, select(limits[0] * limits[0], square, 1.0, 0.0), 0.0)
    sideways = (1.0 - rests) * select(kind, 0.5, select(limits[2], 0.0, 1.0, 0.0), 0.0)
    velocity_arm, arm, frame = run.vectors[6], run.vectors[7], run.vectors[8]
    frame[0], frame[1] = sideways, 0.0
    for i in range(3):
        velocity_arm[i], arm[i] = sideways * point[i], 0.0
    to_measurement(run, arm, velocity_arm, frame)
    sigma, used = select(rests, 0.5, limits[1], limits[2]), run.used
    for r in range(6):
        used[r] = 0.0 * rests if r < 3 else rests if r == 3 else rests + sideways
        run.y[r] = select(used[r], 0.0, 0.0 - run.x[r], 0.0)
        for c in range(6):
            run.R[r, c] = used[r] * (sigma * sigma) if r == c else 0.0 * sigma
    correct(run, run.x, run.P)
    from_measurement(run)


# The update with a measured heading. The measurement function is `jerkbench.inertial.update.heading`.


@not_inlined
def update_heading(run: Runs, yaw: float, sigma: float) -> None:
    """Update the error state and its covariance with a measured yaw: K = P H'/S and P+ = P - K S K'.

    The estimated errors of position and velocity are added directly to the nominal position and velocity.

    Args:
        run: record with the states of the eight runs.
        yaw: measured yaw [rad], or NaN for each run without a measurement.
        sigma: standard deviation of the measured yaw [rad].
    """
    C, P, column, phi = run.C, run.P, run.column, ATTITUDE
    measured = select(1.0, yaw * 0.0, 1.0, 0.0)
    innovation = each_run(_yaw_innovation, C[1, 0], C[0, 0], yaw)
    e, n, u = C[0, 0], C[1, 0], C[2, 0]
    level = e * e + n * n
    H_east, H_north = 0.0 - u * e / level, 0.0 - u * n / level
    for s in range(len(run.x)):  # P H'
        column[s] = H_east * P[s, phi] + H_north * P[s, phi + 1] + P[s, phi + 2]
    over_S = measured / (H_east * column[phi] + H_north * column[phi + 1] + column[phi + 2] + sigma * sigma)
    for s in range(len(run.x)):
        gain = over_S * column[s]
        run.x[s] += gain * innovation
        for t in range(s + 1):
            P[s, t] = P[t, s] = P[s, t] - gain * column[t]


def _yaw_innovation(north: float, east: float, yaw: float) -> float:
    """Return the innovation of a measured yaw, wrapped to [-pi, pi) [rad], or 0 if ``yaw`` is NaN."""
    if not np.isfinite(yaw):
        return 0.0
    difference = yaw - math.atan2(north, east) + math.pi
    return difference - 2.0 * math.pi * math.floor(difference / (2.0 * math.pi)) - math.pi


# The correction of the nominal state by the estimated error, and the reset of the covariance after the correction.


@not_inlined
def feed_back(run: Runs, invariant: bool) -> None:
    """Correct the nominal state by the estimated error, reset the covariance, and set the estimated error to zero.

    The estimated errors of position and velocity have been added to the nominal state before the call of this function.
    """
    for i in range(3):
        run.gyro_bias[i] += run.x[GYRO + i]
    copy_matrix(run.C, run.C_before)
    _correct_attitude(run)
    if len(run.x) > STATES:
        run.wheel_scale[0] += run.x[WHEEL_SCALE]
    if invariant:
        _correct_on_group(run)
        transform_by_group_reset(run, 0.0)
    else:
        _correct_accel_bias(run)
        multiply_transposed(run.C, run.C_before, run.C_change)
        transform_by_reset(run, 0.0)
    for s in range(ATTITUDE, len(run.x)):
        run.x[s] = run.x[s] * 0.0


def _correct_attitude(run: Runs) -> None:
    """Compute the corrected attitude C+ = Exp(phi) C, made orthonormal by C (3 I - C' C)/2."""
    fill_rotation_exp(run, run.x[ATTITUDE], run.x[ATTITUDE + 1], run.x[ATTITUDE + 2])
    multiply(run.rotation, run.C_before, run.C_next)
    multiply_transposed(run.C_next, run.C_next, run.rotation)
    multiply(run.C_next, run.rotation, run.C)
    for i in range(3):
        for j in range(3):
            run.C[i, j] = 1.5 * run.C_next[i, j] - 0.5 * run.C[i, j]


def _correct_accel_bias(run: Runs) -> None:
    """Correct the accelerometer bias by the same equation as in `jerkbench.inertial.state.corrected`."""
    g, B, x, force, up = GRAVITY_MPS2, run.C_before, run.x, run.vectors[0], run.vectors[1]
    force[0], force[1], force[2] = g * x[ATTITUDE + 1], 0.0 - g * x[ATTITUDE], g
    for i in range(3):
        up[i] = g * B[2, i]
        force[i] -= B[i, 0] * x[ACCEL] + B[i, 1] * x[ACCEL + 1] + B[i, 2] * x[ACCEL + 2]
    for i in range(3):
        along = run.C[0, i] * force[0] + run.C[1, i] * force[1] + run.C[2, i] * force[2]
        run.accel_bias[i] += up[i] - along


def _apply_reset(c: FloatArray, run: Runs, _dt: float) -> None:
    """Apply the reset matrix G of `jerkbench.inertial.update.reset` to an error of the state.

    C is the attitude before the correction, C+ is the attitude after the correction, and a = g e3 is the specific force
    at rest. The error after the reset depends on the change d = phi+ - phi = [turn]/2 phi of the attitude error::

        phi+ = phi + d
        db_a+ = C+' C db_a + C+' (d x a)
    """
    g, A, turn, d, error = GRAVITY_MPS2, run.C_change, run.vectors[0], run.vectors[1], run.vectors[2]
    for i in range(3):
        turn[i] = 0.5 * run.x[ATTITUDE + i]
        error[i] = c[ACCEL + i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        d[i] = turn[j] * c[ATTITUDE + k] - turn[k] * c[ATTITUDE + j]
    for i in range(3):
        c[ATTITUDE + i] += d[i]
        rotated = A[i, 0] * error[0] + A[i, 1] * error[1] + A[i, 2] * error[2]
        c[ACCEL + i] = rotated + (g * run.C[0, i]) * d[1] - (g * run.C[1, i]) * d[0]


transform_by_reset = congruence(_apply_reset, ATTITUDE, STATES)


# The correction of the invariant filter.


def _correct_on_group(run: Runs) -> None:
    """Correct position and velocity by J dp and J dv, and add the estimated error to the accelerometer bias."""
    x, y, z = run.x[ATTITUDE], run.x[ATTITUDE + 1], run.x[ATTITUDE + 2]
    square = x * x + y * y + z * z
    fill_from_factors(run, each_run(_first_factor, square), each_run(_second_factor, square), x, y, z)
    d, J = run.vectors[0], run.rotation
    for part in range(0, 6, 3):
        for i in range(3):
            d[i] = run.x[part + i] - run.nominal[part + i]
        for i in range(3):
            run.shift[part + i] = J[i, 0] * d[0] + J[i, 1] * d[1] + J[i, 2] * d[2]
            run.x[part + i] = run.nominal[part + i] + run.shift[part + i]
    for i in range(3):
        run.accel_bias[i] += run.x[ACCEL + i]


def _first_factor(square: float) -> float:
    """Return the factor of [phi] in `jerkbench.inertial.state.left_jacobian` for the squared angle ``square``."""
    a = max(math.sqrt(square), MIN_ANGLE_RAD)
    half = math.sin(0.5 * a) / (0.5 * a)
    return 0.5 * half * half


def _second_factor(square: float) -> float:
    """Return the factor of [phi]^2 in `jerkbench.inertial.state.left_jacobian` for the squared angle ``square``."""
    a = max(math.sqrt(square), MIN_ANGLE_RAD)
    return (a - math.sin(a)) / (a * a * a)


def _apply_reset_on_group(c: FloatArray, run: Runs, _dt: float) -> None:
    """Apply the reset matrix G of `jerkbench.inertial.update.reset_on_group` to an error of the state."""
    for part in (POSITION, VELOCITY):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            c[part + i] -= run.shift[part + j] * c[ATTITUDE + k] - run.shift[part + k] * c[ATTITUDE + j]


transform_by_group_reset = congruence(_apply_reset_on_group, POSITION, ATTITUDE)
