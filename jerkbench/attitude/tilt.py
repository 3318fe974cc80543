"""The attitude plugin ``tilt``: a tilt filter, followed by a yaw filter and the gravity compensation."""

import math
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
from jerkbench.errors import PluginError
from jerkbench.parameters import ABOVE_ZERO, NOT_NEGATIVE, Limit
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Recording

PROPAGATIONS = ("first_order", "exact")


@register("attitude", "tilt")
@dataclass(frozen=True)
class Tilt(TiltAndYaw):
    """Tilt from gyro and accelerometer, adaptive to external acceleration; yaw from headings, course or track.

    The tilt filter processes every IMU sample. The state of the tilt filter is x = Omega^T e3, the direction of the
    vertical in the body frame (g = 9.81 m/s2)::

        Phi = I - dt skew(y_G)   (exact: exp(-dt skew(y_G)))
        Q = -dt^2 sigma_G^2 skew(x+)^2;  x- = Phi x+;  P- = Phi P+ Phi' + Q
        z = y_A - c_a a_prev;  e = z - g x-;  C0 = g^2 P- + sigma_A^2 I
        triggered = e'e >= tr(C0)
        none:   Sigma = 0
        mtf:    Sigma = diag(max(0, w_i - C0_ii)) if triggered,  w_i = mean of e_i^2 over the last mu samples
        scalar: Sigma = I (e'e - tr C0)/3 if triggered
        lee:    Sigma = I c_a^2 |a_prev|^2/3, always
        M = sigma_A^2 I + Sigma;  K = g P- (g^2 P- + M)^-1;  x = x- + K e
        P = (I - gK) P- (I - gK)' + K M K', symmetrised;  x /= |x|;  a_prev = y_A - g x
        roll = atan2(x2, x3);  pitch = atan2(-x1, hypot(x2, x3))

    The initial a_prev is 0. The initial P is 1e-3 I at rest or with the alignment ``track``, and 0.03 I otherwise.

    The yaw filter has the yaw as its only state and uses headings or courses as measurements::

        yaw += dt (w_y sin(roll) + w_z cos(roll))/cos(pitch);  P += dt walk^2;  P0 = variance of the first heading
        course: atan2(v_n, v_e), sigma = max(sigma_v/speed, minimum), sigma_v across the course

    The yaw at sample k depends only on headings up to the time of sample k. Before the first heading, the yaw is the
    first heading minus the yaw rate integrated from the sample to the first heading. If the recording has neither
    headings nor velocities in ENU, the track of the fixes determines the yaw and the gyro bias::

        chord: vector between two fixes, as short as its sigma allows (0.05 rad); chords do not overlap
        offset of yaw from psi, the integrated gyro = arg(chord) - arg(int e^{i psi} dt) half a chord before its end
        two states, offset and its rate;  F = [[1, dt], [0, 1]],  H = [1, -half the duration of the chord]

    Without a usable chord, or with ``yaw_source`` gyro_only, the yaw starts at 0 (east). The yaw rate is singular at a
    pitch of 90 degrees. The yaw from courses and tracks is correct only if the vehicle drives forwards.

    The input of the navigation filter is u_k = mean(Omega_{k-1}, Omega_k) y_A + (0, 0, -g) with the compensation
    midpoint, and u_k = Omega_k y_A + (0, 0, -g) with endpoint.

    Source: J. K. Lee, E. J. Park, S. N. Robinovitch, "Estimation of attitude and external acceleration using inertial
    sensor measurement during various dynamic conditions", IEEE Trans. Instrum. Meas. 61(8), 2262-2273, 2012,
    doi:10.1109/TIM.2012.2187245, for the state, Q and ``lee``; multiple tuning factors for ``mtf``.

    Attributes:
        adapt: method that estimates Sigma, the variance of the external acceleration: none, mtf, scalar or lee.
        sigma_gyro_radps: sigma_G, standard deviation of a gyro sample [rad/s].
        sigma_accel_mps2: sigma_A, standard deviation of an accelerometer sample; if null, the value is 2.0 with
            adapt=none and 0.02 with the other methods [m/s2].
        external_memory: c_a, fraction of the external acceleration that persists until the next sample, from 0 to 1
            [-]. With c_a = 1, the absolute tilt is not observable. The method lee needs c_a > 0.
        window: mu, number of samples that mtf averages, including the current sample [samples].
        normalise: if true, x is normalised to length 1 after each update.
        propagation: transition matrix Phi: first_order, or exact for fast rotations.
        initial_tilt_variance: diagonal of the initial P; if null, 1e-3 at rest or with the alignment ``track``, and
            0.03 otherwise [-].
    """

    name: ClassVar[str] = "tilt"

    adapt: str = "mtf"
    sigma_gyro_radps: Annotated[float, NOT_NEGATIVE] = 0.0017
    sigma_accel_mps2: Annotated[float | None, ABOVE_ZERO] = None
    external_memory: Annotated[float, Limit(lambda memory: 0 <= memory <= 1, "it must be from 0 to 1.")] = 0.0
    window: Annotated[int, Limit(lambda samples: samples >= 1, "it must be at least 1.")] = 1
    normalise: bool = True
    propagation: str = "first_order"
    initial_tilt_variance: Annotated[float | None, ABOVE_ZERO] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_choices({"adapt": ADAPTATIONS, "propagation": PROPAGATIONS})
        if self.adapt == "lee" and self.external_memory == 0:
            raise PluginError(
                "attitude tilt: adapt=lee has no effect with external_memory=0; increase external_memory."
            )

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3) after each sample, and a mask (n,) of external accelerations."""
        state = self.state(tilt_start(recording, self.initial_tilt_variance, self.alignment))
        return run_samples(run_tilt, "the tilt filter", recording.inertial, (state,), detects=True)

    def state(self, start: TiltStart) -> "TiltState":
        """Return the initial state of the filter loop, with the initial tilt ``start``."""
        sigma_mps2 = (2.0 if self.adapt == "none" else 0.02) if self.sigma_accel_mps2 is None else self.sigma_accel_mps2
        sigmas = float(self.sigma_gyro_radps), float(sigma_mps2)
        arrays = start.x.copy(), start.variance * np.eye(3), np.zeros((3, 3)), np.zeros((3, 3))
        update = gravity_update(3, self.window, self.external_memory, self.adapt)
        return TiltState(*arrays, *sigmas, bool(self.normalise), self.propagation == "exact", update)


class TiltState(NamedTuple):
    """State, buffers and parameters of the filter loop.

    Attributes:
        x: (3,) Omega^T e3, the direction of the vertical in the body frame.
        P: (3, 3) covariance of x.
        Phi: (3, 3) buffer for the transition matrix.
        half: (3, 3) buffer for Phi P.
        sigma_gyro_radps: sigma_G, standard deviation of a gyro sample [rad/s].
        sigma_accel_mps2: sigma_A, standard deviation of an accelerometer sample [m/s2].
        normalise: if true, x is normalised to length 1 after each update.
        exact: if true, Phi is the exact rotation, otherwise its first-order approximation.
        gravity: state and buffers of the accelerometer update.
    """

    x: FloatVector
    P: FloatMatrix
    Phi: FloatMatrix
    half: FloatMatrix
    sigma_gyro_radps: float
    sigma_accel_mps2: float
    normalise: bool
    exact: bool
    gravity: GravityUpdate


update_tilt = updating(3)


def run_tilt(
    state: TiltState, gyro: FloatMatrix, accel: FloatMatrix, dt: FloatVector, x: FloatMatrix, triggered: BoolVector
) -> None:
    """Process all samples: write the verticals to ``x`` and the detections to ``triggered``, and update ``state``."""
    noise = state.sigma_accel_mps2**2
    for k in range(len(dt)):
        _predict(state, gyro[k], dt[k])
        excess = see_gravity(state.gravity, state.P, state.x, accel[k], k, noise)
        fill_noise(state.gravity, k, excess, noise, 1.0)
        update_tilt(state.gravity, state.P)
        triggered[k] = excess >= 0.0
        length = 1.0
        for i in range(3):
            state.x[i] += state.gravity.dx[i]
        if state.normalise:
            length = math.sqrt(state.x[0] ** 2 + state.x[1] ** 2 + state.x[2] ** 2)
        for i in range(3):
            state.x[i] /= length
            state.gravity.a_prev[i] = accel[k, i] - GRAVITY_MPS2 * state.x[i]
            x[k, i] = state.x[i]


def _predict(state: TiltState, gyro: FloatVector, dt: float) -> None:
    """Predict the covariance P = Phi P Phi' + (dt sigma_G)^2 (x'x I - x x') and the state x = Phi x."""
    Phi, x, P, half = state.Phi, state.x, state.P, state.half
    fill_rotation(Phi, gyro, -dt, state.exact)
    for i in range(3):
        for j in range(3):
            half[i, j] = Phi[i, 0] * P[0, j] + Phi[i, 1] * P[1, j] + Phi[i, 2] * P[2, j]
    a, b, c = x[0], x[1], x[2]
    variance = (dt * state.sigma_gyro_radps) ** 2
    for i in range(3):
        for j in range(3):
            across = (a * a + b * b + c * c if i == j else 0.0) - x[i] * x[j]
            P[i, j] = half[i, 0] * Phi[j, 0] + half[i, 1] * Phi[j, 1] + half[i, 2] * Phi[j, 2] + variance * across
    for i in range(3):
        x[i] = Phi[i, 0] * a + Phi[i, 1] * b + Phi[i, 2] * c
