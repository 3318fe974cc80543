"""The tilt filter: one step as a pure function, and the loop over a recording.

The state is x = Omega^T e3, the vertical of ENU seen from the body; at rest the accelerometer shows g x.
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.external_acceleration import Evidence, acceleration_variance
from jerkbench.recording import GRAVITY_MPS2

_I3 = np.eye(3)


class TiltParameters(NamedTuple):
    """What a step needs besides the data; the defaults are those of a field robot.

    Attributes:
        sigma_gyro_radps: noise of one gyro sample.
        sigma_accel_mps2: noise of one accelerometer sample.
        external_memory: c_a, the part of the external acceleration that is expected to last to the next sample.
        window: mu, over how many samples mtf takes the mean of e_i^2.
        normalise: whether x is brought back to length 1 after each update.
        exact: whether Phi is the rotation itself, or its first-order form.
        adapt: one of `external_acceleration.ADAPTATIONS`.
    """

    sigma_gyro_radps: float = 0.0017
    sigma_accel_mps2: float = 0.02
    external_memory: float = 0.0
    window: int = 1
    normalise: bool = True
    exact: bool = False
    adapt: str = "mtf"


class TiltState(NamedTuple):
    """What passes from one sample to the next.

    Attributes:
        x: (3,) Omega^T e3.
        P: (3, 3) its covariance.
        a_prev: (3,) external acceleration y_A - g x in the body frame [m/s2].
        squares: (up to mu - 1, 3) the latest e_i^2 [m2/s4], oldest first.
    """

    x: FloatArray
    P: FloatArray
    a_prev: FloatArray
    squares: FloatArray


class TiltStep(NamedTuple):
    """One step: the new state, and what the step saw on its way.

    Attributes:
        state: after the update.
        x_prior: (3,) x-.
        P_prior: (3, 3) P-.
        innovation: (3,) e [m/s2].
        triggered: e'e >= tr(C0).
        sigma_acc: (3,) diagonal of Sigma_acc [m2/s4].
    """

    state: TiltState
    x_prior: FloatArray
    P_prior: FloatArray
    innovation: FloatArray
    triggered: bool
    sigma_acc: FloatArray


def start_state(x: FloatArray, variance: float) -> TiltState:
    """Return the state before the first sample: x (3,), P = variance I, no external acceleration."""
    return TiltState(np.asarray(x, dtype=np.float64), variance * _I3, np.zeros(3), np.empty((0, 3)))


def transition(turn_rad: FloatArray, exact: bool) -> FloatArray:
    """Return Phi (3, 3) for a turn (3,) dt y_G: I - skew(turn), or exp(-skew(turn)) when ``exact`` (Rodrigues)."""
    a, b, c = turn_rad.tolist()
    if not exact:
        return np.array(((1.0, c, -b), (-c, 1.0, a), (b, -a, 1.0)))
    angle = math.sqrt(a * a + b * b + c * c)
    skew = np.array(((0.0, -c, b), (c, 0.0, -a), (-b, a, 0.0)))
    return np.asarray(_I3 - _sinc(angle) * skew + 0.5 * _sinc(angle / 2) ** 2 * skew.dot(skew))


def predict(state: TiltState, gyro_radps: FloatArray, dt_s: float, p: TiltParameters) -> tuple[FloatArray, FloatArray]:
    """Return x- (3,) and P- (3, 3).

    x- = Phi x+;  P- = Phi P+ Phi' + Q;  Q = -dt^2 sigma_G^2 skew(x+)^2 = (dt sigma_G)^2 (x'x I - x x').
    """
    Phi = transition(dt_s * gyro_radps, p.exact)
    Q = _minus_skew_squared(state.x, (dt_s * p.sigma_gyro_radps) ** 2)
    return Phi.dot(state.x), Phi.dot(state.P).dot(Phi.T) + Q


def correct(x: FloatArray, P: FloatArray, e: FloatArray, M: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x+ (3,) and P+ (3, 3) after the innovation e (3,) with the noise diag(M).

    K = g P- (g^2 P- + M)^-1;  x+ = x- + K e;  P+ = (I - gK) P- (I - gK)' + K M K', symmetrised.
    """
    HP = GRAVITY_MPS2 * P
    K = HP.dot(_inverse(GRAVITY_MPS2 * HP + M * _I3))
    A = _I3 - GRAVITY_MPS2 * K
    P = A.dot(P).dot(A.T) + (K * M).dot(K.T)
    return x + K.dot(e), 0.5 * (P + P.T)


