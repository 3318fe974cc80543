"""The start of inertial navigation: levelled at rest, or on the attitude filter's first tilt when it moves."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler, roll_pitch
from jerkbench.inertial.mechanisation import SensorNoise, by_column
from jerkbench.inertial.state import BA, BG, LAYOUTS, MA, MG, PHI, Deformation, ErrorLayout, NavigationState, V
from jerkbench.recording import GRAVITY_MPS2, Recording
from jerkbench.timeline import Timeline

LEVELLING_S = 1.0
"""How much rest the levelling takes, and needs."""

MOVING_TILT_RAD = 0.17
"""One sigma of roll and pitch when it moves from the start; the variance is .03 as in the tilt filter."""


class StartSigmas(NamedTuple):
    """One sigma of what is not known at the start.

    Attributes:
        gyro_bias_radps: of each axis.
        accel_bias_mps2: of each axis.
        yaw_rad: of the yaw that is given.
        still_mps: of the velocity at rest, each axis.
        gyro_scale: of a scale factor of the gyro; 0: it has none.
        accel_scale: of a scale factor of the accelerometer.
        misalignment_rad: of each axis towards each other, in both.
        wheel_scale: of the wheel's scale; 0: it has none.
    """

    gyro_bias_radps: float
    accel_bias_mps2: float
    yaw_rad: float
    still_mps: float
    gyro_scale: float = 0.0
    accel_scale: float = 0.0
    misalignment_rad: float = 0.0
    wheel_scale: float = 0.0

    @property
    def deformed(self) -> bool:
        """Whether the sensors have scale factors and misalignments."""
        return self.gyro_scale > 0.0


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
    """Return the nominal state at the timeline's start, and the covariance (n, n) of its error.

    At rest: roll and pitch from the mean specific force of the first second, v = 0, and on request the gyro's mean
    over the rest as its bias, with the variance q_g/T. Moving: roll and pitch of ``attitude`` at the start, v from
    the timeline. p is the first fix.
    """
    P = _of_sensors(sigmas)
    P[:6, :6] = timeline.P0
    roll, pitch, _ = attitude.euler_rad[timeline.sample[0]]
    v, bg, resting = timeline.x0[3:], np.zeros(3), _is_resting(recording, timeline)
    if resting:
        roll, pitch = roll_pitch(recording.apparent_vertical(LEVELLING_S))
        v, P[3:6, :6], P[:6, 3:6] = np.zeros(3), 0.0, 0.0
        P[3:6, 3:6] = sigmas.still_mps**2 * np.eye(3)
        if gyro_bias_from_rest:
            bg = _mean_rate(recording)
            P[BG, BG] = noise.angle / recording.static_start_s * np.eye(3)
    C = dcm_from_euler(np.array([roll, pitch, yaw_rad]))
    level = np.sqrt(noise.velocity / LEVELLING_S) / GRAVITY_MPS2 if resting else MOVING_TILT_RAD
    P[PHI, PHI] = np.diag([level**2, level**2, sigmas.yaw_rad**2])
    if resting:
        _couple_tilt(P, C)
    deformation = Deformation(np.zeros((3, 3)), np.zeros((3, 3))) if sigmas.deformed else None
    return NavigationState(timeline.x0[:3], v, C, bg, np.zeros(3), deformation), P


def with_body_velocity(state: NavigationState, P: FloatArray, dcm: FloatArray) -> tuple[NavigationState, FloatArray]:
    """Return the start with a velocity that was measured along the body and turned into ENU with ``dcm`` (3, 3).

    It turns with the attitude C of ``state``, and so with its error: v = Exp(phi) C C_given' v_given, dv = -[v] phi.
    """
    turn = state.dcm @ dcm.T
    v = turn @ state.velocity_mps
    P = P.copy()
    P[V, V] = turn @ P[V, V] @ turn.T
    T = np.eye(len(P))
    T[V, PHI] = np.array([[0.0, v[2], -v[1]], [-v[2], 0.0, v[0]], [v[1], -v[0], 0.0]])
    return state._replace(velocity_mps=v), T @ P @ T.T


def _of_sensors(sigmas: StartSigmas) -> FloatArray:
    """The covariance (n, n) of what is not known of the sensors, the rest zero."""
    states = ErrorLayout(deformed=sigmas.deformed, wheeled=sigmas.wheel_scale > 0.0).size
    variances = np.zeros(states)
    variances[BG], variances[BA] = sigmas.gyro_bias_radps**2, sigmas.accel_bias_mps2**2
    if sigmas.deformed:
        for at, scale in ((MG, sigmas.gyro_scale), (MA, sigmas.accel_scale)):
            variances[at] = np.where(np.eye(3), scale, sigmas.misalignment_rad).ravel() ** 2
    if sigmas.wheel_scale > 0.0:
        variances[-1] = sigmas.wheel_scale**2
    return np.diag(variances)


def _is_resting(recording: Recording, timeline: Timeline) -> bool:
    return recording.static_start_s >= LEVELLING_S and timeline.t_s[0] < recording.static_start_s


def _mean_rate(recording: Recording) -> FloatArray:
    """The gyro's mean over the rest; the Earth's rate goes with it."""
    imu = recording.inertial
    return np.asarray(imu.gyro_radps[imu.t_s < imu.t_s[0] + recording.static_start_s].mean(axis=0))


def _couple_tilt(P: FloatArray, C: FloatArray) -> None:
    """Put the tilt that errors of the accelerometer make of levelling into P, in place.

    At rest 0 = -[g e3] phi - C (db_a + dM_a f), so that phi = J (db_a + dM_a f) with f = g C' e3 and
    J = [[0, -1, 0], [1, 0, 0], [0, 0, 0]] C/g.
    """
    J = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) @ C / GRAVITY_MPS2
    of_errors = [(BA, J)]
    if LAYOUTS[len(P)].deformed:
        of_errors.append((MA, by_column(J, GRAVITY_MPS2 * C[2])))
    for at, block in of_errors:
        P[PHI, at] = block @ P[at, at]
        P[at, PHI] = P[PHI, at].T
        P[PHI, PHI] += block @ P[at, at] @ block.T
