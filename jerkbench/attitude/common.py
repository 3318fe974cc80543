"""Base class and functions of the attitude filters: alignment, gravity compensation, and parts of their loops."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import BoolArray, FloatArray, FloatMatrix, FloatVector
from jerkbench.attitude.yaw import YAW_SOURCES, estimate_yaw, select_headings, yaw_remarks
from jerkbench.compilation.compiled import Compilation, can_compile
from jerkbench.errors import RecordingError, require_known
from jerkbench.estimate import Attitude
from jerkbench.geometry import best_rotation, dcm_from_euler, roll_pitch
from jerkbench.parameters import ABOVE_ZERO, NOT_NEGATIVE, Limited
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording

ALIGNMENTS = ("rest", "gravity", "track")

ALIGNMENT_S = 1.0
"""Minimum time at rest for the alignment at rest, and duration of the data that this alignment uses [s]."""

TRACK_S = 10.0
"""Duration of the data that the alignment ``track`` uses [s]."""

MIN_VELOCITIES = 3

STATIC_VARIANCE = 1e-3
LEVEL_VARIANCE = 0.03


class TiltStart(NamedTuple):
    """Initial state of an attitude filter.

    Attributes:
        x: (3,) Omega^T e3, the direction of the vertical in the body frame.
        variance: initial variance of each component of x [-].
    """

    x: FloatArray
    variance: float


def tilt_start(recording: Recording, variance: float | None = None, alignment: str = "rest") -> TiltStart:
    """Return the initial tilt and its variance, which an attitude filter uses before the first sample.

    With ``gravity``, x is the normalised mean specific force of the first second. The variance of x is 1e-3 at rest and
    0.03 in motion. If the vehicle is at rest, ``rest`` gives the same result as ``gravity``. In motion, ``rest`` gives
    x = (0, 0, 1) and a variance of 0.03. With ``track``, `tracked_vertical` computes x, and the variance is 1e-3.

    Args:
        recording: recording with an IMU, and with velocities or fixes for ``track``.
        variance: variance of each component of x; None for the default value of the alignment.
        alignment: alignment method, one of `ALIGNMENTS`.

    Raises:
        RecordingError: the mean specific force of the first second is zero, or the velocities for ``track`` are
            missing.
    """
    at_rest = recording.static_start_s >= ALIGNMENT_S
    default = STATIC_VARIANCE if at_rest or alignment == "track" else LEVEL_VARIANCE
    if alignment == "track":
        x = tracked_vertical(recording)
    elif at_rest or alignment == "gravity":
        x = recording.apparent_vertical(ALIGNMENT_S)
    else:
        x = np.array([0.0, 0.0, 1.0])
    return TiltStart(x, default if variance is None else variance)


def start_remarks(recording: Recording, alignment: str) -> tuple[str, ...]:
    """Return a note if the vehicle starts in motion and the alignment ``track`` would give a more accurate tilt."""
    velocity, imu = recording.velocity, recording.imu
    if alignment == "track" or imu is None or velocity is None or velocity.frame != "enu":
        return ()
    if recording.static_start_s >= ALIGNMENT_S or (velocity.t_s <= imu.t_s[0] + TRACK_S).sum() < MIN_VELOCITIES:
        return ()
    start = "level" if alignment == "rest" else "along the specific force of the first second"
    problem = f"it begins in motion, and the tilt starts {start}, which may be wrong by several degrees"
    return (f"{problem}; attitude.alignment=track uses the velocities over ground instead.",)


def tracked_vertical(recording: Recording) -> FloatArray:
    """Return the vertical x (3,) in the body frame at the first sample of a moving vehicle, from gyro and velocities.

    The gyro gives the rotation C_0k from the body frame at sample k to the body frame at the first sample. The vectors
    v_i are the velocities in ENU during the first ten seconds. A singular value decomposition gives the rotation C that
    solves a least-squares problem::

        a_i = int C_0k y_A dt from t_0 to t_i;  b_i = v_i - v_0 + g (t_i - t_0) e3;  C = argmin sum |b_i - C a_i|^2

    The result is x = C' e3. No heading is needed, because C includes the yaw. If the recording has no velocity in ENU,
    the velocities are the differences of consecutive fixes divided by the time step.

    Source: M. Wu, Y. Wu, X. Hu, D. Hu, "Optimization-based alignment for inertial navigation systems: Theory and
    algorithm", Aerospace Science and Technology 15(1), 2011, doi:10.1016/j.ast.2010.05.004.

    Raises:
        RecordingError: the first ten seconds contain fewer than three velocities.
    """
    imu = recording.inertial
    t_s, v_mps = _velocities(recording)
    first = imu.t_s <= t_s[-1]
    step_s = np.diff(imu.t_s[first], prepend=imu.t_s[0])[:, None]
    turns = Rotation.from_rotvec(step_s * imu.gyro_radps[first]).as_matrix()
    force, turn = np.empty((len(turns), 3)), np.eye(3)
    for k, step in enumerate(turns):
        turn = turn @ step
        force[k] = turn @ imu.accel_mps2[k]
    integral = np.cumsum(step_s * force, axis=0)
    a = np.column_stack([np.interp(t_s, imu.t_s[first], integral[:, i]) for i in range(3)])
    b = v_mps + np.outer(t_s, [0.0, 0.0, GRAVITY_MPS2])
    return np.asarray(best_rotation(b - b[0], a - a[0])[2])


def _velocities(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Return times (m,) [s] and ENU velocities (m, 3) [m/s] of the first `TRACK_S` seconds of the IMU data.

    Raises:
        RecordingError: the first ten seconds contain fewer than three velocities.
    """
    imu, velocity, position = recording.inertial, recording.velocity, recording.position
    t_s, v_mps = np.empty(0), np.empty((0, 3))
    if velocity is not None and velocity.frame == "enu":
        t_s, v_mps = velocity.t_s, velocity.mps
    elif position is not None:
        complete = np.isfinite(position.enu_m).all(axis=1)
        fix_s, enu_m = position.t_s[complete], position.enu_m[complete]
        t_s, v_mps = 0.5 * (fix_s[1:] + fix_s[:-1]), np.diff(enu_m, axis=0) / np.diff(fix_s)[:, None]
    use = np.isfinite(v_mps).all(axis=1) & (t_s >= imu.t_s[0]) & (t_s <= imu.t_s[0] + TRACK_S)
    if use.sum() < MIN_VELOCITIES:
        raise RecordingError(
            f"{recording.name} has fewer than three velocities over ground (measured, or computed from fixes) in its"
            f" first {TRACK_S:g} s; use alignment=rest or alignment=gravity."
        )
    return t_s[use], v_mps[use]


