"""The compiled navigation for a batch of eight runs. The reference implementation is `jerkbench.inertial.run`.

Functions of `jerkbench.kinematic` compute the innovation, the adaptation, the update and the error sums. The first six
components of the state x are the nominal position and velocity. The other components of x are the estimated error,
which is zero except between an update and the correction of the nominal state.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, FloatCube, FloatMatrix, FloatVector, IntVector
from jerkbench.compilation.compiled import Compilation, not_inlined
from jerkbench.compilation.vectors import in_lanes
from jerkbench.inertial.aiding import constrain, feed_back, from_measurement, to_measurement, update_heading
from jerkbench.inertial.strapdown import mechanise, propagate, sense
from jerkbench.kinematic.arguments import Called, Output, Rules, Runs, Scoring, Steps, loop_type, record_layout
from jerkbench.kinematic.correction import check_definite
from jerkbench.kinematic.loop import all_stopped
from jerkbench.kinematic.prediction import Axis
from jerkbench.kinematic.scoring import give, note_update
from jerkbench.kinematic.update import fill_innovation, update


@cache
def navigation_layout(s: int) -> np.dtype[Any]:
    """Return the `record_layout` of the compiled navigation with ``s`` error states."""
    shapes: dict[str, tuple[int, ...]] = {
        "C": (3, 3),  # attitude as the rotation from the body frame to ENU
        "gyro_bias": (3,),
        "accel_bias": (3,),
        "wheel_scale": (1,),  # scale error of the wheel speed, or 0 if this error is not estimated
        "rate": (3,),  # angular rate of the body, corrected by the gyro bias
        "force": (3,),  # specific force in the body frame, corrected by the accelerometer bias
        "rotation": (3, 3),  # rotation matrix of a time step or of a correction
        "C_next": (3, 3),  # buffer
        "C_before": (3, 3),  # attitude before the correction
        "C_change": (3, 3),  # rotation C+' C from the body frame before to the body frame after a correction
        "dt_C": (3, 3),  # product -dt C with the attitude C in the middle of a step
        "dt_force": (3,),  # product -dt a with the specific force a in ENU in the middle of a step
        "nominal": (6,),  # position and velocity before an update
        "shift": (6,),  # change of position and velocity by a correction on the group SE_2(3)
        "predicted": (6,),  # predicted measurement h
        "arm": (3,),  # lever arm C l of the measured position in ENU
        "dh_dv": (3, 3),  # dh_dx: derivative of the predicted velocity with respect to the error x
        "dv_dh": (3, 3),  # inverse of dh_dv
        "dh_dphi": (3, 3),
        "dh_dgyro": (3, 3),
        "dh_dscale": (1,),  # derivative of the predicted forward velocity; zero for the other two components
        "column": (s,),  # this array and all following arrays are buffers
        "half": (9, s),
        "vectors": (9, 3),
        "skew_arm": (3, 3),
        "C_skew_arm": (3, 3),
        "skew": (3, 3),
        "skew_body": (3, 3),
    }
    return record_layout(s // 3, s, tuple(shapes.items()))


class InertialBatch(NamedTuple):
    """The inputs and the settings of a batch of runs.

    Attributes:
        dt_s: (lengths,) the distinct step lengths [s].
        accel_mps2: (samples, 3, 8) accelerometer measurements [m/s2].
        gyro_radps: (samples, 3, 8) gyro measurements [rad/s].
        noise: (4, 8) power spectral densities of the noise of angle, velocity, gyro bias and accelerometer bias.
        earth: (4, 8) angular rate of the Earth in ENU [rad/s], and the inverse 1/R of the Earth radius [1/m].
        rotates: whether at least one run includes the Earth's rotation.
        arms: (4, 3, 8) lever arms of the measured position, of the measured velocity, of the non-holonomic constraint,
            and of the point whose position and velocity are returned.
        frame: (2, 8) two flags of the measured velocity. The first flag is 1 for the body frame and 0 for ENU. The
            second flag is 1 for a wheel speed, otherwise 0.
        limits: (3, 8) the fields still_below_mps, still_sigma_mps and sideways_sigma_mps of `run_inputs.Constraints`.
        measures_imu: whether, in all runs, the measurements are position and velocity of the IMU in ENU.
        returns_imu: whether all runs return position and velocity of the IMU and not of another point.
        invariant: whether corrections are applied on the group SE_2(3).
        heading: (n,) row of ``yaw`` that is used after each step, or -1 if no heading follows the step.
        yaw: (h, 2, 8) measured yaw and its standard deviation [rad]. The yaw is NaN for each run without a measurement.
        constraint: (n,) row of ``kind`` that is used after each step, or -1 if no constraint follows the step.
        kind: (c, 8) 2 if the IMU is stationary, 1 if the IMU is moving, or 0 if no constraint is applied.
        dcm: (k, 9, 8) buffer for the attitude at the time stamps of the reference. ``dcm`` has no rows if the attitude
            is not stored.
    """

    dt_s: FloatVector
    accel_mps2: FloatCube
    gyro_radps: FloatCube
    noise: FloatMatrix
    earth: FloatMatrix
    rotates: bool
    arms: FloatCube
    frame: FloatMatrix
    limits: FloatMatrix
    measures_imu: bool
    returns_imu: bool
    invariant: bool
    heading: IntVector
    yaw: FloatCube
    constraint: IntVector
    kind: FloatMatrix
    dcm: FloatCube


def run_navigation(
    _axis: Axis,
    steps: Steps,
    scored: Scoring,
    batch: InertialBatch,
    rules: Rules,
    adapt: Called,
    gain: Called,
    output: Output,
    state: Runs,
) -> None:
    """Process all time steps of eight runs. The loop ends early if all runs have stopped.

    The arguments are the same as in `jerkbench.kinematic.loop.run_steps`, with ``batch`` instead of ``model``.
    """
    run, dcm = in_lanes(state), in_lanes(batch.dcm)
    accel, gyro, arms = in_lanes(batch.accel_mps2), in_lanes(batch.gyro_radps), in_lanes(batch.arms)
    noise, earth = in_lanes(batch.noise), in_lanes(batch.earth)
    limits, frame = in_lanes(batch.limits), in_lanes(batch.frame)
    yaw, kind = in_lanes(batch.yaw), in_lanes(batch.kind)
    for k in range(len(steps.model)):
        which, heading, constraint = steps.update[k], batch.heading[k], batch.constraint[k]
        sense(run, accel[steps.sample[k]], gyro[steps.sample[k]])
        if steps.model[k] >= 0:
            mechanise(run, earth, batch.rotates, batch.dt_s[steps.model[k]])
            propagate(run, noise, batch.dt_s[steps.model[k]])
        if which >= 0:
            store_nominal(run)
            if not batch.measures_imu:
                to_measurement(run, arms[0], arms[1], frame)
            fill_innovation(run, steps.z, which)
            update(run, steps, rules, adapt, gain, which)
            note_update(run, scored.counts, output, which)
            if not batch.measures_imu:
                from_measurement(run)
            feed_back(run, batch.invariant)
        if heading >= 0:
            store_nominal(run)
            update_heading(run, yaw[heading, 0], yaw[heading, 1])
            feed_back(run, batch.invariant)
            check_definite(run, run.x, run.P)
        if constraint >= 0:
            store_nominal(run)
            constrain(run, kind[constraint], limits, arms[2])
            feed_back(run, batch.invariant)
            check_definite(run, run.x, run.P)
        if (which >= 0 or heading >= 0 or constraint >= 0) and all_stopped(run, k):
            return
        reference = steps.reference[k]
        if reference >= 0:
            if batch.returns_imu:
                give(run, run.P, scored, output, reference)
            else:
                _give_point(run, arms[3], scored, output, reference)
            if len(batch.dcm) > 0:
                for e in range(9):
                    dcm[reference, e] = run.C[e // 3, e % 3]


def store_nominal(run: Runs) -> None:
    """Store the nominal position and velocity before a correction."""
    for s in range(6):
        run.nominal[s] = run.x[s]


@not_inlined
def _give_point(run: Runs, arm: FloatArray, scored: Scoring, output: Output, reference: int) -> None:
    """Transform the state and P to the point at the lever arm ``arm``, store and score them, and restore them."""
    frame, saved, s = run.vectors[6], run.gain, len(run.x)
    frame[0] = frame[1] = 0.0 * run.x[0]
    store_nominal(run)
    for a in range(6):
        for b in range(s):
            saved[a, b] = run.P[a, b]
    to_measurement(run, arm, arm, frame)
    give(run, run.P, scored, output, reference)
    for a in range(6):
        run.x[a] = run.nominal[a]
        for b in range(s):
            run.P[a, b] = run.P[b, a] = saved[a, b]


@cache
def navigation_for(states: int) -> Compilation:
    """Return the compiled navigation loop for a filter with ``states`` error states."""
    signature = loop_type(navigation_layout(states), InertialBatch)
    return Compilation(run_navigation, "the inertial navigation", signature, contract=True)
