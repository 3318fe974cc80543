"""The compiled navigation for a batch of eight runs. The reference implementation is `jerkbench.inertial.run`.

Functions of `jerkbench.kinematic` compute the innovation, the adaptation, the update and the error sums. The first six
components of the state x are the nominal position and velocity. The other components of x are the estimated error,
which is zero except between an update and the correction of the nominal state.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, FloatCube, FloatMatrix, FloatVector, IntArray, IntVector
from jerkbench.compilation.compiled import Compilation, not_inlined
from jerkbench.compilation.vectors import in_lanes
from jerkbench.contracts import Adaptation, clocked
from jerkbench.estimate import ErrorWeights, Streamed
from jerkbench.geometry import euler_from_rotations
from jerkbench.inertial.aiding import constrain, feed_back, from_measurement, to_measurement, update_heading
from jerkbench.inertial.run import InertialSolution
from jerkbench.inertial.run_inputs import InertialInputs, InertialSettings
from jerkbench.inertial.state import NavigationState
from jerkbench.inertial.strapdown import mechanise, propagate, sense
from jerkbench.kinematic.arguments import Called, Output, Rules, Runs, Scoring, Steps, loop_type, record_layout
from jerkbench.kinematic.loop import all_stopped, give, note_update
from jerkbench.kinematic.rules import compiled_rule
from jerkbench.kinematic.runs import Pack, Prepared, numbered, run_packs, run_trajectory, stack_runs
from jerkbench.kinematic.update import check_definite, fill_innovation, update
from jerkbench.recording import Imu
from jerkbench.timeline import Run, Timeline


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


# Python functions that run the compiled navigation for one run with its trajectory, or for a batch of runs.


NO_ACCELERATION = np.empty((0, 3))
"""Empty input u of the kinematic filters, which the inertial navigation does not use."""


def solve_compiled(inputs: InertialInputs, adaptation: Adaptation) -> InertialSolution | None:
    """Run the compiled filter once and return the solution with its trajectory.

    Return None if numba cannot compile the adaptation, or if the adaptation raises an error.
    """
    rule = compiled_rule(clocked(adaptation, inputs.timeline))
    if rule is None:
        return None
    dcm = np.empty((np.count_nonzero(inputs.events.reference >= 0), 9, WIDE))
    estimate, record = run_trajectory(_timeline_of(inputs), rule, lambda pack: _prepared([inputs], pack, dcm))
    if estimate is None:
        return None
    euler_rad = euler_from_rotations(dcm[: len(estimate.index), :, 0].reshape(-1, 3, 3))
    x, C, gyro_bias, accel_bias, P = (
        record[name][..., 0].copy() for name in ("x", "C", "gyro_bias", "accel_bias", "P")
    )
    scale = None if inputs.start[0].wheel_scale is None else record["wheel_scale"][0, 0]
    state = NavigationState(x[:3], x[3:6], C, gyro_bias, accel_bias, scale)
    return InertialSolution(replace(estimate, euler_rad=euler_rad), state, P)


def run_many_inertial(
    all_inputs: Sequence[InertialInputs | None],
    scorings: Sequence[ErrorWeights],
    adaptations: Sequence[Adaptation],
    *,
    updates: bool,
    attitude: bool,
    threads: int,
) -> list[Streamed | None]:
    """Run inertial filters without storing trajectories. Runs with equal time steps are computed in one batch.

    Args:
        all_inputs: the inputs of each run, or None for each run that is skipped.
        scorings: the true values and error weights of each run.
        adaptations: the adaptation of each run.
        updates: whether the results contain the innovations.
        attitude: whether the results contain the attitude.
        threads: maximum number of batches that are processed at the same time.

    Returns:
        The error sums of each run. The result is None for a run that failed or diverged, that does not reach every
        scored time stamp of the reference, or whose adaptation numba cannot compile. The caller has to repeat each run
        with the result None and store its trajectory.
    """
    selected = [
        (k, inputs, rule)
        for k, inputs in enumerate(all_inputs)
        if inputs is not None and np.count_nonzero(inputs.events.reference >= 0) == len(scorings[k].truth)
        if (rule := compiled_rule(clocked(adaptations[k], inputs.timeline))) is not None
    ]
    attitudes: dict[int, FloatArray] = {}

    def prepare(pack: Pack) -> Prepared:
        dcm = np.empty((len(pack.scored.truth) * attitude, 9, WIDE))
        attitudes.update((k, dcm[:, :, lane]) for lane, k in enumerate(pack.members))
        return _prepared([inputs for _, inputs, _ in selected], pack, dcm)

    runs = [Run(_timeline_of(inputs), scorings[k]) for k, inputs, _ in selected]
    states = [len(inputs.start[1]) for _, inputs, _ in selected]
    kinds = [inputs.settings.invariant for _, inputs, _ in selected]
    rules = [rule for *_, rule in selected]
    sums = run_packs(runs, states, rules, prepare, kinds=kinds, updates=updates, threads=threads)
    results: list[Streamed | None] = [None] * len(all_inputs)
    for index, (result, (k, *_)) in enumerate(zip(sums, selected, strict=True)):
        euler_rad = euler_from_rotations(attitudes[index].reshape(-1, 3, 3)) if attitude else None
        results[k] = result and result._replace(euler_rad=euler_rad)
    return results


def _prepared(all_inputs: Sequence[InertialInputs], pack: Pack, dcm: FloatArray) -> Prepared:
    members = [all_inputs[k] for k in pack.lanes]
    s, initial = members[0].start[0].size, _initial([inputs.start for inputs in members])
    return navigation_for(s), navigation_layout(s), batch_of(members, pack.lengths_s, dcm), initial


def _timeline_of(inputs: InertialInputs) -> Timeline:
    """Return the timeline of a run in which the time steps are split at the times of the headings."""
    e = inputs.events
    timeline = replace(inputs.timeline, t_s=e.t_s, dt_s=e.dt_s, accel_enu_mps2=NO_ACCELERATION)
    return replace(timeline, sample=e.sample, update=e.update, reference=e.reference)


# Functions that compute the arguments of the compiled loop.


def batch_of(all_inputs: Sequence[InertialInputs], lengths_s: FloatArray, dcm: FloatArray) -> InertialBatch:
    """Return the inputs of a batch of runs, with the buffer ``dcm`` for the attitude."""
    settings = [inputs.settings for inputs in all_inputs]
    accel_mps2, gyro_radps = _imu_samples(tuple(inputs.imu for inputs in all_inputs))
    body = [float(s.velocity_frame != "enu") for s in settings]
    wheel = [float(s.velocity_frame == "speed") for s in settings]
    limits = [s.constraints for s in settings]
    return InertialBatch(
        np.array(lengths_s),
        accel_mps2,
        gyro_radps,
        stack_runs([np.array(s.noise) for s in settings]),
        stack_runs([np.append(s.earth.rate_radps * s.earth.rotates, s.earth.per_radius) for s in settings]),
        any(s.earth.rotates for s in settings),
        stack_runs([_arms(s) for s in settings]),
        np.array([body, wheel]),
        stack_runs([np.array([c.still_below_mps, c.still_sigma_mps, c.sideways_sigma_mps]) for c in limits]),
        not any(body) and not any(s.antenna_m.any() for s in settings),
        not any(s.reference_point_m.any() for s in settings),
        all_inputs[0].settings.invariant,
        *_headings(all_inputs),
        *_constraints(all_inputs),
        dcm,
    )


def _initial(starts: Sequence[tuple[NavigationState, FloatArray]]) -> dict[str, FloatArray]:
    """Return the initial values of the fields of `navigation_layout`."""
    return {
        "x": stack_runs([np.concatenate(state[:2]) for state, _ in starts]),
        "P": stack_runs([P for _, P in starts]),
        "C": stack_runs([state.dcm for state, _ in starts]),
        "gyro_bias": stack_runs([state.gyro_bias_radps for state, _ in starts]),
        "accel_bias": stack_runs([state.accel_bias_mps2 for state, _ in starts]),
        "wheel_scale": np.array([[state.wheel_scale or 0.0 for state, _ in starts]]),
    }


def _arms(s: InertialSettings) -> FloatArray:
    """Return the lever arms (4, 3) of a run in the order of `InertialBatch.arms`.

    A velocity that is measured in the body frame is the velocity of the IMU, so its lever arm is zero.
    """
    velocity_m = {"enu": s.antenna_m, "body": np.zeros(3), "speed": s.constraints.sideways_point_m}[s.velocity_frame]
    return np.array([s.antenna_m, velocity_m, s.constraints.sideways_point_m, s.reference_point_m])


@lru_cache(maxsize=8)  # runs with another adaptation reuse the samples; each entry needs about 6 MB
def _imu_samples(imus: tuple[Imu, ...]) -> tuple[FloatArray, FloatArray]:
    return stack_runs([imu.accel_mps2 for imu in imus]), stack_runs([imu.gyro_radps for imu in imus])


def _headings(all_inputs: Sequence[InertialInputs]) -> tuple[IntArray, FloatArray]:
    """Return ``heading`` and ``yaw`` of `InertialBatch`, with a standard deviation of 1 for a missing heading."""
    events = np.array([inputs.events.heading for inputs in all_inputs])
    steps = np.flatnonzero((events >= 0).any(axis=0))
    yaw = np.ones((len(steps), 2, len(all_inputs)))
    yaw[:, 0] = np.nan
    for lane, inputs in enumerate(all_inputs):
        which = events[lane, steps]
        if inputs.headings is not None:
            yaw[which >= 0, 0, lane] = inputs.headings.yaw_rad[which[which >= 0]]
            yaw[which >= 0, 1, lane] = inputs.headings.sigma_rad[which[which >= 0]]
    return numbered(events.shape[1], steps.tobytes()), yaw


def _constraints(all_inputs: Sequence[InertialInputs]) -> tuple[IntArray, FloatArray]:
    """Return the fields ``constraint`` and ``kind`` of `InertialBatch`."""
    still = [inputs.settings.constraints.still[inputs.events.sample] for inputs in all_inputs]
    kinds = np.array([x.is_constrained * (1.0 + is_still) for x, is_still in zip(all_inputs, still, strict=True)])
    steps = np.flatnonzero(kinds.any(axis=0))
    return numbered(kinds.shape[1], steps.tobytes()), np.ascontiguousarray(kinds[:, steps].T)