# Gravity compensation: the acceleration in ENU is computed from the specific force in the body frame.

COMPENSATIONS = ("midpoint", "endpoint")


def compensate_gravity(dcm: FloatArray, accel_mps2: FloatArray, compensation: str) -> FloatArray:
    """Return the acceleration u (n, 3) in ENU [m/s2], which is the rotated specific force minus gravity.

    With ``midpoint``, u_k = mean(Omega_{k-1}, Omega_k) y_A + (0, 0, -g), because sample k is the mean specific force
    between the times k - 1 and k. The first sample is rotated with Omega_0. With ``endpoint``, u_k = Omega_k y_A + (0,
    0, -g).

    Args:
        dcm: (n, 3, 3) rotation matrices Omega from the body frame to ENU at the end of each sample.
        accel_mps2: (n, 3) specific force y_A in the body frame [m/s2].
        compensation: attitude that rotates the specific force, one of `COMPENSATIONS`.
    """
    turn = np.concatenate([dcm[:1], 0.5 * (dcm[:-1] + dcm[1:])]) if compensation == "midpoint" else dcm
    return np.asarray(np.einsum("kij,kj->ki", turn, accel_mps2) - np.array([0.0, 0.0, GRAVITY_MPS2]))


def attitude_from(
    imu: Imu,
    euler_rad: FloatArray,
    compensation: str,
    triggered: BoolArray | None = None,
    yaw_sigma_rad: FloatArray | None = None,
) -> Attitude:
    """Return an `Attitude` with rotation matrices and the acceleration in ENU, computed from Euler angles.

    Args:
        imu: IMU data with n samples.
        euler_rad: (n, 3) roll, pitch and yaw at the times of the IMU samples [rad].
        compensation: attitude that rotates the specific force, one of `COMPENSATIONS`.
        triggered: (n,) mask of samples with a detected external acceleration; None if the filter detects none.
        yaw_sigma_rad: (n,) standard deviation of the yaw [rad]; None if it is unknown.
    """
    dcm = dcm_from_euler(euler_rad)
    seen = np.zeros(len(imu.t_s), dtype=np.bool_) if triggered is None else triggered
    return Attitude(imu.t_s, dcm, euler_rad, compensate_gravity(dcm, imu.accel_mps2, compensation), seen, yaw_sigma_rad)


