"""The inputs of an inertial navigation run: events, constraints, settings, and the initial state."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler, roll_pitch
from jerkbench.inertial.state import BA, BG, PHI, STATES, WHEEL_SCALE, Earth, NavigationState, SensorNoise, V, skew
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Recording
from jerkbench.timeline import Timeline, merged_times, nanoseconds


class Events(NamedTuple):
    """The time steps of one run: a prediction over dt_s, followed by the updates at the end of the step.

    Attributes:
        t_s: (n,) time at the end of each step [s].
        dt_s: (n,) length of each step [s]; the first length is 0.
        sample: (n,) index of the IMU sample of each step.
        update: (n,) row of the measurements that are used after each step, or -1 if no update follows the step.
        heading: (n,) row of the heading that is used after each step, or -1 if no heading follows the step.
        constrained: (n,) whether the motion constraints are applied after each step.
        reference: (n,) row of the reference at the end of each step, or -1 if the reference has no time stamp there.
    """

    t_s: FloatArray
    dt_s: FloatArray
    sample: IntArray
    update: IntArray
    heading: IntArray
    constrained: BoolArray
    reference: IntArray


def merge_events(
    t_s: FloatArray,
    updates: IntArray,
    references: IntArray,
    imu: Imu,
    headings: Heading | None,
    constraint_interval_s: float,
) -> Events:
    """Return the time steps of a timeline, which are split at the times of ``headings``.

    Args:
        t_s: (n,) time at the end of each step of the timeline [s].
        updates: (n,) row of the measurements that are used after each step, or -1 if no update follows the step.
        references: (n,) row of the reference at the end of each step, or -1 if the reference has no time stamp there.
        imu: samples of the IMU.
        headings: measured headings, or None if the filter uses no headings. Headings before the first step or after the
            last step are ignored.
        constraint_interval_s: time between two applications of the motion constraints [s]. The constraints are applied
            after the first step that ends in each interval of this length.
    """
    step_ns = nanoseconds(t_s)
    heading_ns = nanoseconds(headings.t_s if headings is not None else np.empty(0))
    heading_ns = heading_ns[(heading_ns >= step_ns[0]) & (heading_ns <= step_ns[-1])]
    t_ns = merged_times(step_ns, heading_ns) if len(heading_ns) else step_ns
    at = np.searchsorted(t_ns, step_ns)
    update, reference, heading = np.full((3, len(t_ns)), -1, dtype=np.int64)
    update[at], reference[at] = updates, references
    if headings is not None:
        rows = np.flatnonzero(np.isin(nanoseconds(headings.t_s), heading_ns))
        heading[np.searchsorted(t_ns, heading_ns)] = rows
    intervals = t_ns // max(round(constraint_interval_s * 1e9), 1)
    return Events(
        t_s=np.asarray(t_ns * 1e-9),
        dt_s=np.diff(t_ns, prepend=t_ns[0]) * 1e-9,
        sample=np.searchsorted(nanoseconds(imu.t_s), t_ns).astype(np.int64),
        update=update,
        heading=heading,
        constrained=np.diff(intervals, prepend=intervals[0]) > 0,
        reference=reference,
    )


# Detection of a stationary vehicle from the IMU data.


def still_samples(imu: Imu, window_s: float, accel_mps2: float, gyro_radps: float) -> BoolArray:
    """Return for each sample (n,) whether the IMU was stationary in the last ``window_s`` seconds.

    The IMU is regarded as stationary if the standard deviation of the specific force over the window is below
    ``accel_mps2``, and the standard deviation of the angular rate is below ``gyro_radps``. Each standard deviation is
    the root of the sum of the variances of the three axes. Constant parts of the measurements, such as gravity and
    biases, do not change the standard deviations. The IMU also appears stationary during steady motion on a smooth
    road, so the caller must also check the estimated speed. The result is False before the end of the first window.
    """
    samples = max(round(window_s / imu.nominal_interval_s), 2)
    still = _running_deviation(imu.accel_mps2, samples) < accel_mps2
    return np.asarray(still & (_running_deviation(imu.gyro_radps, samples) < gyro_radps))


def _running_deviation(values: FloatArray, samples: int) -> FloatArray:
    """Return the root (n,) of the sum of the variances of all columns, over the last ``samples`` rows.

    The result is infinite before the end of the first window.
    """
    centred = values - values.mean(axis=0)  # this reduces the cancellation in the running sums
    deviation = np.full(len(values), np.inf)
    if len(values) >= samples:
        sums = np.pad(np.cumsum([centred, centred**2], axis=1), ((0, 0), (1, 0), (0, 0)))
        mean, square = (sums[:, samples:] - sums[:, :-samples]) / samples
        deviation[samples - 1 :] = np.sqrt(np.maximum(square - mean**2, 0.0).sum(axis=1))
    return deviation


# Settings and inputs of an inertial run.


class Constraints(NamedTuple):
    """Settings of the motion constraints: zero-velocity updates, and the non-holonomic constraint.

    Attributes:
        still: (n,) whether the IMU is stationary at each sample. All elements are False if zero-velocity updates are
            disabled.
        still_below_mps: estimated speed below which zero-velocity updates are applied [m/s].
        still_sigma_mps: standard deviation of each axis of a zero-velocity update [m/s].
        sideways_sigma_mps: standard deviation of the lateral and vertical velocity of the non-holonomic constraint, or
            0 if this constraint is disabled [m/s].
        sideways_point_m: (3,) lever arm from the IMU to the wheel, at which the non-holonomic constraint applies, in
            the body frame [m].
    """

    still: BoolArray
    still_below_mps: float
    still_sigma_mps: float
    sideways_sigma_mps: float
    sideways_point_m: FloatArray


class InertialSettings(NamedTuple):
    """The settings of a run of an inertial filter.

    Attributes:
        noise: power spectral densities of the process noise.
        earth: parameters of gravity and of the Earth's rotation.
        antenna_m: (3,) lever arm from the IMU to the GNSS antenna, in the body frame [m].
        reference_point_m: (3,) lever arm from the IMU to the point whose position and velocity are returned, in the
            body frame [m].
        velocity_frame: frame of the measured velocity. The value "enu" means the velocity of the antenna in ENU, "body"
            means the velocity of the IMU in the body frame, and "speed" means the velocity of the wheel in the body
            frame.
        constraints: settings of the motion constraints.
        invariant: whether corrections are applied on the group SE_2(3) (invariant filter).
    """

    noise: SensorNoise
    earth: Earth
    antenna_m: FloatArray
    reference_point_m: FloatArray
    velocity_frame: str
    constraints: Constraints
    invariant: bool = False


class InertialInputs(NamedTuple):
    """The inputs of a run of an inertial filter, except the adaptation.

    Attributes:
        imu: samples of the IMU.
        timeline: timeline with the measurements of position and velocity.
        headings: measured headings, or None if the filter uses no headings.
        events: time steps and the events at the end of each step.
        start: initial nominal state and covariance (n, n) of its error.
        settings: settings of the filter.
    """

    imu: Imu
    timeline: Timeline
    headings: Heading | None
    events: Events
    start: tuple[NavigationState, FloatArray]
    settings: InertialSettings

    @property
    def is_constrained(self) -> BoolArray:
        """Mask (n,) of the time steps after which a motion constraint is applied."""
        limits = self.settings.constraints
        is_any = limits.still[self.events.sample] | (limits.sideways_sigma_mps > 0)
        return np.asarray(self.events.constrained & is_any)


# The initial state. At rest, the initial roll and pitch are computed by levelling, otherwise by the attitude filter.


LEVELLING_S = 1.0
"""Duration of the data that levelling uses, and minimum time at rest for levelling [s]."""

MOVING_TILT_RAD = 0.17
"""Standard deviation of roll and pitch at a start in motion [rad]. The tilt filter has the same variance, 0.03 rad2."""


class StartSigmas(NamedTuple):
    """Standard deviations of the components of the initial state.

    Attributes:
        gyro_bias_radps: standard deviation of the gyro bias on each axis [rad/s].
        accel_bias_mps2: standard deviation of the accelerometer bias on each axis [m/s2].
        yaw_rad: standard deviation of the yaw [rad].
        still_mps: standard deviation of the velocity on each axis, if the vehicle is at rest [m/s].
        wheel_scale: standard deviation of the scale error of the wheel, or 0 if this error is not estimated [-].
    """

    gyro_bias_radps: float
    accel_bias_mps2: float
    yaw_rad: float
    still_mps: float
    wheel_scale: float = 0.0


def align(
    recording: Recording,
    attitude: Attitude,
    timeline: Timeline,
    yaw_rad: float,
    sigmas: StartSigmas,
    noise: SensorNoise,
    *,
    gyro_bias_from_rest: bool,
) -> tuple[NavigationState, FloatArray]:
    """Return the nominal state at the start of the timeline, and the covariance (n, n) of its error.

    The initial position is the initial position of the timeline. If the vehicle is at rest, roll and pitch are computed
    from the mean specific force of the first second, and the velocity is 0. With ``gyro_bias_from_rest``, the initial
    gyro bias is the mean of the gyro during the time T at rest. This gyro bias includes the rotation rate of the Earth
    and has the variance q_g/T. If the vehicle moves at the start, the initial roll and pitch are the roll and pitch of
    ``attitude``, and the initial velocity is the initial velocity of the timeline.
    """
    variances = np.zeros(STATES + int(sigmas.wheel_scale > 0.0))
    variances[BG], variances[BA] = sigmas.gyro_bias_radps**2, sigmas.accel_bias_mps2**2
    variances[WHEEL_SCALE:] = sigmas.wheel_scale * sigmas.wheel_scale
    P = np.diag(variances)
    P[:6, :6] = timeline.P0
    roll, pitch, _ = attitude.euler_rad[timeline.sample[0]]
    v, bg, rest_s = timeline.x0[3:], np.zeros(3), recording.static_start_s
    if at_rest := rest_s >= LEVELLING_S and timeline.t_s[0] < rest_s:
        roll, pitch = roll_pitch(recording.apparent_vertical(LEVELLING_S))
        v, P[V, :6], P[:6, V] = np.zeros(3), 0.0, 0.0
        P[V, V] = sigmas.still_mps**2 * np.eye(3)
        if gyro_bias_from_rest:
            imu = recording.inertial
            bg = imu.gyro_radps[imu.t_s < imu.t_s[0] + rest_s].mean(axis=0)
            P[BG, BG] = noise.angle / rest_s * np.eye(3)
    C = dcm_from_euler(np.array([roll, pitch, yaw_rad]))
    tilt_rad = np.sqrt(noise.velocity / LEVELLING_S) / GRAVITY_MPS2 if at_rest else MOVING_TILT_RAD
    P[PHI, PHI] = np.diag([tilt_rad**2, tilt_rad**2, sigmas.yaw_rad**2])
    if at_rest:
        _correlate_tilt(P, C)
    scale = 0.0 if sigmas.wheel_scale > 0.0 else None
    return NavigationState(timeline.x0[:3], v, C, bg, np.zeros(3), scale), P


def with_body_velocity(state: NavigationState, P: FloatArray, dcm: FloatArray) -> tuple[NavigationState, FloatArray]:
    """Return the initial state and covariance for a velocity that was measured in the body frame.

    The velocity of ``state`` was rotated into ENU with the attitude ``dcm`` (3, 3). This function replaces ``dcm`` by
    the attitude C of ``state``, so the velocity error depends on the attitude error::

        v = Exp(phi) C dcm' v_enu,    dv = -[v] phi
    """
    rotation = state.dcm @ dcm.T
    v = rotation @ state.velocity_mps
    P = P.copy()
    P[V, V] = rotation @ P[V, V] @ rotation.T
    T = np.eye(len(P))
    T[V, PHI] = -skew(v)
    return state._replace(velocity_mps=v), T @ P @ T.T


def _correlate_tilt(P: FloatArray, C: FloatArray) -> None:
    """Add to P, in place, the tilt error that an accelerometer bias causes in levelling.

    At rest, 0 = -[g e3] phi - C db_a, which determines the tilt error phi for a given bias error db_a::

        phi = J db_a,    J = [[0, -1, 0], [1, 0, 0], [0, 0, 0]] C/g
    """
    J = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) @ C / GRAVITY_MPS2
    P[PHI, BA] = J @ P[BA, BA]
    P[BA, PHI] = P[PHI, BA].T
    P[PHI, PHI] += J @ P[BA, BA] @ J.T
