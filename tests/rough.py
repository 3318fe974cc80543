"""A rough recording: whatever may happen between two updates and in one."""

from dataclasses import replace

import numpy as np

from jerkbench.recording import Position, Reference, Velocity
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest


def full_covariances(rng, sigma, n):
    """Symmetric positive definite, different each time, with off-diagonals."""
    half = rng.normal(size=(n, 3, 5)) * sigma
    return half @ half.transpose(0, 2, 1) + (0.3 * sigma) ** 2 * np.eye(3)


def rough_recording(duration_s, seed=0):
    """Fixes off the grid, full covariances, outliers, missing axes, position and velocity now together, now apart."""
    rng = np.random.default_rng(seed)
    rest = recording_at_rest(duration_s=duration_s, imu_rate_hz=50)
    at_p = np.round(np.arange(0.2, duration_s, 0.1) + 0.0031, 4)
    at_v = np.sort(np.concatenate([at_p[::2], np.round(at_p[1::2] + 0.035, 4)]))
    p = rng.normal(0.0, 0.02, (len(at_p), 3)) * np.where(rng.random((len(at_p), 1)) < 0.1, 40.0, 1.0)
    v = rng.normal(0.0, 0.05, (len(at_v), 3)) * np.where(rng.random((len(at_v), 1)) < 0.1, 20.0, 1.0)
    p[rng.random(p.shape) < 0.1], p[0] = np.nan, 0.0
    v[rng.random(v.shape) < 0.1] = np.nan
    R_p, R_v = full_covariances(rng, 0.02, len(at_p)), full_covariances(rng, 0.05, len(at_v))
    stamps = np.round(np.arange(0.1, duration_s, 0.03), 4)
    zeros = np.zeros((len(stamps), 3))
    return replace(
        rest,
        position=Position(at_p, p, R_p, 4.0 * R_p),
        velocity=Velocity(at_v, v, R_v),
        reference=Reference(stamps, "made by hand", independent=True, enu_m=zeros, velocity_mps=zeros),
    )


def rough_timeline(duration_s):
    recording = rough_recording(duration_s)
    u = np.random.default_rng(1).normal(0.0, 0.2, (len(recording.imu.t_s), 3))
    return build_timeline(recording, level_attitude(recording, u))