Verticals = tuple[FloatArray, BoolArray | None]
"""The vertical x = Omega^T e3 (n, 3) after each sample, and a mask (n,) of detected external accelerations or None."""


def run_samples(
    loop: Callable[..., None], title: str, imu: Imu, state: tuple[object, ...], *, detects: bool
) -> Verticals:
    """Call ``loop`` once for all samples, compiled if numba is enabled, and return the verticals that it writes.

    The arguments of the loop are ``state``, the angular rates, the specific forces, the intervals, the array of the
    verticals, and the mask of detected external accelerations if ``detects`` is True. With NUMBA_DISABLE_JIT=1, the
    loop runs as Python code and is about a hundred times slower.

    Args:
        loop: filter loop, a function that writes its results to its last arguments.
        title: name of the loop in progress messages.
        imu: IMU data that the loop processes.
        state: first arguments of the loop, the state and the parameters of the filter.
        detects: whether the filter detects external accelerations.
    """
    x, triggered = np.empty((len(imu.t_s), 3)), np.empty(len(imu.t_s), dtype=np.bool_)
    filled = (x, triggered) if detects else (x,)
    samples = (np.require(a, np.float64, ["C", "W", "A"]) for a in (imu.gyro_radps, imu.accel_mps2, imu.intervals_s))
    with np.errstate(all="ignore"):
        (_compiled(loop, title) if can_compile() else loop)(*state, *samples, *filled)
    return x, triggered if detects else None


@cache
def _compiled(loop: Callable[..., None], title: str) -> Callable[..., None]:
    function: Callable[..., None] = Compilation(loop, title).result()
    return function