def tilt_step(
    state: TiltState, gyro_radps: FloatArray, accel_mps2: FloatArray, dt_s: float, p: TiltParameters
) -> TiltStep:
    """Go one sample on: predict with the gyro (3,) over ``dt_s``, update with the accelerometer (3,).

    z = y_A - c_a a_prev;  e = z - g x-;  C0 = g^2 P- + sigma_A^2 I;  M = sigma_A^2 I + Sigma_acc.
    """
    x_prior, P_prior = predict(state, gyro_radps, dt_s, p)
    predicted = p.external_memory * state.a_prev
    e = accel_mps2 - predicted - GRAVITY_MPS2 * x_prior
    C0 = GRAVITY_MPS2**2 * P_prior.diagonal() + p.sigma_accel_mps2**2
    triggered = bool(e.dot(e) >= sum(C0.tolist()))
    mean_squares, squares = _windowed(state.squares, e * e, p.window)
    sigma_acc = acceleration_variance(p.adapt, Evidence(e, mean_squares, C0, triggered, predicted))
    x, P = correct(x_prior, P_prior, e, p.sigma_accel_mps2**2 + sigma_acc)
    if p.normalise:
        x = x / math.sqrt(x.dot(x))
    after = TiltState(x, P, accel_mps2 - GRAVITY_MPS2 * x, squares)
    return TiltStep(after, x_prior, P_prior, e, triggered, sigma_acc)


def run_tilt(
    start: TiltState, gyro_radps: FloatArray, accel_mps2: FloatArray, dt_s: FloatArray, p: TiltParameters
) -> tuple[FloatArray, BoolArray]:
    """Run the filter over n samples; returns x (n, 3) after each of them, and whether it triggered (n,)."""
    x = np.empty((len(dt_s), 3))
    triggered = np.empty(len(dt_s), dtype=np.bool_)
    state = start
    for k, dt in enumerate(dt_s.tolist()):
        step = tilt_step(state, gyro_radps[k], accel_mps2[k], dt, p)
        state = step.state
        x[k] = state.x
        triggered[k] = step.triggered
    return x, triggered


def roll_pitch(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Roll and pitch [rad] of x (..., 3): roll = atan2(x2, x3), pitch = atan2(-x1, hypot(x2, x3))."""
    return np.arctan2(x[..., 1], x[..., 2]), np.arctan2(-x[..., 0], np.hypot(x[..., 1], x[..., 2]))


def _minus_skew_squared(x: FloatArray, scale: float) -> FloatArray:
    """Return -scale skew(x)^2 = scale (x'x I - x x')."""
    a, b, c = x.tolist()
    ab, bc, ca = -scale * a * b, -scale * b * c, -scale * c * a
    aa, bb, cc = scale * a * a, scale * b * b, scale * c * c
    return np.array(((bb + cc, ab, ca), (ab, cc + aa, bc), (ca, bc, aa + bb)))


def _inverse(S: FloatArray) -> FloatArray:
    """Invert a symmetric (3, 3) matrix by its cofactors, in half the time of numpy.linalg.inv."""
    a, b, c, _, d, e, _, _, f = S.ravel().tolist()
    A, B, C, D, E, F = d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b
    return np.array(((A, B, C), (B, D, E), (C, E, F))) / (a * A + b * B + c * C)


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle if angle else 1.0


def _windowed(squares: FloatArray, newest: FloatArray, window: int) -> tuple[FloatArray, FloatArray]:
    """Return the mean over the last ``window`` squares, and those that the next sample still needs."""
    if window == 1:
        return newest, squares
    recent = np.concatenate((squares, newest[None]))
    return recent.mean(axis=0), recent[1 - window :]
