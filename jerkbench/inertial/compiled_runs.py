"""Python functions that run the compiled navigation for one run with its trajectory, or for a batch of runs."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, IntArray
from jerkbench.contracts import Adaptation, clocked
from jerkbench.estimate import ErrorWeights, Streamed
from jerkbench.geometry import euler_from_rotations
from jerkbench.inertial.kernel import InertialBatch, navigation_for, navigation_layout
from jerkbench.inertial.run import InertialSolution
from jerkbench.inertial.run_inputs import InertialInputs, InertialSettings
from jerkbench.inertial.state import NavigationState
from jerkbench.kinematic.packs import Pack, numbered, stack_runs
from jerkbench.kinematic.rules import compiled_rule
from jerkbench.kinematic.runs import Prepared, run_packs, run_trajectory
from jerkbench.recording import Imu
from jerkbench.timeline import Run, Timeline

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
