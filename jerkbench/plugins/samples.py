"""Inputs for the checks of plugins: a small recording with all kinds of measurements, and updates for adaptations."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.random_streams import stream
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Origin, Position, Recording, Reference, Velocity
from jerkbench.timeline import Timeline, build_timeline

_RADIUS_M, _RATE_RADPS, _STATIONARY_S, _RAMP_S = 8.0, 0.25, 4.0, 4.0
IMU_RATE_HZ, GNSS_RATE_HZ = 50, 5


def small_recording(duration_s: float = 24.0) -> Recording:
    """Return a noisy recording of a level body that is stationary for 4 s and then drives in a circle."""
    noise = stream(0, "conformance")
    t = np.arange(1, round(duration_s * IMU_RATE_HZ) + 1) / IMU_RATE_HZ
    fix = t[IMU_RATE_HZ // GNSS_RATE_HZ - 1 :: IMU_RATE_HZ // GNSS_RATE_HZ]
    enu, velocity, euler, specific_force, gyro = _circle(t)
    true_position, true_velocity, true_euler, _, _ = _circle(fix)
    p = true_position + 0.02 * noise.normal(size=(len(fix), 3))
    p[len(fix) // 2, 2] = np.nan  # one height is missing
    return Recording(
        name="conformance",
        imu=Imu(t, specific_force + 0.02 * noise.normal(size=(len(t), 3)), gyro + 1e-3 * noise.normal(size=gyro.shape)),
        reference=Reference(t, "simulated", independent=True, enu_m=enu, velocity_mps=velocity, euler_rad=euler),
        position=Position(fix, p, _covariances(len(fix), 0.02)),
        velocity=Velocity(fix, true_velocity + 0.03 * noise.normal(size=(len(fix), 3)), _covariances(len(fix), 0.03)),
        heading=Heading(fix, true_euler[:, 2] + 0.01 * noise.normal(size=len(fix)), np.full(len(fix), 0.01)),
        origin=Origin(48.0, 11.0, 500.0),
        static_start_s=_STATIONARY_S,
        outages_s=np.array([[14.0, 16.0]]),
    )


def true_attitude(recording: Recording) -> Attitude:
    """Return the attitude of the reference, and the ENU acceleration from this attitude and the accelerometer."""
    euler = np.asarray(recording.reference.euler_rad)
    dcm = dcm_from_euler(euler)
    u = np.einsum("nij,nj->ni", dcm, recording.inertial.accel_mps2) - [0.0, 0.0, GRAVITY_MPS2]
    return Attitude(recording.inertial.t_s, dcm, euler.copy(), u, np.zeros(len(euler), dtype=bool))


def small_timeline(duration_s: float = 24.0) -> tuple[Recording, Timeline]:
    """Return the small recording, and its timeline, which is computed with the attitude of the reference."""
    recording = small_recording(duration_s)
    return recording, build_timeline(recording, true_attitude(recording))


def _circle(t_s: FloatArray) -> tuple[FloatArray, ...]:
    """Return position, velocity, Euler angles, specific force and angular rate of a drive in a circle.

    The angular rate increases linearly from zero to a constant value.
    """
    on = np.clip(t_s - _STATIONARY_S, 0.0, _RAMP_S)
    after = np.maximum(t_s - _STATIONARY_S - _RAMP_S, 0.0)
    slope = _RATE_RADPS / _RAMP_S
    angle, rate = 0.5 * slope * on**2 + _RATE_RADPS * after, slope * on
    change = np.where((on > 0) & (after <= 0), slope, 0.0)
    zero = 0 * angle
    position = _RADIUS_M * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), zero])
    velocity = _RADIUS_M * np.column_stack([rate * np.cos(angle), rate * np.sin(angle), zero])
    euler = np.column_stack([zero, zero, np.arctan2(np.sin(angle), np.cos(angle))])
    force = np.column_stack([_RADIUS_M * change, _RADIUS_M * rate**2, zero + GRAVITY_MPS2])
    return position, velocity, euler, force, np.column_stack([zero, zero, rate])


def _covariances(n: int, sigma: float) -> FloatArray:
    return np.tile(sigma**2 * np.eye(3), (n, 1, 1))


# The following updates are used in the checks of adaptations.

ROWS = ((0, 1, 2, 3, 4, 5), (0, 1, 2), (3, 4, 5), (4,), (2,), (0, 1, 4))
"""Rows of z that are measured in an update."""

COVARIANCE_SCALES = ((1.0, 1.0), (1.0, 1e-6), (1e-4, 1e12), (1e6, 1e-6))
"""Pairs of factors on P- and on R: both normal, tiny R, almost infinite R, almost unknown prior."""

TRIED_STATES = 9
"""Number of states of the filter: three states for each of three axes."""

TRIED_SIGMAS = (0.0, 1.0, 1.0, 100.0)
"""Magnitudes of the innovation in standard deviations. The last magnitude is an outlier."""


class TriedUpdate(NamedTuple):
    """The arguments of the methods of an adaptation, except H P- H' and the memory."""

    x: FloatArray
    P: FloatArray
    F: FloatArray
    Q: FloatArray
    innovation: FloatArray
    R: FloatArray
    rows: IntArray


def tried_updates(*, thorough: bool) -> Iterator[TriedUpdate]:
    """Yield sample updates, and if ``thorough`` is set, also updates with extreme covariances and a long series."""
    random = stream(0, "conformance", "adaptation")
    for scales in COVARIANCE_SCALES if thorough else COVARIANCE_SCALES[:1]:
        for sigma in TRIED_SIGMAS:
            for rows in ROWS:
                yield tried_update(random, rows, sigma, scales)
    for _ in range(40 if thorough else 0):  # the series is longer than any window or counter
        yield tried_update(random, ROWS[0], 100.0)


def tried_update(
    random: np.random.Generator, rows: tuple[int, ...], sigma: float, scales: tuple[float, float] = (1.0, 1.0)
) -> TriedUpdate:
    """Return a random update with full covariance matrices and an innovation of ``sigma`` standard deviations."""
    m, measured = len(rows), np.array(rows)
    half, noise = random.normal(size=(2, TRIED_STATES, 2 * TRIED_STATES)) / np.sqrt(2 * TRIED_STATES)
    F = np.eye(TRIED_STATES) + 0.1 * np.eye(TRIED_STATES, k=3)
    Q = 0.1 * scales[0] * noise @ noise.T
    P = scales[0] * F @ half @ half.T @ F.T + Q
    x = random.normal(size=TRIED_STATES)
    half = random.normal(size=(m, 2 * m)) / np.sqrt(2 * m)
    R = scales[1] * half @ half.T
    innovation = sigma * np.sqrt(np.diag(P)[measured] + np.diag(R)) * random.choice([-1.0, 1.0], size=m)
    P, Q, R = (0.5 * (matrix + matrix.T) for matrix in (P, Q, R))
    return TriedUpdate(x, P, F, Q, innovation, R, measured)
