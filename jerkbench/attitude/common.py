"""What every attitude filter shares: its start, and what it ends with: yaw, Omega, gravity compensation."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.yaw import (
    YAW_SOURCES,
    estimate_yaw,
    select_headings,
    yaw_remarks,
)
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.module_cache import can_compile
from jerkbench.errors import RecordingError, require_known
from jerkbench.estimate import Attitude
from jerkbench.geometry import best_rotation, dcm_from_euler, roll_pitch
from jerkbench.parameters import ABOVE_ZERO, NOT_NEGATIVE, Limited
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording

ALIGNMENTS = ("rest", "gravity", "track")

ALIGNMENT_S = 1.0
"""The rest that the alignment uses at most, and needs at least."""

TRACK_S = 10.0
"""How much of the drive the alignment by its track uses."""

MIN_VELOCITIES = 3

STATIC_VARIANCE = 1e-3
LEVEL_VARIANCE = 0.03


class TiltStart(NamedTuple):
    """Where the filter starts.

    Attributes:
        x: (3,) Omega^T e3.
        variance: diagonal of its covariance.
    """

    x: FloatArray
    variance: float


def tilt_start(recording: Recording, variance: float | None = None, alignment: str = "rest") -> TiltStart:
    """Return the state before the first sample.

    gravity: x is the normalised mean specific force of the first second, P = 1e-3 I at rest and .03 I in motion.
    rest: the same at rest; in motion x = (0, 0, 1), P = .03 I.
    track: from the gyro and the measured velocities of the first seconds, see `tracked_vertical`; P = 1e-3 I.
    ``variance`` replaces any of them.

    Raises:
        RecordingError: the accelerometer shows no gravity in the first second, or there is no track.
    """
    at_rest = recording.static_start_s >= ALIGNMENT_S
    usual = STATIC_VARIANCE if at_rest or alignment == "track" else LEVEL_VARIANCE
    if alignment == "track":
        x = tracked_vertical(recording)
    elif at_rest or alignment == "gravity":
        x = recording.apparent_vertical(ALIGNMENT_S)
    else:
        x = np.array([0.0, 0.0, 1.0])
    return TiltStart(x, usual if variance is None else variance)


def start_remarks(recording: Recording, alignment: str) -> tuple[str, ...]:
    """Return what a reader has to know of the start: that it is a guess, and that a measured velocity shows it."""
    velocity, imu = recording.velocity, recording.imu
    if alignment == "track" or imu is None or velocity is None or velocity.frame != "enu":
        return ()
    if recording.static_start_s >= ALIGNMENT_S or (velocity.t_s <= imu.t_s[0] + TRACK_S).sum() < MIN_VELOCITIES:
        return ()
    start = "level" if alignment == "rest" else "along the first second's specific force"
    found = f"it begins in motion, and the tilt starts {start}, which may be off by degrees"
    return (f"{found}; attitude.alignment=track starts by its velocities over ground.",)


def tracked_vertical(recording: Recording) -> FloatArray:
    """Return x (3,) at the first sample from the gyro and the velocity over ground, for a vehicle in motion.

    With C_0k the turn from the body at sample k to the body at the first one, by the gyro alone, and v_i the velocities
    in ENU of the first ten seconds::

        a_i = int C_0k y_A dt from t_0 to t_i;  b_i = v_i - v_0 + g (t_i - t_0) e3;  C = argmin sum |b_i - C a_i|^2

    over rotations, by a singular value decomposition. x = C' e3. It needs no heading: gravity is most of both vectors,
    and yaw is found with them. Without velocities the differences of the fixes stand in, at the middle between them.

    Source: M. Wu, Y. Wu, X. Hu, D. Hu, "Optimization-based alignment for inertial navigation systems: Theory and
    algorithm", Aerospace Science and Technology 15(1), 2011, doi:10.1016/j.ast.2010.05.004.

    Raises:
        RecordingError: there are fewer than three velocities or fixes in that time.
    """
    imu = recording.inertial
    t_s, v_mps = _velocities(recording)
    first = imu.t_s <= t_s[-1]
    step_s = np.diff(imu.t_s[first], prepend=imu.t_s[0])[:, None]
    turns = Rotation.from_rotvec(step_s * imu.gyro_radps[first]).as_matrix()
    force, turn = np.empty((len(turns), 3)), np.eye(3)
    for k, turned in enumerate(turns):
        turn = turn @ turned
        force[k] = turn @ imu.accel_mps2[k]
    integral = np.cumsum(step_s * force, axis=0)
    a = np.column_stack([np.interp(t_s, imu.t_s[first], integral[:, i]) for i in range(3)])
    b = v_mps + np.outer(t_s, [0.0, 0.0, GRAVITY_MPS2])
    return np.asarray(best_rotation(b - b[0], a - a[0])[2])


def _velocities(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Times (m,) and velocities over ground (m, 3) while the IMU runs, of the first seconds."""
    imu, velocity, position = recording.inertial, recording.velocity, recording.position
    t_s, v_mps = np.empty(0), np.empty((0, 3))
    if velocity is not None and velocity.frame == "enu":
        t_s, v_mps = velocity.t_s, velocity.mps
    elif position is not None:
        whole = np.isfinite(position.enu_m).all(axis=1)
        fix_s, place_m = position.t_s[whole], position.enu_m[whole]
        t_s, v_mps = 0.5 * (fix_s[1:] + fix_s[:-1]), np.diff(place_m, axis=0) / np.diff(fix_s)[:, None]
    use = np.isfinite(v_mps).all(axis=1) & (t_s >= imu.t_s[0]) & (t_s <= imu.t_s[0] + TRACK_S)
    if use.sum() < MIN_VELOCITIES:
        raise RecordingError(
            f"{recording.name} has fewer than three velocities over ground, or fixes, in its first {TRACK_S:g} s; take"
            " alignment rest or gravity."
        )
    return t_s[use], v_mps[use]


