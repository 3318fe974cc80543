"""Recordings made by hand: a body at rest or at constant velocity, without any noise unless a test adds it."""

from dataclasses import replace

import numpy as np

from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Heading, Imu, Position, Recording, Reference, Velocity


def recording_at_rest(
    duration_s=60.0, imu_rate_hz=100, gnss_rate_hz=5, position_sigma_m=0.01, velocity_sigma_mps=0.03, **replaced
):
    """Level and at rest at the origin; all stamps are k/rate."""
    t = np.arange(1, round(duration_s * imu_rate_hz) + 1) / imu_rate_hz
    fixes = np.arange(1, round(duration_s * gnss_rate_hz) + 1) / gnss_rate_hz
    accel = np.tile([0.0, 0.0, 9.81], (len(t), 1))
    zeros = np.zeros((len(fixes), 3))
    parts = {
        "name": "rest",
        "imu": Imu(t, accel, np.zeros_like(accel)),
        "position": Position(fixes, zeros, np.tile(position_sigma_m**2 * np.eye(3), (len(fixes), 1, 1))),
        "velocity": Velocity(fixes, zeros, np.tile(velocity_sigma_mps**2 * np.eye(3), (len(fixes), 1, 1))),
        "reference": Reference(t, "made by hand", independent=True, enu_m=0 * accel, velocity_mps=0 * accel),
    }
    return Recording(**{**parts, **replaced})


def level_attitude(recording, accel_enu_mps2=(0.0, 0.0, 0.0)):
    """The attitude of a level body that heads east, with the input u as given (constant, or one row a sample)."""
    n = len(recording.imu.t_s)
    u = np.broadcast_to(np.asarray(accel_enu_mps2, dtype=float), (n, 3))
    return Attitude(recording.imu.t_s, np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), u, np.zeros(n, dtype=bool))


def with_fix_noise(recording, seed=1, position_sigma_m=0.01, velocity_sigma_mps=0.03):
    """The recording with white noise of positions and velocities, by default as its covariances state."""
    rng, position, velocity = np.random.default_rng(seed), recording.position, recording.velocity
    enu_m = position.enu_m + rng.normal(0.0, position_sigma_m, position.enu_m.shape)
    mps = velocity.mps + rng.normal(0.0, velocity_sigma_mps, velocity.mps.shape)
    return replace(recording, position=replace(position, enu_m=enu_m), velocity=replace(velocity, mps=mps))


def integrated(recording):
    """Position and velocity at the end, from the IMU at 100 Hz and the true attitude, with the midpoint rule."""
    reference = recording.reference
    dcm, v, p = dcm_from_euler(reference.euler_rad), reference.velocity_mps[0], reference.enu_m[0]
    for k in range(1, len(reference.t_s)):
        u = 0.5 * (dcm[k - 1] + dcm[k]) @ recording.imu.accel_mps2[k] - [0.0, 0.0, 9.81]
        p, v = p + 0.01 * v + 0.5 * 0.01**2 * u, v + 0.01 * u
    return p, v


def body_velocity(recording):
    """The velocities (n, 3) of a recording in the frame of the body, with the true attitude."""
    truth = recording.reference
    rows = np.searchsorted(truth.t_s, recording.velocity.t_s - 1e-6)
    return np.einsum("nji,nj->ni", dcm_from_euler(truth.euler_rad[rows]), recording.velocity.mps)


def with_true_headings(recording):
    """The recording with some headings between the fixes, interpolated from the true yaw."""
    truth, t_s = recording.reference, recording.position.t_s[20::3] + 0.0037
    yaw = np.interp(t_s, truth.t_s, np.unwrap(truth.euler_rad[:, 2]))
    heading = Heading(t_s, np.mod(yaw + np.pi, 2 * np.pi) - np.pi, np.full(len(t_s), 0.02))
    return replace(recording, heading=heading)