@dataclass(frozen=True, kw_only=True)
class TiltAndYaw(Limited, ABC):
    """Base class of attitude filters, with the initial alignment, the yaw filter and the gravity compensation.

    A subclass estimates the tilt. The parameter ``alignment`` determines the initial x = Omega^T e3, the direction of
    the vertical in the body frame::

        gravity  x is the normalised mean specific force of the first second, also in motion
        rest     as gravity if the vehicle is at rest during this second; in motion x is level
        track    x follows from the gyro and the velocities (or fixes) of the first 10 s (`jerkbench.attitude.common`)

    Attributes:
        alignment: method that determines the initial tilt: gravity, rest or track.
        compensation: attitude that rotates the specific force: at the midpoint or at the endpoint of each sample.
        yaw_source: source of the yaw: dual_antenna, odometry, course, track (of the fixes), gyro_only, or auto. The
            value auto selects the first available source: measured headings, the course of a velocity in ENU, the track
            of the fixes, the gyro only.
        yaw_walk_rad_per_sqrt_s: random walk of the yaw [rad/sqrt(s)].
        course_min_speed_mps: minimum horizontal speed at which the yaw filter uses a course [m/s].
        course_sigma_min_rad: lower limit of the standard deviation of a course [rad].
    """

    name: ClassVar[str]

    alignment: str = "rest"
    compensation: str = "midpoint"
    yaw_source: str = "auto"
    yaw_walk_rad_per_sqrt_s: Annotated[float, NOT_NEGATIVE] = 2e-4
    course_min_speed_mps: Annotated[float, ABOVE_ZERO] = 0.5
    course_sigma_min_rad: Annotated[float, ABOVE_ZERO] = 0.0087

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_choices({"alignment": ALIGNMENTS, "compensation": COMPENSATIONS, "yaw_source": YAW_SOURCES})

    @abstractmethod
    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3) after each sample, and a mask (n,) of external accelerations.

        The mask is None if the filter does not detect external accelerations.
        """

    def require(self, load: Callable[[], Recording]) -> None:
        """Check before a sweep that the recording has the data that the alignment and the yaw source need.

        Raises:
            RecordingError: the recording has no data of the yaw source, or no velocities for the alignment ``track``.
        """
        if self.yaw_source not in ("auto", "gyro_only"):
            select_headings(load(), self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)
        if self.alignment == "track":
            tilt_start(load(), None, "track")

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return notes for the result table if the initial tilt is only assumed, or if the yaw is not measured."""
        yaw = yaw_remarks(recording, self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)
        return (*start_remarks(recording, self.alignment), *yaw)

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the acceleration in ENU at the times of the IMU samples.

        Raises:
            RecordingError: the recording does not have the requested yaw source.
        """
        imu, sigma_min_rad = recording.inertial, self.course_sigma_min_rad
        # before the filter loop, because an invalid yaw source raises an error
        headings = select_headings(recording, self.yaw_source, self.course_min_speed_mps, sigma_min_rad)
        x, triggered = self.verticals(recording)
        roll, pitch = roll_pitch(x)
        yaw = estimate_yaw(imu, roll, pitch, headings, self.yaw_walk_rad_per_sqrt_s, sigma_min_rad)
        return attitude_from(imu, np.column_stack([roll, pitch, yaw.rad]), self.compensation, triggered, yaw.sigma_rad)

    def _check_choices(self, choices: Mapping[str, Sequence[str]]) -> None:
        for name, available in choices.items():
            require_known(f"{name} of attitude {self.name}", getattr(self, name), available)


# `madgwick` and `mahony` use a unit quaternion (w, a, b, c) that rotates from the body frame to ENU.


def quaternion_of(x: FloatArray) -> FloatArray:
    """Return the unit quaternion (4,) of the attitude with the vertical x = Omega^T e3 (3,) and a yaw of 0."""
    roll, pitch = roll_pitch(x)
    cr, sr, cp, sp = np.cos(roll / 2), np.sin(roll / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return np.array([cr * cp, sr * cp, cr * sp, -sr * sp])


def set_quaternion(q: FloatArray, w: float, a: float, b: float, c: float, x: FloatArray) -> None:
    """Write the normalised quaternion (w, a, b, c) to ``q`` (4,), and its vertical x = Omega^T e3 to ``x`` (3,)."""
    length = math.sqrt(w * w + a * a + b * b + c * c)
    w, a, b, c = w / length, a / length, b / length, c / length
    q[0], q[1], q[2], q[3] = w, a, b, c
    x[0], x[1], x[2] = 2.0 * (a * c - w * b), 2.0 * (w * a + b * c), 1.0 - 2.0 * (a * a + b * b)


# The adaptive accelerometer update and the rotation matrices of `tilt` and `mekf`, as parts of their compiled loops. In
# both filters, the accelerometer depends only on the first three states, so its measurement matrix H is (3, 3).

ADAPTATIONS = ("none", "mtf", "scalar", "lee")
"""Methods that estimate Sigma, the variance of an external acceleration."""

MTF, SCALAR, LEE = 1, 2, 3


class GravityUpdate(NamedTuple):
    """State and buffers of the accelerometer update.

    Attributes:
        a_prev: (3,) estimated external acceleration at the previous sample [m/s2].
        squares: (mu, 3) ring buffer of the squared innovations of the latest mu samples.
        H: (3, 3) measurement matrix of the first three states.
        e: (3,) innovation of the accelerometer [m/s2].
        C0: (3,) diagonal of H P H' + N, where N is the noise variance of the accelerometer.
        M: (3,) diagonal of N + Sigma, where Sigma is the variance of the external acceleration.
        dx: (n,) correction of the n states.
        K: (n,) buffer for one column of P H', which is the Kalman gain times the innovation variance.
        memory: c_a, fraction of the external acceleration that persists until the next sample.
        adapt: index of the adaptation method in `ADAPTATIONS`.
    """

    a_prev: FloatVector
    squares: FloatMatrix
    H: FloatMatrix
    e: FloatVector
    C0: FloatVector
    M: FloatVector
    dx: FloatVector
    K: FloatVector
    memory: float
    adapt: int


def gravity_update(states: int, window: int, memory: float, adapt: str) -> GravityUpdate:
    """Return the buffers of the accelerometer update for a filter with ``states`` states; the initial H is g I."""
    (a_prev, e, C0, M), (dx, K) = np.zeros((4, 3)), np.zeros((2, states))
    H, which = GRAVITY_MPS2 * np.eye(3), ADAPTATIONS.index(adapt)
    return GravityUpdate(a_prev, np.zeros((window, 3)), H, e, C0, M, dx, K, float(memory), which)


def see_gravity(u: GravityUpdate, P: FloatArray, x: FloatArray, y: FloatArray, k: int, noise: float) -> float:
    """Compute the innovation e = y_A - c_a a_prev - g x and C0 = diag(H P H') + N, and return e'e - tr C0.

    The adaptation is triggered if the returned value is at least 0.
    """
    excess = 0.0
    for i in range(3):
        u.e[i] = y[i] - u.memory * u.a_prev[i] - GRAVITY_MPS2 * x[i]
        u.C0[i] = noise
        for r in range(3):
            u.C0[i] += u.H[i, r] * (P[r, 0] * u.H[i, 0] + P[r, 1] * u.H[i, 1] + P[r, 2] * u.H[i, 2])
        u.squares[k % len(u.squares), i] = u.e[i] ** 2
        excess += u.e[i] ** 2 - u.C0[i]
    return excess


def fill_noise(u: GravityUpdate, k: int, excess: float, noise: float, factor: float) -> None:
    """Compute the measurement covariance M = N + factor diag(Sigma) of the adaptation method.

    The method determines the variance Sigma_i of the external acceleration, where w_i is the mean of the latest e_i^2::

        mtf:    Sigma_i = max(0, w_i - C0_ii) if e'e >= tr C0, else 0
        scalar: Sigma_i = (e'e - tr C0)/3 if e'e >= tr C0, else 0
        lee:    Sigma_i = |c_a a_prev|^2/3
    """
    recent = min(k + 1, len(u.squares))
    expected = u.memory**2 * (u.a_prev[0] ** 2 + u.a_prev[1] ** 2 + u.a_prev[2] ** 2)
    for i in range(3):
        sigma = 0.0
        if u.adapt == MTF and excess >= 0.0:
            for r in range(recent):
                sigma += u.squares[r, i]
            sigma = max(sigma / recent - u.C0[i], 0.0)
        elif u.adapt == SCALAR and excess >= 0.0:
            sigma = excess / 3.0
        elif u.adapt == LEE:
            sigma = expected / 3.0
        u.M[i] = noise + factor * sigma


def updating(states: int) -> Callable[[GravityUpdate, FloatArray], None]:
    """Return the measurement update of a filter with ``states`` states: dx = K e and P = (I - K H) P."""

    def update(u: GravityUpdate, P: FloatArray) -> None:
        """Process the rows of H sequentially. No matrix inversion is necessary, because M is diagonal."""
        u.dx[:] = 0.0
        for i in range(3):
            S, residual = u.M[i], u.e[i]
            for r in range(states):
                u.K[r] = P[r, 0] * u.H[i, 0] + P[r, 1] * u.H[i, 1] + P[r, 2] * u.H[i, 2]
            for r in range(3):
                S += u.H[i, r] * u.K[r]
                residual -= u.H[i, r] * u.dx[r]
            for r in range(states):
                gain = u.K[r] / S
                u.dx[r] += gain * residual
                for s in range(r + 1):
                    P[r, s] -= gain * u.K[s]
                    P[s, r] = P[r, s]

    return update


def fill_rotation(C: FloatArray, t: FloatArray, scale: float, exact: bool) -> None:
    """Write the rotation Exp(scale t) to ``C`` by Rodrigues' formula, or I + skew(scale t) if ``exact`` is false.

    Rodrigues' formula contains the square of the skew matrix, skew(t)^2 = t t' - t't I.
    """
    a, b, c = scale * t[0], scale * t[1], scale * t[2]
    square = a * a + b * b + c * c
    first, second = 1.0, 0.5 if exact else 0.0
    if exact and square > 0.0:
        angle = math.sqrt(square)
        first, second = math.sin(angle) / angle, 0.5 * (math.sin(angle / 2) / (angle / 2)) ** 2
    turn = (a, b, c)
    for i in range(3):
        for j in range(3):
            C[i, j] = second * (turn[i] * turn[j] - (square if i == j else 0.0)) + (1.0 if i == j else 0.0)
    for i, j, m in ((1, 2, 0), (2, 0, 1), (0, 1, 2)):
        C[i, j] -= first * turn[m]
        C[j, i] += first * turn[m]
