"""The attitude plugin ``mekf``, a multiplicative extended Kalman filter with the gyro bias."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import BoolVector, FloatMatrix, FloatVector
from jerkbench.attitude.common import (
    ADAPTATIONS,
    GravityUpdate,
    TiltAndYaw,
    TiltStart,
    Verticals,
    fill_noise,
    fill_rotation,
    gravity_update,
    run_samples,
    see_gravity,
    tilt_start,
    updating,
)
from jerkbench.geometry import dcm_from_euler, roll_pitch
from jerkbench.parameters import ABOVE_ZERO, NOT_NEGATIVE, SWITCH, DefaultOrigin, Limit, Range
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Recording

MEMS_HAND = DefaultOrigin("ours: a consumer MEMS IMU in a hand")


GYRO_DENSITY_RANGE = Range(1e-4, 1e-2, log=True, source="ours: from a tactical gyro to one with errors due to motion")
WINDOW_S_RANGE = Range(0.01, 3.0, log=True, source="ours: from one sample at 100 Hz to a turn of a car")
EXTERNAL_MEMORY_RANGE = Range(0.05, 0.95, source="ours: from hardly any memory to a hardly observable tilt")
BIAS_DENSITY_RANGE = Range(1e-6, 1e-3, log=True, source="ours: from a constant bias to one that follows the motion")


ACCEL_DENSITY_RANGE = Range(
    0.01, 30.0, log=True, source="ours: from smooth ground to hardly any weight of the accelerometer"
)
MEMORY_LIMIT = Limit(lambda memory: 0 < memory < 1, "it must be between 0 and 1.")
TURN_ON_BIAS = DefaultOrigin("data sheet: turn-on bias of a consumer MEMS gyro")


@register("attitude", "mekf")
@dataclass(frozen=True)
class Mekf(TiltAndYaw):
    """A multiplicative extended Kalman filter for the attitude (a rotation matrix with a vector error) and gyro bias.

    The nominal state consists of the rotation matrix Omega from the body frame to ENU and the gyro bias b. The error dx
    = (theta, db) is defined by Omega_true = Omega Exp(theta) and b_true = b + db. Each sample of length dt is processed
    with the following equations (g = 9.81 m/s2, x = Omega^T e3)::

        Omega = Omega Exp(dt (y_G - b));  F = [[Exp(-dt (y_G - b)), -dt I], [0, I]]
        P = F P F' + dt diag(N_G^2 I, N_b^2 I)
        e = y_A - c a_prev - g x;  H = [g [x], 0] ([x] is the cross product);  C0 = H P H' + N_A^2/dt I
        none:   Sigma = 0
        mtf:    Sigma = T/dt diag(max(0, w_i - C0_ii)) if e'e >= tr C0,  w_i = mean of e_i^2 over the window T
        scalar: Sigma = T/dt (e'e - tr C0)/3 I if e'e >= tr C0
        lee:    Sigma = T/dt c^2 |a_prev|^2/3 I
        M = N_A^2/dt I + Sigma;  K = P H' (H P H' + M)^-1;  dx = K e;  Omega = Omega Exp(theta);  b += db
        P = (I - K H) P;  a_prev = y_A - g x

    The factor c is c_a for ``lee`` and 0 for the other methods. M is diagonal, so the axes are processed sequentially.
    All noise parameters are densities and the window is a duration, so the parameters do not depend on the sampling
    rate. Sigma has the factor T/dt, because an external acceleration lasts for about T and the samples within T are
    therefore not independent. With T = dt, the equations are the same as in the sources for ``lee`` and ``mtf``.

    If ``bias`` is false, the gyro bias b is always 0. The yaw is computed in the same way as in the plugin `tilt`.

    Source: F. L. Markley, "Attitude error representations for Kalman filtering", Journal of Guidance, Control, and
    Dynamics 26(2), 2003, doi:10.2514/2.5048; ``lee``: J. K. Lee, E. J. Park, S. N. Robinovitch, "Estimation of attitude
    and external acceleration using inertial sensor measurement during various dynamic conditions", IEEE Trans. Instrum.
    Meas. 61(8), 2012, doi:10.1109/TIM.2012.2187245; ``mtf``: multiple tuning factors as in `tilt`.

    Attributes:
        adapt: method that estimates Sigma, the variance of the external acceleration: none, mtf, scalar or lee.
        gyro_density: N_G, noise density of the gyro [rad/s/sqrt(Hz)].
        accel_density: N_A, noise density of the accelerometer [m/s2/sqrt(Hz)].
        window_s: T, averaging window of mtf and assumed duration of an external acceleration, at least one sample [s].
        external_memory: c_a, fraction of the external acceleration that persists until the next sample (for lee) [-].
        bias: if true, the gyro bias is estimated.
        bias_density: N_b, density of the random walk of the gyro bias [rad/s2/sqrt(Hz)].
        initial_bias_radps: initial standard deviation of the gyro bias [rad/s].
    """

    name: ClassVar[str] = "mekf"

    adapt: str = "none"
    gyro_density: Annotated[float, NOT_NEGATIVE, GYRO_DENSITY_RANGE, MEMS_HAND] = 1e-3
    accel_density: Annotated[float, ABOVE_ZERO, ACCEL_DENSITY_RANGE, MEMS_HAND] = 0.1
    window_s: Annotated[float, ABOVE_ZERO, WINDOW_S_RANGE, MEMS_HAND] = 0.01
    external_memory: Annotated[float, MEMORY_LIMIT, EXTERNAL_MEMORY_RANGE, MEMS_HAND] = 0.3
    bias: Annotated[bool, SWITCH, DefaultOrigin("ours: MEMS gyros have one")] = True
    bias_density: Annotated[float, NOT_NEGATIVE, BIAS_DENSITY_RANGE, MEMS_HAND] = 1e-5
    initial_bias_radps: Annotated[float, NOT_NEGATIVE, TURN_ON_BIAS] = 0.005

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_choices({"adapt": ADAPTATIONS})

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3) after each sample, and a mask (n,) of external accelerations."""
        imu = recording.inertial
        state = self.state(tilt_start(recording, alignment=self.alignment), imu.nominal_interval_s)
        return run_samples(run_mekf, "the attitude filter mekf", imu, (state,), detects=True)

    def state(self, start: TiltStart, step_s: float) -> "MekfState":
        """Return the initial state of the filter loop for a sampling interval ``step_s`` [s]."""
        bias_variance, bias_density = (self.initial_bias_radps**2, self.bias_density) if self.bias else (0.0, 0.0)
        memory, window = self.external_memory if self.adapt == "lee" else 0.0, max(1, round(self.window_s / step_s))
        C = dcm_from_euler(np.array([*roll_pitch(start.x), 0.0]))
        P = np.diag([start.variance] * 3 + [bias_variance] * 3)
        buffers = np.zeros((3, 3)), np.zeros((3, 6)), np.zeros(3)
        powers = float(self.gyro_density**2), float(self.accel_density**2), float(bias_density**2)
        update = gravity_update(6, window, memory, self.adapt)
        return MekfState(C, np.zeros(3), P, *buffers, *powers, float(self.window_s), update)


