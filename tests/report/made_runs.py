"""A drive over a figure of eight and estimates of it, for the figures of runs."""

import dataclasses

import numpy as np

from jerkbench.estimate import Estimate, Updates
from jerkbench.recording import Imu, Position, Recording, Reference

N = 400
T_S = 0.1 * np.arange(1, N + 1)


def make_recording(**changes):
    angle = 2 * np.pi * T_S / T_S[-1]
    enu_m = np.column_stack([30 * np.sin(angle), 10 * np.sin(2 * angle), 0 * angle])
    euler = 0.1 * np.column_stack([np.sin(angle), np.cos(angle), angle])
    rng = np.random.default_rng(1)
    parts = {
        "position": Position(T_S[::5], enu_m[::5] + 0.3, np.tile(np.eye(3), (N // 5, 1, 1))),
        "reference": Reference(T_S, "drawn", independent=True, enu_m=enu_m, velocity_mps=0 * enu_m, euler_rad=euler),
    }
    imu = Imu(T_S, rng.normal((0.0, 0.0, 9.8), 1.0, size=(N, 3)), rng.normal(size=(N, 3)))
    return Recording("A field", imu, **(parts | changes))


def bare_recording():
    """Without anything to compare with."""
    return make_recording(reference=Reference(T_S, "none", independent=True), position=None)


def make_estimate(error_m=0.1, seed=1, rows=slice(None)):
    """Errors of this sigma; the second row of ten updates was dropped."""
    rng, reference = np.random.default_rng(seed), make_recording().reference
    position_m = reference.enu_m + error_m * rng.normal(size=(N, 3))
    velocity_mps = error_m * rng.normal(size=(N, 3))
    updates = Updates(
        t_s=T_S[::5],
        rows=np.full(80, 6.0),
        nis=rng.chisquare(6, 80),
        nis_used=rng.chisquare(6, 80),
        innovation=rng.normal(size=(80, 6)),
        R_diagonal=rng.uniform(0.01, 0.1, size=(80, 6)),
    )
    updates.R_diagonal[10:20, 1] = np.inf
    covariance = np.tile(np.eye(6) * error_m**2, (N, 1, 1))
    parts = np.arange(N), position_m, velocity_mps, covariance, reference.euler_rad + 0.01
    return Estimate(*(part[rows] for part in parts), updates)


def broken_estimate():
    """Runs away, and then is no number."""
    one = make_estimate()
    position_m = one.position_m.copy()
    position_m[200:300] += 1e5 * np.arange(100)[:, None]
    position_m[300:350] = 1e300
    position_m[350:] = np.nan
    return dataclasses.replace(one, position_m=position_m, covariance=-one.covariance, updates=Updates.empty())


def moved(estimate, rows, by_m):
    """The estimate with some of its positions somewhere else."""
    position_m = estimate.position_m.copy()
    position_m[rows] += by_m
    return dataclasses.replace(estimate, position_m=position_m)
