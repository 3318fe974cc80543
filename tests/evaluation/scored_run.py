"""One small run with random errors, holes in its reference, an outage and a few updates."""

import dataclasses

import numpy as np

from jerkbench.estimate import Estimate, Updates
from jerkbench.recording import Imu, Recording, Reference

K = 60


def make_recording(**changes):
    rng = np.random.default_rng(1)
    t_s = 0.5 * np.arange(K + 10)
    values = {name: rng.normal(size=(K + 10, 3)) for name in ("enu_m", "velocity_mps", "euler_rad")}
    values["enu_m"][20] = np.nan
    values["enu_m"][25, 2] = np.nan
    values["velocity_mps"][22, 0] = np.nan
    scored = np.ones(K + 10, dtype=bool)
    scored[30:33] = False
    reference = Reference(t_s, "drawn", independent=True, scored=scored, **(values | changes.pop("reference", {})))
    imu = Imu(t_s, np.zeros((K + 10, 3)), np.zeros((K + 10, 3)))
    outages_s = changes.pop("outages_s", [[10.0, 14.0], [20.0, 22.0]])
    return Recording("drawn", imu, reference, outages_s=np.array(outages_s).reshape(-1, 2), **changes)


def make_estimate(recording, **changes):
    rng = np.random.default_rng(2)
    index = np.arange(5, K + 5)
    root = rng.normal(size=(K, 6, 6))
    rows = rng.choice([3.0, 6.0], size=40)
    updates = Updates(
        t_s=0.75 * np.arange(40),
        rows=rows,
        nis=rng.chisquare(rows),
        nis_used=rng.chisquare(rows),
        innovation=np.ones((40, 6)),
        R_diagonal=np.where(np.arange(6) < rows[:, None], 1.0, np.nan),
    )
    estimate = Estimate(
        index=index,
        position_m=np.nan_to_num(recording.reference.enu_m[index]) + rng.normal(size=(K, 3)),
        velocity_mps=np.nan_to_num(recording.reference.velocity_mps[index]) + rng.normal(size=(K, 3)),
        covariance=root @ root.transpose(0, 2, 1) + np.eye(6),
        euler_rad=recording.reference.euler_rad[index] + 0.1 * rng.normal(size=(K, 3)),
        updates=updates,
    )
    return dataclasses.replace(estimate, **changes)
