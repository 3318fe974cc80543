"""What plugins are tried on: a small recording that has everything, and updates of all kinds."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.random_streams import stream
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Origin, Position, Recording, Reference, Velocity
from jerkbench.timeline import Timeline, build_timeline

RADIUS_M, RATE_RADPS, STAND_S, RAMP_S = 8.0, 0.25, 4.0, 4.0
IMU_RATE_HZ, GNSS_RATE_HZ = 50, 5


def small_recording(duration_s: float = 24.0) -> Recording:
    """Return a level body that stands for 4 s and then drives in a circle, with noise on everything; all in ENU."""
    noise = stream(0, "conformance")
    t = np.arange(1, round(duration_s * IMU_RATE_HZ) + 1) / IMU_RATE_HZ
    fix = t[IMU_RATE_HZ // GNSS_RATE_HZ - 1 :: IMU_RATE_HZ // GNSS_RATE_HZ]
    enu, velocity, euler, specific_force = _circle(t)
    gyro = np.column_stack([0 * t, 0 * t, _angle(t)[1]])
    at_fix = _circle(fix)
    p = at_fix[0] + 0.02 * noise.normal(size=(len(fix), 3))
    p[len(fix) // 2, 2] = np.nan  # an axis that is not there
    return Recording(
        name="conformance",
        imu=Imu(t, specific_force + 0.02 * noise.normal(size=(len(t), 3)), gyro + 1e-3 * noise.normal(size=gyro.shape)),
        reference=Reference(
            t, "made for the checks", independent=True, enu_m=enu, velocity_mps=velocity, euler_rad=euler
        ),
        position=Position(fix, p, _covariances(len(fix), 0.02)),
        velocity=Velocity(fix, at_fix[1] + 0.03 * noise.normal(size=(len(fix), 3)), _covariances(len(fix), 0.03)),
        heading=Heading(fix, at_fix[2][:, 2] + 0.01 * noise.normal(size=len(fix)), np.full(len(fix), 0.01)),
        origin=Origin(48.0, 11.0, 500.0),
        static_start_s=STAND_S,
        outages_s=np.array([[14.0, 16.0]]),
    )


def true_attitude(recording: Recording) -> Attitude:
    """Return the attitude of the reference, with the acceleration that belongs to it."""
    euler = np.asarray(recording.reference.euler_rad)
    dcm = dcm_from_euler(euler)
    u = np.einsum("nij,nj->ni", dcm, recording.inertial.accel_mps2) - [0.0, 0.0, GRAVITY_MPS2]
    return Attitude(recording.inertial.t_s, dcm, euler.copy(), u, np.zeros(len(euler), dtype=bool))


def small_timeline(duration_s: float = 24.0) -> tuple[Recording, Timeline]:
    """Return the recording, and its timeline with the attitude of the reference."""
    recording = small_recording(duration_s)
    return recording, build_timeline(recording, true_attitude(recording))


def _angle(t_s: FloatArray) -> FloatArray:
    """Angle on the circle and its two derivatives; the rate grows linearly over the ramp."""
    on = np.clip(t_s - STAND_S, 0.0, RAMP_S)
    after = np.maximum(t_s - STAND_S - RAMP_S, 0.0)
    slope = RATE_RADPS / RAMP_S
    angle = 0.5 * slope * on**2 + RATE_RADPS * after
    return np.array([angle, slope * on, np.where((on > 0) & (after <= 0), slope, 0.0)])


def _circle(t_s: FloatArray) -> list[FloatArray]:
    """Position, velocity, Euler angles and specific force in the body, level, heading along the circle."""
    angle, rate, change = _angle(t_s)
    zero = 0 * angle
    position = RADIUS_M * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), zero])
    velocity = RADIUS_M * np.column_stack([rate * np.cos(angle), rate * np.sin(angle), zero])
    euler = np.column_stack([zero, zero, np.arctan2(np.sin(angle), np.cos(angle))])
    force = np.column_stack([RADIUS_M * change, RADIUS_M * rate**2, zero + GRAVITY_MPS2])
    return [position, velocity, euler, force]


def _covariances(n: int, sigma: float) -> FloatArray:
    return np.tile(sigma**2 * np.eye(3), (n, 1, 1))


# Updates to try an adaptation on.

ROWS = ((0, 1, 2, 3, 4, 5), (0, 1, 2), (3, 4, 5), (4,), (2,), (0, 1, 4))
"""Rows that may be there."""

SCALES = ((1.0, 1.0), (1.0, 1e-6), (1e-4, 1e12), (1e6, 1e-6))
"""Of H P- H' and of R: ordinary, a tiny R, an R that is all but infinite, a prior that knows nothing."""

STATES = 9
"""Of the filter: three quantities on three axes."""

SIGMAS = (0.0, 1.0, 1.0, 100.0)
"""Size of the innovation in standard deviations; the last is an outlier."""


class Update(NamedTuple):
    """The input of `adapt` in one update, besides its memory."""

    innovation: FloatArray
    HPHt: FloatArray
    R: FloatArray
    rows: IntArray


class Prior(NamedTuple):
    """The state before an update, as `adapt_prior` sees it."""

    x: FloatArray
    P: FloatArray
    F: FloatArray
    Q: FloatArray


def every_kind() -> Iterator[tuple[Update, Prior]]:
    """Updates with rows that come and go, outliers, a tiny and a huge R; in the end many of one kind."""
    random = stream(0, "conformance", "adaptation")
    for scales in SCALES:
        for sigma in SIGMAS:
            for rows in ROWS:
                yield _update(random, rows, scales, sigma)
    for _ in range(40):  # long enough for every window and every counter
        yield _update(random, ROWS[0], SCALES[0], 100.0)


def ordinary(random: np.random.Generator, rows: tuple[int, ...], sigma: float) -> tuple[Update, Prior]:
    """An update whose prior and R are of the same size, off by ``sigma`` standard deviations."""
    return _update(random, rows, SCALES[0], sigma)


def _update(
    random: np.random.Generator, rows: tuple[int, ...], scales: tuple[float, float], sigma: float
) -> tuple[Update, Prior]:
    m, measured = len(rows), np.array(rows)
    prior = _prior(random, scales[0])
    half = random.normal(size=(m, 2 * m)) / np.sqrt(2 * m)
    HPHt, R = prior.P[np.ix_(measured, measured)], scales[1] * half @ half.T
    innovation = sigma * np.sqrt(np.diag(HPHt + R)) * random.choice([-1.0, 1.0], size=m)
    return Update(innovation, HPHt, 0.5 * (R + R.T), measured), prior


def _prior(random: np.random.Generator, scale: float) -> Prior:
    """A step of a second from a full covariance."""
    half, noise = random.normal(size=(2, STATES, 2 * STATES)) / np.sqrt(2 * STATES)
    F = np.eye(STATES) + 0.1 * np.eye(STATES, k=3)
    Q = 0.1 * scale * noise @ noise.T
    P = scale * F @ half @ half.T @ F.T + Q
    return Prior(random.normal(size=STATES), 0.5 * (P + P.T), F, 0.5 * (Q + Q.T))