class MekfState(NamedTuple):
    """State, buffers and parameters of the filter loop.

    Attributes:
        C: (3, 3) Omega, the rotation from the body to ENU.
        b: (3,) gyro bias [rad/s].
        P: (6, 6) covariance of the errors of Omega and b.
        turn: (3, 3) buffer for the rotation of one step.
        half: (3, 6) buffer for the upper three rows of F P.
        rate: (3,) buffer for the angular rate minus the gyro bias [rad/s].
        gyro_power: N_G^2, power density of the gyro noise.
        accel_power: N_A^2, power density of the accelerometer noise.
        bias_power: N_b^2, power density of the random walk of the gyro bias.
        window_s: T, averaging window of the adaptation [s].
        gravity: state and buffers of the accelerometer update.
    """

    C: FloatMatrix
    b: FloatVector
    P: FloatMatrix
    turn: FloatMatrix
    half: FloatMatrix
    rate: FloatVector
    gyro_power: float
    accel_power: float
    bias_power: float
    window_s: float
    gravity: GravityUpdate


update_mekf = updating(6)


def run_mekf(
    state: MekfState, gyro: FloatMatrix, accel: FloatMatrix, dt: FloatVector, x: FloatMatrix, triggered: BoolVector
) -> None:
    """Process all samples: write the verticals to ``x`` and the detections to ``triggered``, and update ``state``."""
    C, H, u, g = state.C, state.gravity.H, state.gravity, GRAVITY_MPS2
    for k in range(len(dt)):
        _predict(state, gyro[k], dt[k])
        for i, j, m in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):  # H = g [x], where x is the last row of Omega
            H[i, i], H[i, j], H[i, m] = 0.0, -g * C[2, m], g * C[2, j]
        noise = state.accel_power / dt[k]
        excess = see_gravity(u, state.P, C[2], accel[k], k, noise)
        fill_noise(u, k, excess, noise, max(1.0, state.window_s / dt[k]))
        update_mekf(u, state.P)
        triggered[k] = excess >= 0.0
        _turn(state, u.dx, 1.0)
        for i in range(3):
            state.b[i] += u.dx[3 + i]
            x[k, i] = C[2, i]
            u.a_prev[i] = accel[k, i] - g * x[k, i]


def _turn(state: MekfState, theta: FloatVector, scale: float) -> None:
    """Multiply Omega by the rotation Exp(scale theta), and store this rotation in ``state.turn``."""
    C, turn = state.C, state.turn
    fill_rotation(turn, theta, scale, exact=True)
    for i in range(3):
        a, b, c = C[i, 0], C[i, 1], C[i, 2]
        for j in range(3):
            C[i, j] = a * turn[0, j] + b * turn[1, j] + c * turn[2, j]


def _predict(state: MekfState, gyro: FloatVector, dt: float) -> None:
    """Rotate Omega by the bias-corrected gyro, and compute P = F P F' + Q by blocks."""
    P, A, half = state.P, state.turn, state.half
    for i in range(3):
        state.rate[i] = gyro[i] - state.b[i]
    _turn(state, state.rate, dt)
    for i in range(3):  # the upper rows of F P, where A' is Exp(-dt w)
        for j in range(6):
            half[i, j] = A[0, i] * P[0, j] + A[1, i] * P[1, j] + A[2, i] * P[2, j] - dt * P[i + 3, j]
    for i in range(3):
        for j in range(3):
            P[i, j] = half[i, 0] * A[0, j] + half[i, 1] * A[1, j] + half[i, 2] * A[2, j] - dt * half[i, j + 3]
            P[i, j + 3] = P[j + 3, i] = half[i, j + 3]
        P[i, i] += dt * state.gyro_power
        P[i + 3, i + 3] += dt * state.bias_power
