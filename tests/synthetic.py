"""Recordings made by hand: a body at rest or at constant velocity, without any noise unless a test adds it."""

from dataclasses import replace

import numpy as np

from jerkbench.estimate import Attitude
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity


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