# Gravity compensation: specific force of the body -> acceleration in ENU.

COMPENSATIONS = ("midpoint", "endpoint")


def compensate_gravity(dcm: FloatArray, accel_mps2: FloatArray, compensation: str) -> FloatArray:
    """Return u (n, 3), the acceleration in ENU [m/s2].

    u_k = mean(Omega_{k-1}, Omega_k) y_A + (0, 0, -g) with ``midpoint`` (a sample is the mean over the interval
    between the two; the first one has Omega_0 alone), Omega_k y_A + (0, 0, -g) with ``endpoint``.

    Args:
        dcm: (n, 3, 3) Omega, body -> ENU, at the end of each sample.
        accel_mps2: (n, 3) y_A, specific force, body.
        compensation: one of `COMPENSATIONS`.
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
    """Return the attitude (n, 3) with Omega and the ENU acceleration; ``triggered`` None: never."""
    dcm = dcm_from_euler(euler_rad)
    seen = np.zeros(len(imu.t_s), dtype=np.bool_) if triggered is None else triggered
    return Attitude(imu.t_s, dcm, euler_rad, compensate_gravity(dcm, imu.accel_mps2, compensation), seen, yaw_sigma_rad)


def run_samples(loop: Callable[..., None], title: str, imu: Imu, state: tuple[object, ...], *filled: Any) -> None:  # noqa: ANN401 - arrays
    """Run ``loop``(*state, gyro, accel, intervals, *filled) over all samples, compiled where numba may compile.

    With NUMBA_DISABLE_JIT=1 the same loop runs as it is, some hundred times slower. ``title`` says what is compiled.
    """
    samples = (np.require(a, np.float64, ["C", "W", "A"]) for a in (imu.gyro_radps, imu.accel_mps2, imu.intervals_s))
    with np.errstate(all="ignore"):
        (_compiled(loop, title) if can_compile() else loop)(*state, *samples, *filled)


@cache
def _compiled(loop: Callable[..., None], title: str) -> Callable[..., None]:
    return compiled_loop(loop, title, kernel=False)


Verticals = tuple[FloatArray, BoolArray | None]
"""x = Omega^T e3 (n, 3) after each sample, and whether an external acceleration was seen there (n,); None: never."""


@dataclass(frozen=True, kw_only=True)
class TiltAndYaw(Limited, ABC):
    """An attitude filter that finds the tilt its own way. The start, yaw and compensation are the same for all.

    Start, as ``alignment`` says, with x = Omega^T e3, the vertical of ENU seen from the body::

        gravity  x is the normalised mean specific force of the first second, in motion too
        rest     the same if it is at rest for that second; in motion x is level
        track    from the gyro and the velocities (or fixes) of the first 10 s (`jerkbench.attitude.common`)

    Attributes:
        alignment: gravity, rest or track.
        compensation: midpoint or endpoint.
        yaw_source: dual_antenna, odometry, course, track (of the fixes), gyro_only, or auto: the headings that the
            recording has, whatever measured them, else the course of its velocity in ENU, else the track of its fixes,
            else the gyro alone.
        yaw_walk_rad_per_sqrt_s: random walk of yaw.
        course_min_speed_mps: horizontal speed above which the course counts.
        course_sigma_min_rad: least standard deviation of a course.
    """

    name: ClassVar[str]

    alignment: str = "rest"
    compensation: str = "midpoint"
    yaw_source: str = "auto"
    yaw_walk_rad_per_sqrt_s: Annotated[float, NOT_NEGATIVE] = 2e-4
    course_min_speed_mps: Annotated[float, ABOVE_ZERO] = 0.5
    course_sigma_min_rad: Annotated[float, ABOVE_ZERO] = 0.0087

    def __post_init__(self) -> None:
        """Check that every choice exists and every number makes sense."""
        super().__post_init__()
        self._check_choices({"alignment": ALIGNMENTS, "compensation": COMPENSATIONS, "yaw_source": YAW_SOURCES})

    @abstractmethod
    def verticals(self, recording: Recording) -> Verticals:
        """Return x = Omega^T e3 (n, 3) after each sample, and whether it saw an external acceleration (n,), or None."""

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the recording of ``load`` has what start and yaw were asked to use.

        Raises:
            RecordingError: the recording has no such yaw source, or no track to start from.
        """
        if self.yaw_source not in ("auto", "gyro_only"):
            select_headings(load(), self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)
        if self.alignment == "track":
            tilt_start(load(), None, "track")

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return what a reader of the table has to know: that the start is a guess, or that nothing measures yaw."""
        yaw = yaw_remarks(recording, self.yaw_source, self.course_min_speed_mps, self.course_sigma_min_rad)
        return (*start_remarks(recording, self.alignment), *yaw)

    def estimate(self, recording: Recording) -> Attitude:
        """Return attitude and ENU acceleration at the IMU's stamps.

        Raises:
            RecordingError: the recording lacks the yaw source that was asked for.
        """
        imu, sigma_min_rad = recording.inertial, self.course_sigma_min_rad
        headings = select_headings(
            recording, self.yaw_source, self.course_min_speed_mps, sigma_min_rad
        )  # costs no loop
        x, triggered = self.verticals(recording)
        roll, pitch = roll_pitch(x)
        yaw = estimate_yaw(imu, roll, pitch, headings, self.yaw_walk_rad_per_sqrt_s, sigma_min_rad)
        return attitude_from(imu, np.column_stack([roll, pitch, yaw.rad]), self.compensation, triggered, yaw.sigma_rad)

    def _check_choices(self, choices: Mapping[str, Sequence[str]]) -> None:
        for name, available in choices.items():
            require_known(f"{name} of attitude {self.name}", getattr(self, name), available)


# The unit quaternion w, a, b, c of `madgwick` and `mahony`, which turns the body into ENU.


def quaternion_of(x: FloatArray) -> FloatArray:
    """Return (4,) the rotation whose vertical is x = Omega^T e3 (3,), with yaw 0."""
    roll, pitch = roll_pitch(x)
    cr, sr, cp, sp = np.cos(roll / 2), np.sin(roll / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return np.array([cr * cp, sr * cp, cr * sp, -sr * sp])


def set_quaternion(q: FloatArray, w: float, a: float, b: float, c: float, x: FloatArray) -> None:
    """Put (w, a, b, c), brought to length 1, into q (4,), and its vertical into x (3,); for a compiled loop."""
    length = math.sqrt(w * w + a * a + b * b + c * c)
    w, a, b, c = w / length, a / length, b / length, c / length
    q[0], q[1], q[2], q[3] = w, a, b, c
    x[0], x[1], x[2] = 2.0 * (a * c - w * b), 2.0 * (w * a + b * c), 1.0 - 2.0 * (a * a + b * b)
