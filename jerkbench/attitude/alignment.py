"""The start of every attitude filter: the vertical of ENU seen from the body, before the first sample."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import best_rotation
from jerkbench.recording import GRAVITY_MPS2, Recording

ALIGNMENTS = ("rest", "gravity", "track")

ALIGNMENT_S = 1.0
"""The rest that the alignment uses at most, and needs at least."""

TRACK_S = 10.0
"""How much of the drive the alignment by its track uses."""

LEAST_VELOCITIES = 3

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
    if recording.static_start_s >= ALIGNMENT_S or (velocity.t_s <= imu.t_s[0] + TRACK_S).sum() < LEAST_VELOCITIES:
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
    if use.sum() < LEAST_VELOCITIES:
        raise RecordingError(
            f"{recording.name} has fewer than three velocities over ground, or fixes, in its first {TRACK_S:g} s; take"
            " alignment rest or gravity."
        )
    return t_s[use], v_mps[use]
